import {
  AmbientLight,
  Box3,
  BoxGeometry,
  BufferGeometry,
  Color,
  ConeGeometry,
  CylinderGeometry,
  DirectionalLight,
  EdgesGeometry,
  Float32BufferAttribute,
  Group,
  HemisphereLight,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  NeutralToneMapping,
  PerspectiveCamera,
  PMREMGenerator,
  Raycaster,
  Scene,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { STYLE } from "./style.js";

const BACKGROUND = 0xf3f4f6;
const ACCENT = 0x2563eb;
const AXIS_COLOUR = 0xea580c;
const COLLISION_COLOUR = 0x0d9488;
const ASSUMED_COLOUR = 0xd97706;
const UP = new Vector3(0, 1, 0);
const TURN = 0.52;
const VERDICTS = ["pass", "fail", "undetermined"];

const NO_WEBGL =
  "The 3D view needs WebGL, and this browser does not offer it. " +
  "Everything else on this page can still be read; to see the scene, open the page in a browser with WebGL switched on.";

/* ---------------------------------------------------------------- helpers */

function element(tag, className, text) {
  const node = document.createElement(tag);
  if (className) node.className = className;
  if (text !== undefined) node.textContent = text;
  return node;
}

function addStyleOnce() {
  if (document.getElementById("paws-viewer-style")) return;
  const style = element("style");
  style.id = "paws-viewer-style";
  style.textContent = STYLE;
  document.head.append(style);
}

function showMessage(root, text) {
  const box = element("p", "pv-message", text);
  box.setAttribute("role", "status");
  root.replaceChildren(box);
}

function webglWorks() {
  try {
    return Boolean(document.createElement("canvas").getContext("webgl2"));
  } catch {
    return false;
  }
}

const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const ease = (t) => (t < 0.5 ? 4 * t * t * t : 1 - (2 - 2 * t) ** 3 / 2);
const smooth = (t) => t * t * (3 - 2 * t);

/* ----------------------------------------------------------------- joints */

/**
 * One joint: a pivot node of the scene, with its limits turned into a travel from `from` (the limit
 * nearer to the rest pose, so "closed") to `to` (the farther one, so "open"). Everything else talks in
 * fractions of that travel, which keeps "left is closed" true for a slider whatever the sign of the limits.
 */
class Joint {
  constructor(node, extras, index) {
    this.node = node;
    this.id = String(extras.id ?? `joint_${index}`);
    this.label = String(extras.label ?? node.name ?? this.id);
    this.slides = extras.kind === "prismatic";
    this.verdict = VERDICTS.includes(extras.verdict) ? extras.verdict : "undetermined";
    this.axis = new Vector3(...(extras.axis ?? [0, 0, 1]));
    if (this.axis.lengthSq() < 1e-12) this.axis.set(0, 0, 1);
    this.axis.normalize();

    let lower = Number(extras.lower ?? 0);
    let upper = Number(extras.upper ?? (this.slides ? 0.3 : Math.PI / 2));
    if (!Number.isFinite(lower)) lower = 0;
    if (!Number.isFinite(upper)) upper = lower;
    if (lower > upper) [lower, upper] = [upper, lower];
    const backwards = Math.abs(lower) > Math.abs(upper);
    this.from = backwards ? upper : lower;
    this.to = backwards ? lower : upper;
    // A range on both sides of the rest pose needs its sign; a one-sided one reads better without.
    this.signed = lower < -1e-6 && upper > 1e-6;

    this.restPosition = node.position.clone();
    this.restQuaternion = node.quaternion.clone();
    this.restScale = node.scale.clone();
    this.fixed = Math.abs(this.to - this.from) < 1e-9;
    this.closed = this.fixed ? 0 : clamp((0 - this.from) / (this.to - this.from), 0, 1);
    this.fraction = this.closed;
    this.tween = null;
    this.meshes = [];
    this.row = null;
  }

  get value() {
    return this.from + this.fraction * (this.to - this.from);
  }

  /** The sign of the joint's positive sense that opens it. */
  get opening() {
    return this.to >= this.from ? 1 : -1;
  }

  set(fraction) {
    this.fraction = clamp(fraction, 0, 1);
    const { node, value } = this;
    if (this.slides) {
      node.position
        .copy(this.axis)
        .multiplyScalar(value)
        .multiply(this.restScale)
        .applyQuaternion(this.restQuaternion)
        .add(this.restPosition);
    } else {
      node.quaternion.setFromAxisAngle(this.axis, value).premultiply(this.restQuaternion);
    }
  }

  text(value = this.value) {
    const shown = this.signed ? value : Math.abs(value);
    const plain = (x, digits) => x.toFixed(digits).replace(/^-(0(?:\.0+)?)$/, "$1");
    return this.slides ? `${plain(shown * 100, 1)} cm` : `${plain((shown * 180) / Math.PI, 0)}°`;
  }
}

/** What a node of the scene stands for: "look" (a textured mesh), "box" (of the model), or nothing in particular. */
function kindOf(node) {
  if (node.userData?.role !== undefined) return "box";
  return [node.material].flat().some((m) => m?.map) ? "look" : "";
}

/** Boxes that textured meshes hide have nodes without meshes: their scale is their size. */
function addHiddenBoxes(root) {
  const empty = [];
  root.traverse((node) => {
    if (node.userData?.role !== undefined && !node.isMesh && node.children.length === 0) empty.push(node);
  });
  const cube = new BoxGeometry(1, 1, 1);
  for (const node of empty) {
    const mesh = new Mesh(cube, new MeshStandardMaterial({ color: 0xb8babc, roughness: 0.7 }));
    mesh.userData = node.userData;
    node.add(mesh);
  }
}

/** Finds the pivots and gives each one the meshes that it moves and no joint below it does. */
function findJoints(root) {
  const joints = [];
  const meshes = [];
  const walk = (node, owner) => {
    let current = owner;
    if (node.userData?.joint) {
      current = new Joint(node, node.userData.joint, joints.length);
      joints.push(current);
    }
    if (node.isMesh) {
      meshes.push(node);
      node.userData.pawsJoint = current;
      current?.meshes.push(node);
    }
    for (const child of node.children) walk(child, current);
  };
  walk(root, null);
  // The order of the tables, which go by id, rather than the order of the nodes.
  joints.sort((a, b) => a.id.localeCompare(b.id, "en", { numeric: true }));
  return { joints, meshes };
}

/** Bounds of some meshes, in the frame of `frame` (the world's if none is given). */
function boundsOf(meshes, frame) {
  const bounds = new Box3();
  const toFrame = frame ? new Matrix4().copy(frame.matrixWorld).invert() : new Matrix4();
  for (const mesh of meshes) {
    if (!mesh.geometry.boundingBox) mesh.geometry.computeBoundingBox();
    const box = mesh.geometry.boundingBox.clone();
    box.applyMatrix4(new Matrix4().multiplyMatrices(toFrame, mesh.matrixWorld));
    bounds.union(box);
  }
  return bounds;
}

function corners(box) {
  const out = [];
  for (let i = 0; i < 8; i++) {
    out.push(
      new Vector3(
        i & 1 ? box.max.x : box.min.x,
        i & 2 ? box.max.y : box.min.y,
        i & 4 ? box.max.z : box.min.z,
      ),
    );
  }
  return out;
}

/* ------------------------------------------------------------------ looks */

/**
 * Materials of a glTF are shared between meshes; a highlight on one part must not light up the others,
 * so each mesh gets its own copy. The outline is what separates a handle from a front of the same colour.
 */
function dressMeshes(meshes) {
  const outline = new LineBasicMaterial({ color: 0x111827, transparent: true, opacity: 0.32 });
  for (const mesh of meshes) {
    if (kindOf(mesh) === "look") {
      // Its colours were seen in the room's light; another light would be one too many.
      const seen = (material) => {
        const copy = new MeshBasicMaterial({ map: material.map, toneMapped: false });
        copy.userData.plainColour = copy.color.clone();
        return copy;
      };
      mesh.material = Array.isArray(mesh.material) ? mesh.material.map(seen) : seen(mesh.material);
      continue;
    }
    const own = (material) => {
      const copy = material.clone();
      // Pushes the faces back a little, or they flicker through their own outline.
      copy.polygonOffset = true;
      copy.polygonOffsetFactor = 1;
      copy.polygonOffsetUnits = 1;
      copy.userData.plainEmissive = copy.emissive?.clone();
      copy.userData.plainIntensity = copy.emissiveIntensity;
      copy.userData.plainColour = copy.color?.clone();
      return copy;
    };
    mesh.material = Array.isArray(mesh.material) ? mesh.material.map(own) : own(mesh.material);
    const count = mesh.geometry.index?.count ?? mesh.geometry.attributes.position?.count ?? 0;
    // Outlines are for boxes; on a dense scan they would be noise and slow.
    if (count > 0 && count < 30000) {
      const lines = new LineSegments(new EdgesGeometry(mesh.geometry, 25), outline);
      lines.raycast = () => {};
      mesh.add(lines);
    }
  }
}

function tint(joint, on) {
  for (const mesh of joint.meshes) {
    for (const material of [mesh.material].flat()) {
      if (!material.emissive) {
        material.color.copy(material.userData.plainColour);
        if (on) material.color.lerp(new Color(ACCENT), 0.35);
      } else if (on) {
        // Light alone cannot colour a white front, so the paint is turned towards the accent as well.
        material.emissive.setHex(ACCENT);
        material.emissiveIntensity = 0.3;
        material.color.copy(material.userData.plainColour).lerp(new Color(ACCENT), 0.35);
      } else {
        material.emissive.copy(material.userData.plainEmissive);
        material.emissiveIntensity = material.userData.plainIntensity;
        material.color.copy(material.userData.plainColour);
      }
    }
  }
}

/**
 * Shows a box as what the switches say: solid, as a body to collide with (seen through), marked as assumed, or not at all.
 * The plain colour stays what a highlight goes back to.
 */
function dressBox(mesh, show) {
  const assumed = show.assumed && mesh.userData.seen === false;
  mesh.visible = show.boxes || show.collision || assumed;
  for (const material of [mesh.material].flat()) {
    const { userData } = material;
    userData.ownColour ??= userData.plainColour.clone();
    userData.plainColour.copy(userData.ownColour);
    if (assumed) userData.plainColour.setHex(ASSUMED_COLOUR);
    else if (show.collision) userData.plainColour.setHex(COLLISION_COLOUR);
    material.color.copy(userData.plainColour);
    if (material.transparent === show.boxes) material.needsUpdate = true;
    material.transparent = !show.boxes;
    material.opacity = show.boxes ? 1 : 0.3;
    material.depthWrite = show.boxes;
  }
}

function niceStep(radius) {
  for (const step of [0.05, 0.1, 0.25, 0.5, 1, 2, 5, 10]) if (radius / step < 7) return step;
  return 25;
}

/** A ground grid that fades out with distance, so that the scene does not sit on a hard-edged tile. */
function makeGrid(centre, radius, floor) {
  const step = niceStep(radius);
  const reach = Math.ceil((radius * 2.6) / step);
  const midX = Math.round(centre.x / step) * step;
  const midZ = Math.round(centre.z / step) * step;
  const positions = [];
  const colours = [];
  const ink = new Color(0x94a3b8);
  const point = (i, k) => {
    positions.push(midX + i * step, floor, midZ + k * step);
    const far = Math.hypot(i, k) / reach;
    colours.push(ink.r, ink.g, ink.b, 0.45 * (1 - smooth(clamp(far, 0, 1))));
  };
  for (let i = -reach; i <= reach; i++) {
    for (let k = -reach; k < reach; k++) {
      if (Math.min(Math.hypot(i, k), Math.hypot(i, k + 1)) > reach) continue;
      point(i, k);
      point(i, k + 1);
      point(k, i);
      point(k + 1, i);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new Float32BufferAttribute(positions, 3));
  geometry.setAttribute("color", new Float32BufferAttribute(colours, 4));
  const grid = new LineSegments(
    geometry,
    new LineBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false, toneMapped: false }),
  );
  return { grid, step };
}

