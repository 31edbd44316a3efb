"""glTF: the Khronos validator and three.js, both in Node.js."""

import functools
import json
import pathlib
import shutil
import subprocess

import numpy as np
from definition import Limits, Reader, all_but

from .text import FILES, SAFE, rewritten

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
    format, modules = "glTF", None

    def __init__(self, twin):
        self.twin = twin
        self.said = answers(twin.folder / FILES["glTF"], self.modules)

    @property
    def version(self):
        return self.said["version"]["validator" if isinstance(self, Validator) else "three"]


class Validator(Gltf):
    simulator = "validator"
    cannot = all_but({1, 7}, "a validator")

    def own(self):
        if self.said["errors"] or self.said["warnings"]:
            yield f"{self.said['errors']} errors, {self.said['warnings']} warnings: {self.said['messages'][:3]}"


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
        wanted = sum(len(s) for s in self.twin.solids.values())
        if meshes != wanted:
            yield f"{meshes} boxes, the twin has {wanted}"

    def repeated(self, twin):
        return rewritten(twin, self.format)

    def own(self):
        half = np.sqrt(0.5)
        if self.said["root"] is None or np.abs(np.array(self.said["root"]) - [-half, 0, 0, half]).max() > 1e-6:
            yield f"the root node does not turn +Z up into +Y up: {self.said['root']}"
        if self.said["required"]:
            yield f"extensionsRequired {self.said['required']}: other readers refuse the file"
        if any("physics" in e for e in self.said["used"]) and self.said["animations"]:
            yield "physics and animations in one file: the animations win"
        for p in self.twin.parts:
            if f"{p.name}_open_close" not in self.said["animations"]:
                yield f"{p.name}: no animation"


READERS = [Validator, Three]
