#!/usr/bin/env python3
"""How much faster than the clock MuJoCo steps a twin, with and without what is only seen.

    pip install mujoco==3.17.0
    examples/realtime.py TWIN_DIR...

TWIN_DIR: folders that `paws twin` wrote; one of `paws twin --no-textures` beside the other shows what the textured surfaces cost.
Each `scene.xml` is stepped as it is, and once more with every shape taken out that does not collide (the compiler's
`discardvisual`). Ten seconds of simulated time, nothing drawn, one thread, all parts closed, then all half open; the runs take
turns, time is that of the processor, and the fastest of each counts: whatever else the machine does only slows them down. `loads` is
the time to compile the model, pictures and all.
"""

import argparse
import pathlib
import sys
import time

import mujoco

# Steps in one call: the time of a call in Python is then none of the simulator's.
AT_ONCE = 100


class Scene:
    """A model and how fast it was stepped."""

    def __init__(self, folder, is_bare):
        self.name, self.is_bare = folder.name, is_bare
        began = time.process_time()
        spec = mujoco.MjSpec.from_file(str(folder / "scene.xml"))
        spec.compiler.discardvisual = is_bare
        self.model = spec.compile()
        self.loads = time.process_time() - began
        self.data = mujoco.MjData(self.model)
        self.fastest = {}

    def put(self, share):
        """Stands every joint at a share of its range, at rest."""
        mujoco.mj_resetData(self.model, self.data)
        for joint in range(self.model.njnt):
            self.data.qpos[self.model.jnt_qposadr[joint]] = share * self.model.jnt_range[joint][1]

    def run(self, share, seconds):
        """Steps so many simulated seconds; keeps the fastest factor."""
        self.put(share)
        steps = max(1, round(seconds / self.model.opt.timestep / AT_ONCE))
        mujoco.mj_step(self.model, self.data, nstep=AT_ONCE)
        began = time.process_time()
        for _ in range(steps):
            mujoco.mj_step(self.model, self.data, nstep=AT_ONCE)
        factor = steps * AT_ONCE * self.model.opt.timestep / (time.process_time() - began)
        self.fastest[share] = max(factor, self.fastest.get(share, 0.0))

    def row(self):
        m = self.model
        cells = [self.name, "no" if self.is_bare else "yes", m.ngeom, m.nmesh, m.nmeshface, m.nv, self.data.ncon]
        cells += [f"{self.loads:.2f} s", *(f"{factor:.0f}" for factor in self.fastest.values())]
        return "| " + " | ".join(map(str, cells)) + " |"


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("twins", nargs="+", type=pathlib.Path, metavar="TWIN_DIR")
    arguments.add_argument("--seconds", type=float, default=10.0, help="simulated time of a run (default: 10)")
    arguments.add_argument("--runs", type=int, default=3, help="runs of each, of which the fastest counts (default: 3)")
    args = arguments.parse_args()
    for twin in args.twins:
        if not (twin / "scene.xml").is_file():
            sys.exit(f"{twin}: has no scene.xml; give folders that `paws twin` wrote")
    scenes = [Scene(twin.resolve(), is_bare) for twin in args.twins for is_bare in (False, True)]
    for _ in range(args.runs):
        for scene in scenes:
            for share in (0.0, 0.5):
                scene.run(share, args.seconds)
    step = 1000.0 * scenes[0].model.opt.timestep
    print(f"MuJoCo {mujoco.__version__}, steps of {step:g} ms; simulated seconds a second of one core:\n")
    print("| twin | visual layer | geoms | meshes | triangles | joints | contacts | loads | closed | half open |")
    print("| --- |" + " --- |" * 9)
    for scene in scenes:
        print(scene.row())


if __name__ == "__main__":
    main()