/**
 * The joint axis, drawn over everything else: a hinge's line runs along the part's edge, a slide's arrow
 * shows the travel. It hangs beside the pivot at the rest pose, so it stays put while the part moves.
 */
function makeAxis(joint, size) {
  const local = boundsOf(joint.meshes, joint.node);
  const holder = new Group();
  holder.position.copy(joint.restPosition);
  holder.quaternion.copy(joint.restQuaternion);
  holder.scale.copy(joint.restScale);

  const thickness = size * 0.0028;
  let start;
  let length;
  let direction;
  if (joint.slides) {
    direction = joint.axis.clone().multiplyScalar(joint.opening);
    const middle = local.isEmpty() ? new Vector3() : local.getCenter(new Vector3());
    const along = local.isEmpty() ? [0] : corners(local).map((c) => c.clone().sub(middle).dot(direction));
    start = middle.addScaledVector(direction, Math.max(...along));
    length = Math.max(Math.abs(joint.to - joint.from), size * 0.06);
  } else {
    direction = joint.axis.clone();
    const along = local.isEmpty() ? [-0.2 * size, 0.2 * size] : corners(local).map((c) => c.dot(direction));
    const low = Math.min(...along);
    const high = Math.max(...along);
    const spare = Math.max(0.1 * (high - low), size * 0.035);
    start = direction.clone().multiplyScalar(low - spare);
    length = high - low + 2 * spare;
  }

  const material = new MeshBasicMaterial({
    color: AXIS_COLOUR,
    depthTest: false,
    transparent: true,
    toneMapped: false,
  });
  const head = Math.min(thickness * 8, length * 0.4);
  const shaft = new Mesh(new CylinderGeometry(thickness, thickness, length - head, 10), material);
  shaft.position.y = (length - head) / 2;
  const tip = new Mesh(new ConeGeometry(head * 0.38, head, 16), material);
  tip.position.y = length - head / 2;
  const arrow = new Group();
  arrow.add(shaft, tip);
  arrow.position.copy(start);
  arrow.quaternion.setFromUnitVectors(UP, direction);
  for (const part of [shaft, tip]) {
    part.renderOrder = 10;
    part.raycast = () => {};
  }
  holder.add(arrow);
  holder.visible = false;
  (joint.node.parent ?? joint.node).add(holder);
  return holder;
}

