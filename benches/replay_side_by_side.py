"""The replay of a recorded hand in rapier beside MuJoCo and PyBullet: the same part, path, law and time step, in one session.

    target/tmp/simulators/python/bin/python benches/replay_side_by_side.py TWIN...

TWIN is a folder that `paws twin` wrote; the interpreter is the one that `tests/simulators` installs. The hand's law runs in
Python for the other two, once a step, as it would for who uses them; their stepping alone is told as well. Prints the median
over all clips of the time of one replay, world and all, and the ratio to rapier's.
"""

import json
import pathlib
import statistics
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tests" / "simulators"))

import replay  # noqa: E402
from definition import Twin  # noqa: E402
from drivers import bullet, mujoco  # noqa: E402


class Timed:
    """An engine that counts the time of its steps."""

    def __init__(self, engine):
        self.engine, self.secs = engine, 0.0

    def __getattr__(self, name):
        return getattr(self.engine, name)

    def step(self, pull=None):
        start = time.perf_counter()
        self.engine.step(pull)
        self.secs += time.perf_counter() - start


def once(make, clip, law):
    """Seconds of one replay, of its steps alone, and the tracking error (m)."""
    start = time.perf_counter()
    engine = Timed(make())
    error = replay.track(engine, clip, law)
    return time.perf_counter() - start, engine.secs, error


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    subprocess.run(["cargo", "build", "--release", "--quiet", "--example", "replay"], cwd=ROOT, check=True)
    rows = {"rapier": [], "MuJoCo": [], "PyBullet": []}
    steps = {"MuJoCo": [], "PyBullet": []}
    for folder in map(pathlib.Path, sys.argv[1:]):
        out = subprocess.run([ROOT / "target/release/examples/replay", folder], capture_output=True, text=True, check=True)
        ours = {(r["part"], r["clip"]): r for r in map(json.loads, out.stdout.splitlines())}
        twin = Twin(folder)
        law = replay.law(twin)
        whole = mujoco.Mjcf(twin)
        for clip in replay.clips(twin):
            rows["rapier"].append(ours[clip.part.name, clip.name]["secs"])
            for name, make in (
                ("MuJoCo", lambda: whole.alone(clip, law.step_secs)),
                ("PyBullet", lambda: bullet.Urdf(twin, law.step_secs)),
            ):
                secs, stepping, _ = once(make, clip, law)
                rows[name].append(secs)
                steps[name].append(stepping)
    base = statistics.median(rows["rapier"])
    print(f"{len(rows['rapier'])} clips of {len(sys.argv) - 1} twins; median of one replay")
    for name, secs in rows.items():
        alone = f", its steps alone {1000 * statistics.median(steps[name]):.1f} ms" if name in steps else ""
        median = statistics.median(secs)
        print(f"{name:9} {1000 * median:8.2f} ms   {median / base:6.1f} times rapier{alone}")


main()
