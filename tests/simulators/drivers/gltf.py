"""glTF: the Khronos validator and three.js, both in Node.js, and what the file for engines says of bodies and joints.

No reader of KHR_physics_rigid_bodies installs from PyPI or npm: its bodies and joints are read here, as its text has them.
"""

import functools
import json
import pathlib
import shutil
import subprocess

import numpy as np
from definition import Body, Limits, Reader, all_but, off

from .text import FILES, SAFE, rewritten

# The file for engines, and the extensions in it.
PHYSICS = "physics.glb"
RIGID_BODIES, SHAPES = "KHR_physics_rigid_bodies", "KHR_implicit_shapes"

# glTF's +Y up from the world's +Z up.
WORLD_FROM_GLTF = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])


def missing(folder):
    """Why it cannot run."""
    Gltf.modules = folder / "node_modules" if folder else None
    if not shutil.which("node"):
        return "no node"
    if not (Gltf.modules and (Gltf.modules / "three").is_dir() and (Gltf.modules / "gltf-validator").is_dir()):
        return "no npm packages gltf-validator and three"
    return None


@functools.lru_cache
def answers(path, modules):
    script = pathlib.Path(__file__).parent.parent / "gltf.mjs"
    result = subprocess.run(["node", script, modules, path], capture_output=True, text=True)
    if result.returncode:
        raise RuntimeError(result.stderr.strip().splitlines()[-1] if result.stderr else "node failed")
    return json.loads(result.stdout)[str(path)]


class Gltf(Reader):
    format, modules, file = "glTF", None, FILES["glTF"]

    def __init__(self, twin):
        self.twin = twin
        self.said = answers(twin.folder / self.file, self.modules)

    @property
    def version(self):
        return self.said["version"]["three" if isinstance(self, Three) else "validator"]


class Validator(Gltf):
    simulator = "validator"
    cannot = all_but({1, 7}, "a validator")

    def own(self):
        yield from faults(self.said)


def faults(said):
    """What the validator minds, and what would keep other readers from the file."""
    if said["errors"] or said["warnings"]:
        yield f"{said['errors']} errors, {said['warnings']} warnings: {said['messages'][:3]}"
    if said["required"]:
        yield f"extensionsRequired {said['required']}: other readers refuse the file"


class Three(Gltf):
    simulator = "three.js"
    cannot = all_but({1, 2, 5, 7, 9, 15, 17}, "plays animations, has no physics")

    def extras(self):
        return {n["name"]: n["extras"]["joint"] for n in self.said["nodes"] if "joint" in n["extras"]}

    def limits(self):
        return {
            n: Limits(
                j["lower"],
                j["upper"],
                np.array(j["axis"]),
                j["damping"],
                j["friction"],
                j.get("effort"),
                j.get("velocity"),
            )
            for n, j in self.extras().items()
        }

    def handles(self, share):
        index = (0.0, 0.5, 1.0).index(share) if share in (0.0, 0.5, 1.0) else None
        if index is None:
            raise NotImplementedError
        found = {p.name: self.said["animations"].get(f"{p.name}_open_close") for p in self.twin.parts}
        return {n: WORLD_FROM_GLTF @ np.array(a[index]) for n, a in found.items() if a and a[index]}

    def names(self):
        all_names = self.said["names"]
        if len(set(all_names)) != len(all_names):
            yield "node names repeat"
        yield from (f'name "{n}"' for n in all_names if not n or not SAFE.fullmatch(n))
        for p in self.twin.parts:
            if f"{p.name}_handle" not in all_names:
                yield f"no node {p.name}_handle"
        meshes = sum(n["mesh"] for n in self.said["nodes"])
        if meshes != self.twin.boxes - self.twin.hidden + len(self.twin.look):
            yield f"{meshes} meshes, the twin has {self.twin.boxes} boxes, of which {self.twin.hidden} are hidden"
        if sorted(self.said["textured"]) != self.twin.look:
            yield f"{len(self.said['textured'])} textured meshes, the look has {len(self.twin.look)}"

    def repeated(self, twin):
        return rewritten(twin, self.format)

    def own(self):
        half = np.sqrt(0.5)
        if self.said["root"] is None or np.abs(np.array(self.said["root"]) - [-half, 0, 0, half]).max() > 1e-6:
            yield f"the root node does not turn +Z up into +Y up: {self.said['root']}"
        if any("physics" in e for e in self.said["used"]) and self.said["animations"]:
            yield "physics and animations in one file: the animations win"
        for p in self.twin.parts:
            if f"{p.name}_open_close" not in self.said["animations"]:
                yield f"{p.name}: no animation"


def rotation(x, y, z, w):
    """Matrix of a quaternion in glTF's order."""
    v = np.array([x, y, z])
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * (np.outer(v, v) - v @ v * np.eye(3))