/* ----------------------------------------------------------------- camera */

/** The way a part starts to move when it opens, in the world, and where its middle lies from its hinge. */
function openingMotion(joint) {
  const world = joint.node.matrixWorld;
  const axis = joint.axis.clone().transformDirection(world);
  if (joint.slides) return { direction: axis.multiplyScalar(joint.opening), arm: null };
  const pivot = new Vector3().setFromMatrixPosition(world);
  const bounds = boundsOf(joint.meshes);
  if (bounds.isEmpty()) return { direction: new Vector3(), arm: null };
  const arm = bounds.getCenter(new Vector3()).sub(pivot);
  arm.addScaledVector(axis, -arm.dot(axis));
  const direction = axis.clone().cross(arm).multiplyScalar(joint.opening);
  if (direction.lengthSq() > 0) direction.normalize();
  return { direction, arm };
}

/** From where to look: the mean opening direction, turned aside by a third of a right angle, from above. */
function viewDirection(joints) {
  const front = new Vector3();
  const motions = joints.map(openingMotion);
  for (const { direction } of motions) front.add(direction.clone().setY(0));
  if (front.length() < 0.25 * Math.max(1, joints.length)) {
    // Fronts that face each other cancel out; one of them is then better than their meaningless mean.
    const flat = motions.map((m) => m.direction.clone().setY(0)).find((d) => d.length() > 0.5);
    if (flat) front.copy(flat);
  }
  if (front.lengthSq() < 1e-9) front.set(0, 0, 1);
  front.normalize();
  const aside = (turn) => front.clone().applyAxisAngle(UP, turn);
  // Of the two sides, the one from which the worst seen front is seen better: it matters round a corner.
  const worst = (view) => Math.min(1, ...motions.map(({ direction }) => direction.dot(view)));
  const gain = worst(aside(TURN)) - worst(aside(-TURN));
  // Otherwise, away from the hinges: an open door hides what lies behind it on its hinge's side.
  const right = new Vector3().crossVectors(UP, front);
  let arms = 0;
  for (const { arm } of motions) if (arm) arms += Math.sign(Math.round(arm.dot(right) * 100));
  const side = Math.abs(gain) > 0.1 ? Math.sign(gain) : arms < 0 ? -1 : 1;
  const elevation = 0.38;
  return aside(side * TURN)
    .multiplyScalar(Math.cos(elevation))
    .add(new Vector3(0, Math.sin(elevation), 0))
    .normalize();
}

