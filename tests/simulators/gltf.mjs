// What gltf-validator and three.js make of GLB files, as JSON: node gltf.mjs NODE_MODULES FILE...
// Run by drivers/gltf.py; the packages lie where install.py put them, so they are found by path.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";

const [modules, ...files] = process.argv.slice(2);
const validator = createRequire(join(modules, "x.js"))("gltf-validator");
const three = (path) => import(pathToFileURL(join(modules, "three", path)));
const THREE = await three("build/three.module.js");
const { GLTFLoader } = await three("examples/jsm/loaders/GLTFLoader.js");
// GLTFLoader asks a browser for its name.
globalThis.self ??= globalThis;

const answers = {};
for (const file of files) {
  const bytes = readFileSync(file);
  const { issues } = await validator.validateBytes(new Uint8Array(bytes));
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  const gltf = await new GLTFLoader().parseAsync(buffer, "");
  const nodes = [];
  gltf.scene.updateMatrixWorld(true);
  gltf.scene.traverse((n) => nodes.push({ name: n.name, extras: n.userData, mesh: n.isMesh === true }));
  const named = (name) => gltf.scene.getObjectByName(name);
  const place = (node) => new THREE.Vector3().setFromMatrixPosition(node.matrixWorld).toArray();
  const animations = {};
  for (const clip of gltf.animations) {
    // Closed, half open, open: animations open in the first half of their time and close in the second.
    animations[clip.name] = [0, 0.25, 0.5].map((share) => {
      const mixer = new THREE.AnimationMixer(gltf.scene);
      mixer.clipAction(clip).play();
      mixer.setTime(share * clip.duration);
      gltf.scene.updateMatrixWorld(true);
      const found = named(clip.name.replace(/_open_close$/, "_handle"));
      const at = found ? place(found) : null;
      mixer.stopAllAction();
      return at;
    });
  }
  const json = gltf.parser.json;
  answers[file] = {
    version: { validator: validator.version(), three: THREE.REVISION },
    errors: issues.numErrors,
    warnings: issues.numWarnings,
    messages: issues.messages.filter((m) => m.severity < 2).map((m) => `${m.code} ${m.pointer}: ${m.message}`),
    root: named(json.nodes[json.scenes[json.scene].nodes[0]].name)?.quaternion.toArray(),
    required: json.extensionsRequired ?? [],
    used: json.extensionsUsed ?? [],
    textured: (json.meshes ?? [])
      .filter((m) => m.primitives.every((p) => json.materials[p.material].pbrMetallicRoughness.baseColorTexture))
      .map((m) => m.name),
    names: json.nodes.map((n) => n.name),
    raw: { nodes: json.nodes, extensions: json.extensions ?? {} },
    nodes,
    animations,
  };
}
console.log(JSON.stringify(answers));