class Physics(Gltf):
    """The file for engines, through the validator, three.js (which shows it) and the text of its extensions."""

    simulator, file, springs = "validator, physics.glb", PHYSICS, True
    # Turned frames and limits are single precision.
    exact = 1e-5
    cannot = all_but({1, 2, 3, 5, 7, 9, 15, 17}, "nothing that installs reads KHR_physics_rigid_bodies")

    def __init__(self, twin):
        super().__init__(twin)
        raw = self.said["raw"]
        self.nodes = raw["nodes"]
        self.index = {n["name"]: i for i, n in enumerate(self.nodes)}
        self.parent = {c: i for i, n in enumerate(self.nodes) for c in n.get("children", [])}
        self.joints = raw["extensions"].get(RIGID_BODIES, {}).get("physicsJoints", [])
        self.shapes = raw["extensions"].get(SHAPES, {}).get("shapes", [])

    def has(self, i, what):
        return self.nodes[i].get("extensions", {}).get(RIGID_BODIES, {}).get(what)

    def local(self, i):
        node = self.nodes[i]
        return rotation(*node.get("rotation", (0, 0, 0, 1))), np.array(node.get("translation", (0, 0, 0)), float)

    def pose(self, i):
        """(rotation, position) in the world; the root node only turns the world's +Z up into glTF's +Y up."""
        turn, place = self.local(i)
        while self.parent.get(i, 0) != 0:
            i = self.parent[i]
            r, p = self.local(i)
            turn, place = r @ turn, p + r @ place
        return turn, place

    def body_of(self, i):
        """The node above, or the node itself, that moves; None for the world."""
        while i is not None and not self.has(i, "motion"):
            i = self.parent.get(i)
        return i

    def joint(self, part):
        """(node, connected node, description) of a part's joint."""
        i = self.index[part.name]
        has = self.has(i, "joint")
        return i, has["connectedNode"], self.joints[has["joint"]]

    def limits(self):
        read = {}
        for p in self.twin.parts:
            i, _, joint = self.joint(p)
            free = next(x for x in joint["limits"] if x["min"] != x["max"])
            drive = joint["drives"][0]
            turns = "angularAxes" in free
            if turns != p.turns or drive["type"] != ("angular" if turns else "linear") or drive.get("stiffness"):
                raise ValueError(f"{p.name}: {joint}")
            column = self.pose(i)[0][:, (free["angularAxes"] if turns else free["linearAxes"])[0]]
            read[p.name] = Limits(free["min"], free["max"], column, drive["damping"])
        return read

    def bodies(self):
        # What does not move has no mass.
        read = {p.base: self.twin.bodies[p.base] for p in self.twin.parts}
        for p in self.twin.parts:
            i = self.index[p.link]
            motion, (turn, place) = self.has(i, "motion"), self.pose(i)
            own = turn @ rotation(*motion["inertiaOrientation"])
            inertia = own @ np.diag(motion["inertiaDiagonal"]) @ own.T
            read[p.link] = Body(motion["mass"], place + turn @ np.array(motion["centerOfMass"]), inertia)
        return read

    def handles(self, share):
        read, limits = {}, self.limits()
        for p in self.twin.parts:
            i, connected, _ = self.joint(p)
            (turn, place), (r, t) = self.pose(i), self.pose(connected)
            q = share * limits[p.name].upper
            x = np.array([1.0, 0, 0])
            if p.turns:
                opened = turn @ rotation(*(x * np.sin(q / 2)), np.cos(q / 2)), place
            else:
                opened = turn, place + turn @ x * q
            # What is fixed to the connected frame, as the closed file has it, goes with it.
            hand = r.T @ (self.pose(self.index[f"{p.name}_handle"])[1] - t)
            read[p.name] = opened[1] + opened[0] @ hand
        return read

    def names(self):
        named = self.said["names"]
        if len(set(named)) != len(named):
            yield "node names repeat"
        yield from (f'name "{n}"' for n in named if not SAFE.fullmatch(n))
        colliders = [i for i in range(len(self.nodes)) if self.has(i, "collider")]
        if len(colliders) != self.twin.boxes or any(s["type"] != "box" for s in self.shapes):
            yield f"{len(colliders)} colliders, the twin has {self.twin.boxes} boxes"

    def repeated(self, twin):
        return rewritten(twin, "gltf-physics")

    def own(self):
        yield from faults(self.said)
        if set(self.said["used"]) != {RIGID_BODIES, SHAPES}:
            yield f"extensionsUsed {self.said['used']}"
        if self.said["animations"]:
            yield "an animation: it moves the parts, not the physics"
        sizes = {n["name"]: n["scale"] for n in self.nodes if "scale" in n}
        for i, node in enumerate(self.nodes):
            if collider := self.has(i, "collider"):
                size = self.shapes[collider["geometry"]["shape"]]["box"]["size"]
                if "scale" in node or off(size, sizes.get(f"{node['name']}_visual", (0, 0, 0))) > 1e-9:
                    yield f"{node['name']}: its collider is not the box that is shown"
        for p in self.twin.parts:
            i, connected, joint = self.joint(p)
            moving = self.index[p.link]
            if self.body_of(i) is not None or self.body_of(connected) != moving:
                yield f"{p.name}: does not join its part to the world"
            (turn_a, at_a), (turn_b, at_b) = self.pose(i), self.pose(connected)
            if off(turn_a, turn_b) > 1e-5 or off(at_a, at_b) > 1e-5:
                yield f"{p.name}: the joint's frames are {off(at_a, at_b):.2g} m and {off(turn_a, turn_b):.2g} apart"
            held = sorted(a for x in joint["limits"] if x["min"] == x["max"] == 0 for a in x.get("linearAxes", []))
            kept = sorted(a for x in joint["limits"] if x["min"] == x["max"] == 0 for a in x.get("angularAxes", []))
            if (held, kept) != (([0, 1, 2], [1, 2]) if p.turns else ([1, 2], [0, 1, 2])):
                yield f"{p.name}: holds {held} and {kept}"
            if (self.has(moving, "motion").get("gravityFactor", 1) == 0) != p.balanced:
                yield f"{p.link}: gravity pulls where a spring carries, or does not where none does"


READERS = [Validator, Three, Physics]