/** Puts the camera as near as it can be with every point inside the picture, centred. */
function fitCamera(camera, points, direction, centre) {
  const target = centre.clone();
  const back = direction.clone();
  const right = new Vector3().crossVectors(UP, back).normalize();
  const up = new Vector3().crossVectors(back, right);
  const tanV = Math.tan((camera.fov * Math.PI) / 360);
  const tanH = tanV * camera.aspect;
  let distance = 1;
  for (let pass = 0; pass < 4; pass++) {
    distance = 0;
    const local = points.map((p) => {
      const offset = p.clone().sub(target);
      return [offset.dot(right), offset.dot(up), offset.dot(back)];
    });
    for (const [x, y, z] of local) {
      distance = Math.max(distance, z + Math.abs(x) / tanH, z + Math.abs(y) / tanV);
    }
    let [left, rightmost, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (const [x, y, z] of local) {
      const depth = distance - z;
      left = Math.min(left, x / depth);
      rightmost = Math.max(rightmost, x / depth);
      low = Math.min(low, y / depth);
      high = Math.max(high, y / depth);
    }
    target.addScaledVector(right, ((left + rightmost) / 2) * distance);
    target.addScaledVector(up, ((low + high) / 2) * distance);
  }
  distance *= 1.12;
  camera.position.copy(target).addScaledVector(back, distance);
  return { target, distance };
}

/* ------------------------------------------------------------------ mount */

/**
 * Shows a scene in `container`.
 *
 * @param {HTMLElement} container emptied and filled with the canvas and the joint controls
 * @param {ArrayBuffer} glb a binary glTF, Y up, whose pivot nodes carry `extras.joint`
 * @param {{open?: number}} [options] `open`: how far the joints stand open at first (0 to 1; else at rest)
 * @returns {Promise<object|null>} a handle to drive the scene with, or null if it cannot be shown
 */
export async function mount(container, glb, options = {}) {
  addStyleOnce();
  const root = element("div", "pv");
  container.replaceChildren(root);

  if (!webglWorks()) {
    showMessage(root, NO_WEBGL);
    return null;
  }
  let gltf;
  try {
    gltf = await new GLTFLoader().parseAsync(glb, "");
  } catch (error) {
    showMessage(root, `The 3D scene could not be read (${error?.message ?? error}).`);
    return null;
  }
  let renderer;
  try {
    // The buffer is kept because a printed page would otherwise show an empty canvas.
    renderer = new WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  } catch {
    showMessage(root, NO_WEBGL);
    return null;
  }
  return new Viewer(root, renderer, gltf.scene, options).handle();
}

class Viewer {
  constructor(root, renderer, model, options) {
    this.root = root;
    this.renderer = renderer;
    this.still = window.matchMedia?.("(prefers-reduced-motion: reduce)").matches ?? false;
    this.queued = false;
    this.selected = null;
    this.hot = null;
    this.userMoved = false;
    this.shot = null;

    addHiddenBoxes(model);
    const { joints, meshes } = findJoints(model);
    this.joints = joints;
    this.meshes = meshes;
    this.looks = meshes.filter((mesh) => kindOf(mesh) === "look");
    this.boxes = meshes.filter((mesh) => kindOf(mesh) === "box");
    const dressed = this.looks.length > 0;
    this.show = { look: dressed, boxes: !dressed, collision: false, assumed: false };
    model.updateMatrixWorld(true);

    this.buildScene(model);
    this.buildPage();
    this.buildControls();
    this.refreshLayers();

    if (Number.isFinite(options.open)) {
      for (const joint of joints) joint.set(joint.closed + options.open * (1 - joint.closed));
    }
    for (const joint of joints) this.refreshRow(joint);
    this.refreshButtons();
    this.resize();
    new ResizeObserver(() => this.resize()).observe(this.stage);
    window.addEventListener("beforeprint", () => this.draw());
    // The first picture is drawn at once: a page that is printed or captured early has it already.
    this.draw();
    root.dataset.ready = "true";
  }

  buildScene(model) {
    const { renderer, joints, meshes } = this;
    renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    renderer.toneMapping = NeutralToneMapping;
    renderer.toneMappingExposure = 1.0;

    const scene = new Scene();
    scene.background = new Color(BACKGROUND);
    scene.add(model);
    this.scene = scene;
    this.camera = new PerspectiveCamera(32, 1, 0.01, 100);

    dressMeshes(meshes);

    const everything = boundsOf(meshes);
    if (everything.isEmpty()) everything.set(new Vector3(-0.5, 0, -0.5), new Vector3(0.5, 1, 0.5));
    const direction = viewDirection(joints);
    this.direction = direction;

    // What must be in the picture: the parts closed and open, and the rest of the furniture, but not the
    // walls and the floor of a room, which would shrink the furniture to nothing.
    const moving = joints.flatMap((joint) => joint.meshes);
    const focus = boundsOf(moving);
    for (const joint of joints) joint.set(1);
    model.updateMatrixWorld(true);
    const swept = boundsOf(moving);
    for (const joint of joints) joint.set(joint.closed);
    model.updateMatrixWorld(true);
    const size = (box) => (box.isEmpty() ? 0 : box.getSize(new Vector3()).length());
    const wanted = boundsOf(
      focus.isEmpty() ? meshes : meshes.filter((mesh) => size(boundsOf([mesh])) < 1.5 * Math.max(size(focus), 1)),
    );
    const tooMuch = !focus.isEmpty() && size(wanted) > 4 * size(focus);
    this.points = wanted.isEmpty() || tooMuch ? [] : corners(wanted);
    // The swept box's far corners are mostly air; a part of the way to them is enough for the picture.
    if (!focus.isEmpty()) {
      const at = corners(focus);
      corners(swept.union(focus)).forEach((corner, i) => this.points.push(at[i], at[i].clone().lerp(corner, 0.7)));
    }
    if (this.points.length === 0) this.points = corners(everything);
    const framed = new Box3().setFromPoints(this.points);
    this.centre = framed.getCenter(new Vector3());
    this.radius = Math.max(size(framed) / 2, 0.05);
    const reach = Math.max(size(everything) / 2, this.radius);
    this.camera.near = this.radius / 50;
    this.camera.far = (reach + this.radius) * 20;

    for (const joint of joints) joint.arrow = makeAxis(joint, this.radius * 2);

    const { grid, step } = makeGrid(this.centre, this.radius, everything.min.y - 0.002 * this.radius);
    scene.add(grid);
    this.gridStep = step;

    // Without something to mirror, metal (which is glTF's default material) renders black.
    const generator = new PMREMGenerator(renderer);
    const surroundings = new RoomEnvironment();
    scene.environment = generator.fromScene(surroundings, 0.04).texture;
    scene.environmentIntensity = 0.42;
    surroundings.dispose?.();
    generator.dispose();

    scene.add(new AmbientLight(0xffffff, 0.15));
    scene.add(new HemisphereLight(0xffffff, 0xc9c5c0, 0.5));
    const key = new DirectionalLight(0xffffff, 1.15);
    // From the other side of the front than the camera, so that the faces of a box differ in brightness.
    key.position.copy(direction).setY(0).normalize().applyAxisAngle(UP, -0.9).add(new Vector3(0, 1.1, 0));
    scene.add(key);
    const fill = new DirectionalLight(0xffffff, 0.3);
    fill.position.copy(direction);
    scene.add(fill);
  }

  buildPage() {
    const { root, renderer, joints } = this;
    const stage = element("div", "pv-stage");
    const canvas = renderer.domElement;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", "3D scene of the articulated furniture");
    const step = this.gridStep < 1 ? `${Math.round(this.gridStep * 100)} cm` : `${this.gridStep} m`;
    const hint = element("div", "pv-hint", `Drag to turn. Click a part to open or close it. Grid: ${step}.`);
    const home = element("button", "pv-button pv-home", "Reset view");
    home.type = "button";
    home.addEventListener("click", () => {
      this.userMoved = false;
      this.frameCamera();
    });
    const lost = element("p", "pv-message pv-lost", "The browser has stopped the 3D view; reload the page to see it.");
    canvas.addEventListener("webglcontextlost", () => root.classList.add("pv-is-lost"));
    canvas.addEventListener("webglcontextrestored", () => {
      root.classList.remove("pv-is-lost");
      this.draw();
    });
    stage.append(canvas, this.buildShot(), hint, home, this.buildSwitches(), lost);

    const panel = element("div", "pv-panel");
    const head = element("div", "pv-head");
    head.append(element("span", "pv-title", "Joints"));
    const both = element("div", "pv-both");
    this.openAll = element("button", "pv-button", "Open all");
    this.closeAll = element("button", "pv-button", "Close all");
    for (const button of [this.openAll, this.closeAll]) button.type = "button";
    this.openAll.addEventListener("click", () => this.moveAll(true));
    this.closeAll.addEventListener("click", () => this.moveAll(false));
    both.append(this.openAll, this.closeAll);
    head.append(both);
    panel.append(head);

    const list = element("ul", "pv-list");
    this.list = list;
    for (const joint of joints) list.append(this.buildRow(joint));
    if (joints.length === 0) {
      panel.append(element("p", "pv-none", "This scene has no joint."));
      both.hidden = true;
    }
    panel.append(list);
    root.append(stage, panel);
    this.stage = stage;
    this.panel = panel;
  }

  /** A recorded frame before the scene as its camera sees it, and what wipes it away. */
  buildShot() {
    const layer = element("div", "pv-shot");
    const picture = element("img", "pv-picture");
    picture.alt = "Recorded frame";
    const wipe = element("input", "pv-slider pv-wipe");
    wipe.type = "range";
    wipe.min = "0";
    wipe.max = "1";
    wipe.step = "0.01";
    wipe.value = "0.5";
    wipe.title = "Left: the recorded frame. Right: the twin.";
    wipe.setAttribute("aria-label", "How much of the recorded frame is shown");
    const refresh = () => {
      picture.style.clipPath = `inset(0 ${100 - 100 * Number(wipe.value)}% 0 0)`;
      wipe.style.setProperty("--pv-filled", `${100 * Number(wipe.value)}%`);
    };
    wipe.addEventListener("input", refresh);
    refresh();
    layer.append(picture, wipe);
    this.picture = picture;
    return layer;
  }

  /**
   * Looks from where a frame was taken, the joints as they were then, the frame over the left half of the view. `pose` is the
   * camera's place in the scene (16 numbers, column by column; it looks along its -Z), the rest its image and its lens in pixels.
   */
  lookFrom(shot) {
    this.shot = shot;
    this.userMoved = true;
    this.picture.src = shot.src;
    this.root.classList.add("pv-in-shot");
    this.select(null);
    for (const joint of this.joints) {
      const value = shot.openings?.[joint.id] ?? 0;
      joint.tween = null;
      if (!joint.fixed) joint.set((value - joint.from) / (joint.to - joint.from));
      this.refreshRow(joint);
    }
    this.refreshButtons();
    this.placeShot();
    this.invalidate();
  }

  /** The frame is shown as large as it fits; the rest of the view is what its camera would have seen around it. */
  placeShot() {
    const { shot, camera, stage, picture } = this;
    const [width, height] = [Math.max(stage.clientWidth, 1), Math.max(stage.clientHeight, 1)];
    const scale = Math.min(width / shot.width, height / shot.height);
    const [shownX, shownY] = [(shot.width * scale) / width, (shot.height * scale) / height];
    Object.assign(picture.style, {
      left: `${50 * (1 - shownX)}%`,
      top: `${50 * (1 - shownY)}%`,
      width: `${100 * shownX}%`,
      height: `${100 * shownY}%`,
    });
    new Matrix4().fromArray(shot.pose).decompose(camera.position, camera.quaternion, camera.scale);
    camera.updateMatrixWorld();
    camera.updateProjectionMatrix();
    // Pixels are counted from the middle of the first one; rows go down.
    const lens = camera.projectionMatrix.elements;
    lens[0] = ((2 * shot.fx) / shot.width) * shownX;
    lens[5] = ((2 * shot.fy) / shot.height) * shownY;
    lens[8] = (1 - (2 * (shot.cx + 0.5)) / shot.width) * shownX;
    lens[9] = ((2 * (shot.cy + 0.5)) / shot.height - 1) * shownY;
    camera.projectionMatrixInverse.copy(camera.projectionMatrix).invert();
  }

  /** Takes the frame away; the view stays, upright, and can be turned about what is before it. */
  leaveShot() {
    if (!this.shot) return;
    this.shot = null;
    this.root.classList.remove("pv-in-shot");
    const { camera, controls } = this;
    const ahead = camera.getWorldDirection(new Vector3());
    const distance = Math.max(this.centre.clone().sub(camera.position).dot(ahead), this.radius * 0.5);
    camera.updateProjectionMatrix();
    controls.target.copy(camera.position).addScaledVector(ahead, distance);
    this.invalidate();
  }

  /** What is shown of the scene; a scene that is not made of our boxes has nothing to choose from. */
  buildSwitches() {
    const group = element("div", "pv-switches");
    group.setAttribute("role", "group");
    group.setAttribute("aria-label", "What is shown");
    const assumed = this.boxes.some((mesh) => mesh.userData.seen === false);
    const layers = [
      ["look", "Textures", "Colours and surfaces as they were seen", this.looks.length > 0],
      ["boxes", "Boxes", "The model: what carries masses and contacts", this.boxes.length > 0],
      ["collision", "Collision", "The same boxes, seen through", this.boxes.length > 0],
      ["assumed", "Assumed", "Boxes that nobody saw", assumed],
    ];
    for (const [key, label, title, there] of layers) {
      if (!there) continue;
      const button = element("button", "pv-button pv-switch", label);
      button.type = "button";
      button.title = title;
      button.dataset.layer = key;
      button.addEventListener("click", () => this.setLayer(key, !this.show[key]));
      group.append(button);
    }
    this.switches = group;
    return group;
  }

  setLayer(key, on) {
    if (!(key in this.show)) return;
    this.show[key] = Boolean(on);
    // Both at once would flicker through each other.
    if (on && key === "look") this.show.boxes = false;
    if (on && key === "boxes") this.show.look = false;
    this.refreshLayers();
  }

  refreshLayers() {
    for (const mesh of this.looks) mesh.visible = this.show.look;
    for (const mesh of this.boxes) dressBox(mesh, this.show);
    if (this.hot) tint(this.hot, true);
    for (const button of this.switches.children) {
      button.setAttribute("aria-pressed", String(this.show[button.dataset.layer]));
    }
    this.invalidate();
  }

  buildRow(joint) {
    const row = element("li", "pv-row");
    row.dataset.joint = joint.id;
    const top = element("div", "pv-row-top");
    const name = element("button", "pv-name", joint.label);
    name.type = "button";
    name.title = "Open or close";
    const value = element("output", "pv-value");
    top.append(name, value);

    const slider = element("input", "pv-slider");
    slider.type = "range";
    slider.min = "0";
    slider.max = "1";
    slider.step = "0.001";
    slider.disabled = joint.fixed;
    slider.setAttribute("aria-label", joint.label);

    const foot = element("div", "pv-row-foot");
    foot.append(
      element("span", "", joint.text(joint.from)),
      element("span", `pv-badge pv-${joint.verdict}`, joint.verdict),
      element("span", "", joint.text(joint.to)),
    );
    row.append(top, slider, foot);

    slider.addEventListener("input", () => {
      joint.tween = null;
      joint.set(Number(slider.value));
      this.select(joint);
      this.refreshRow(joint);
      this.refreshButtons();
      this.invalidate();
    });
    slider.addEventListener("focus", () => this.select(joint));
    name.addEventListener("click", () => {
      this.select(joint);
      this.toggle(joint);
    });
    row.addEventListener("pointerenter", () => this.highlight(joint));
    row.addEventListener("pointerleave", () => this.highlight(this.selected));
    row.addEventListener("click", () => this.select(joint));
    joint.row = { row, slider, value };
    return row;
  }

  buildControls() {
    const canvas = this.renderer.domElement;
    const controls = new OrbitControls(this.camera, canvas);
    controls.enableDamping = true;
    controls.dampingFactor = 0.12;
    controls.maxPolarAngle = Math.PI * 0.53;
    controls.addEventListener("start", () => {
      this.userMoved = true;
      this.leaveShot();
    });
    controls.addEventListener("change", () => this.invalidate());
    this.controls = controls;
    // A finger that moves up or down scrolls the page, or a phone could not get past the canvas.
    canvas.style.touchAction = "pan-y";

    // The wheel scrolls the page until the scene has been taken hold of; with Ctrl it zooms at once.
    let held = false;
    this.stage.addEventListener("pointerdown", () => (held = true), true);
    this.stage.addEventListener("pointerleave", () => (held = false));
    this.stage.addEventListener(
      "wheel",
      (event) => {
        if (!held && !event.ctrlKey && !event.metaKey) event.stopPropagation();
        else this.userMoved = true;
      },
      { capture: true, passive: true },
    );

    let pressed = null;
    canvas.addEventListener("pointerdown", (event) => {
      pressed = event.isPrimary && event.button === 0 ? [event.clientX, event.clientY] : null;
    });
    canvas.addEventListener("pointercancel", () => (pressed = null));
    canvas.addEventListener("pointermove", (event) => {
      if (event.pointerType !== "mouse" || event.buttons) return;
      const joint = this.pick(event);
      canvas.style.cursor = joint ? "pointer" : "grab";
      this.highlight(joint ?? this.selected);
    });
    canvas.addEventListener("pointerleave", () => this.highlight(this.selected));
    canvas.addEventListener("pointerup", (event) => {
      // A press that has not moved is a click; anything else was a turn of the view.
      if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 5) return;
      pressed = null;
      const joint = this.pick(event);
      this.select(joint);
      if (joint) this.toggle(joint);
    });
  }

  pick(event) {
    const box = this.renderer.domElement.getBoundingClientRect();
    const at = new Vector2(
      ((event.clientX - box.left) / box.width) * 2 - 1,
      1 - ((event.clientY - box.top) / box.height) * 2,
    );
    const ray = new Raycaster();
    ray.setFromCamera(at, this.camera);
    // Boxes stand for what is shown before them, and are quicker to hit than a hundred thousand triangles.
    const hit = ray.intersectObjects(this.boxes.length > 0 ? this.boxes : this.meshes, false)[0];
    return hit?.object.userData.pawsJoint ?? null;
  }

  select(joint) {
    this.selected = joint;
    this.highlight(joint);
  }

  highlight(joint) {
    if (joint === this.hot) return;
    if (this.hot) {
      tint(this.hot, false);
      this.hot.arrow.visible = false;
      this.hot.row.row.classList.remove("pv-hot");
    }
    this.hot = joint;
    if (joint) {
      tint(joint, true);
      joint.arrow.visible = true;
      const { row } = joint.row;
      row.classList.add("pv-hot");
      // Only the list scrolls, never the page: the pointer is over the canvas at this moment.
      const { list } = this;
      if (row.offsetTop < list.scrollTop) list.scrollTop = row.offsetTop;
      const under = row.offsetTop + row.offsetHeight - list.clientHeight;
      if (under > list.scrollTop) list.scrollTop = under;
    }
    this.invalidate();
  }

  /** Starts a smooth move; without motion (by the reader's own setting) it jumps. */
  moveTo(joint, fraction, delay = 0) {
    if (joint.fixed) return;
    if (this.still) {
      joint.set(fraction);
      this.refreshRow(joint);
    } else {
      const travel = Math.abs(fraction - joint.fraction);
      joint.tween = { from: joint.fraction, to: fraction, start: performance.now() + delay, time: 350 + 550 * travel };
    }
    this.refreshButtons();
    this.invalidate();
  }

  goal(joint) {
    return joint.tween ? joint.tween.to : joint.fraction;
  }

  toggle(joint) {
    this.moveTo(joint, this.goal(joint) > (1 + joint.closed) / 2 ? joint.closed : 1);
  }

  moveAll(open) {
    this.joints.forEach((joint, i) => this.moveTo(joint, open ? 1 : joint.closed, Math.min(i * 60, 400)));
  }

  refreshRow(joint) {
    const { slider, value } = joint.row;
    slider.value = String(joint.fraction);
    slider.style.setProperty("--pv-filled", `${joint.fraction * 100}%`);
    slider.setAttribute("aria-valuetext", joint.text());
    value.textContent = joint.text();
  }

  refreshButtons() {
    const free = this.joints.filter((joint) => !joint.fixed);
    this.openAll.disabled = free.every((joint) => this.goal(joint) > 0.999);
    this.closeAll.disabled = free.every((joint) => Math.abs(this.goal(joint) - joint.closed) < 0.001);
  }

  frameCamera() {
    this.leaveShot();
    const { target, distance } = fitCamera(this.camera, this.points, this.direction, this.centre);
    this.controls.target.copy(target);
    this.controls.minDistance = this.radius * 0.25;
    this.controls.maxDistance = Math.max(distance * 4, this.radius * 8);
    this.controls.update();
    this.invalidate();
  }

  resize() {
    // Paper shows the picture that the screen had; the window's own shape is back right after.
    if (window.matchMedia?.("print").matches) return;
    const width = Math.max(this.stage.clientWidth, 1);
    const height = Math.max(this.stage.clientHeight, 1);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (!this.userMoved) this.frameCamera();
    if (this.shot) this.placeShot();
    // At once and not in the next frame: resizing clears the canvas, which would flicker.
    this.draw();
  }

  step(now) {
    let moving = false;
    for (const joint of this.joints) {
      const { tween } = joint;
      if (!tween) continue;
      const t = clamp((now - tween.start) / tween.time, 0, 1);
      joint.set(tween.from + (tween.to - tween.from) * ease(t));
      if (t >= 1) joint.tween = null;
      else moving = true;
      this.refreshRow(joint);
    }
    return moving;
  }

  draw() {
    this.renderer.render(this.scene, this.camera);
  }

  /** Frames are drawn when something changes and not otherwise, so that an open page costs nothing. */
  invalidate() {
    if (this.queued || !this.controls) return;
    this.queued = true;
    requestAnimationFrame((now) => {
      this.queued = false;
      const moving = this.step(now);
      // The controls know no camera that is held askew, as a head is.
      if (!this.shot) this.controls.update();
      this.draw();
      if (moving) this.invalidate();
    });
  }

  handle() {
    const find = (id) => this.joints.find((joint) => joint.id === id) ?? null;
    return {
      /** What each joint is at: radians or metres. */
      values: () => Object.fromEntries(this.joints.map((joint) => [joint.id, joint.value])),
      /** Puts a joint at a value (radians or metres) at once. */
      set: (id, value) => {
        const joint = find(id);
        if (!joint || joint.fixed) return;
        joint.tween = null;
        joint.set((value - joint.from) / (joint.to - joint.from));
        this.refreshRow(joint);
        this.refreshButtons();
        this.invalidate();
      },
      /** Highlights a joint and shows its axis; null clears it. */
      select: (id) => this.select(find(id)),
      /** Opens a joint smoothly. */
      open: (id) => {
        const joint = find(id);
        if (joint) this.moveTo(joint, 1);
      },
      /** Shows a layer ("look", "boxes", "collision", "assumed") or hides it. */
      show: (layer, on) => this.setLayer(layer, on),
      /** Which layers are shown. */
      shown: () => ({ ...this.show }),
      /** Looks from where a frame was taken: `src`, `pose`, `width`, `height`, `fx`, `fy`, `cx`, `cy`, `openings`. */
      lookFrom: (shot) => this.lookFrom(shot),
      /** Takes the frame away again. */
      leave: () => this.leaveShot(),
      openAll: () => this.moveAll(true),
      closeAll: () => this.moveAll(false),
      /** Where a joint's part is now: the middle of its bounds in the world. For tests. */
      centre: (id) => {
        this.scene.updateMatrixWorld(true);
        return boundsOf(find(id)?.meshes ?? []).getCenter(new Vector3()).toArray();
      },
    };
  }
}
