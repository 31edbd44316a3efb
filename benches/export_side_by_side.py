"""A kitchen of many joints: written in every format beside scene_synthesizer, loaded and stepped in simulators.

    python3 benches/export_side_by_side.py [--python PYTHON] [--paws FILE] [--joints 500] [--markdown FILE]

PYTHON is an interpreter that has scene_synthesizer, usd-core, mujoco and pybullet; what it lacks is left out and said.
The library's scene is as many joints of its own base cabinets, two doors and two drawers each. Medians of the
repetitions; the sides take turns. Ours are whole processes, from the start of `paws` to the last file; the library's
import is not counted.
"""

import argparse
import json
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
FORMATS = ("urdf", "mjcf", "gltf", "gltf-physics", "usd")
STEPS = 100


# ---- what runs in the other interpreter: each prints its seconds as JSON ----


def synthesize(joints, folder):
    """Builds and writes a scene with scene_synthesizer."""
    import numpy as np
    import scene_synthesizer
    from scene_synthesizer import procedural_assets

    seconds, began = {}, time.perf_counter()
    scene = scene_synthesizer.Scene()
    for i in range(joints // 4):
        pose = np.eye(4)
        pose[:2, 3] = 0.8 * (i % 25), 3.0 * (i // 25)
        asset = procedural_assets.BaseCabinetAsset(num_drawers_horizontal=2, num_drawers_vertical=1)
        scene.add_object(asset, f"cabinet_{i}", transform=pose)
    seconds["build"] = time.perf_counter() - began
    for kind in ("urdf", "usda", "glb"):
        began = time.perf_counter()
        scene.export(os.path.join(folder, f"scene.{kind}"))
        seconds[kind] = time.perf_counter() - began
    return seconds | {"joints": len(scene.get_joint_names())}


def mujoco(path):
    import mujoco

    began = time.perf_counter()
    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    loaded = time.perf_counter()
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
    return {"load": loaded - began, "step": (time.perf_counter() - loaded) / STEPS, "joints": model.njnt}


def bullet(path):
    import pybullet

    pybullet.connect(pybullet.DIRECT)
    began = time.perf_counter()
    robot = pybullet.loadURDF(path, useFixedBase=True)
    loaded = time.perf_counter()
    pybullet.setGravity(0, 0, -9.81)
    for _ in range(STEPS):
        pybullet.stepSimulation()
    end = time.perf_counter()
    kinds = [pybullet.getJointInfo(robot, i)[2] for i in range(pybullet.getNumJoints(robot))]
    moving = [kind for kind in kinds if kind != pybullet.JOINT_FIXED]
    return {"load": loaded - began, "step": (end - loaded) / STEPS, "joints": len(moving)}


JOBS = {"synthesize": lambda joints, folder: synthesize(int(joints), folder), "mujoco": mujoco, "bullet": bullet}


# ---- the comparison ----


def job(python, *words):
    """Seconds of a job in the other interpreter, or why there are none."""
    command = [python, __file__, "--job", *map(str, words)]
    result = subprocess.run(command, capture_output=True, text=True)
    # Simulators print, too.
    answers = [line for line in result.stdout.splitlines() if line.startswith("{")]
    if result.returncode or not answers:
        said = [line for line in result.stderr.splitlines() if line.strip() and "build time" not in line]
        return said[-1] if said else f"exit code {result.returncode}"
    return json.loads(answers[-1])


def ours(*command):
    """(wall, processor) seconds of a process."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    wall, after = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def median(values):
    values = [v for v in values if not isinstance(v, str)]
    return statistics.median(values) if values else None


def measure(args, folder):
    """(what, ours, theirs) in seconds, and what could not run."""
    twin, peer = folder / "twin", folder / "peer"
    peer.mkdir()
    maker = [sys.executable, ROOT / "tests/simulators/kitchens.py", folder / "kitchens", "--joints", str(args.joints)]
    subprocess.run(maker, check=True)
    joints = next((folder / "kitchens").glob("*/joints.json"))
    ours(args.paws, "export", joints, "--out", twin)
    own, lib, runs, missing = {}, {}, {}, {}

    def note(table, key, value):
        table.setdefault(key, []).append(value)

    for i in range(args.repetitions):
        note(own, "joints", ours(args.paws, "export", joints, "--out", folder / "again"))
        note(own, "all", ours(args.paws, "export", twin, "--out", folder / "again"))
        for kind in FORMATS:
            note(own, kind, ours(args.paws, "export", twin, "--format", kind, "--out", folder / "again"))
        made = job(args.python, "synthesize", args.joints, peer)
        if isinstance(made, str):
            missing["scene_synthesizer"] = made
        else:
            for key, value in made.items():
                note(lib, key, value)
        files = [(name, "URDF", twin / "scene.urdf", peer / "scene.urdf") for name in ("mujoco", "bullet")]
        files += [("mujoco", "MJCF", twin / "scene.xml", None)]
        for simulator, kind, *paths in files:
            for side, path in zip(("ours", "theirs"), paths):
                if path is None or not path.exists():
                    continue
                ran = job(args.python, simulator, path)
                if isinstance(ran, str):
                    missing[f"{simulator}, {kind}, {side}"] = ran
                    continue
                for key, value in ran.items():
                    note(runs, (simulator, kind, side, key), value)
        print(f"repetition {i + 1} of {args.repetitions}", file=sys.stderr)

    wall = lambda key: median([w for w, _ in own[key]])
    core = lambda key: median([c for _, c in own[key]])
    theirs = lambda *keys: None if not lib else sum(median(lib[k]) for k in keys)
    rows = [
        ("joints.json to a twin and five formats", wall("joints"), theirs("build", "urdf", "usda", "glb")),
        ("twin.json to five formats", wall("all"), theirs("urdf", "usda", "glb")),
        ("the same, processor time", core("all"), None),
    ]
    peers = {"urdf": "urdf", "gltf": "glb", "usd": "usda"}
    rows += [(f"twin.json to {k}", wall(k), theirs(peers[k]) if k in peers else None) for k in FORMATS]
    for simulator, kind, key in (
        ("mujoco", "URDF", "load"), ("mujoco", "MJCF", "load"), ("bullet", "URDF", "load"),
        ("mujoco", "URDF", "step"), ("mujoco", "MJCF", "step"), ("bullet", "URDF", "step"),
    ):  # fmt: skip
        pair = [median(runs.get((simulator, kind, side, key), [])) for side in ("ours", "theirs")]
        name = {"mujoco": "MuJoCo", "bullet": "PyBullet"}[simulator]
        what = {"load": "loads the", "step": "a step of the"}[key]
        rows.append((f"{name}: {what} {kind}", *pair))
    counts = {side: median(runs.get(("mujoco", "URDF", side, "joints"), [])) for side in ("ours", "theirs")}
    return rows, missing, counts


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--paws", type=pathlib.Path, default=target / "release/paws")
    parser.add_argument("--joints", type=int, default=500)
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--markdown", type=pathlib.Path)
    parser.add_argument("--job", nargs="+", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.job:
        # On a line of its own, whatever was printed before it.
        print("\n" + json.dumps(JOBS[args.job[0]](*args.job[1:])), flush=True)
        return
    with tempfile.TemporaryDirectory() as folder:
        rows, missing, counts = measure(args, pathlib.Path(folder))
    milliseconds = lambda s: "-" if s is None else f"{1e3 * s:.1f}" if s < 0.01 else f"{1e3 * s:.0f}"
    ratio = lambda a, b: "-" if not a or not b else f"{b / a:.1f}"
    table = [("", "ours, ms", "scene_synthesizer, ms", "theirs / ours"), ("---",) * 4]
    table += [(what, milliseconds(a), milliseconds(b), ratio(a, b)) for what, a, b in rows]
    text = "\n".join("| " + " | ".join(r) + " |" for r in table) + "\n"
    known = ", ".join(f"{side} {count:.0f}" for side, count in counts.items() if count)
    text += f"\nMedians of {args.repetitions}. Joints that MuJoCo counts: {known or 'it did not run'}.\n"
    text += "".join(f"Cannot run: {what}: {why}\n" for what, why in missing.items())
    print(text)
    if args.markdown:
        args.markdown.write_text(text)


if __name__ == "__main__":
    main()
