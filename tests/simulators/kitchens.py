"""Kitchens without a recording: rows of drawers, doors, flaps, lids and sliders, 1 to 40 joints each, from a seed.

    python3 tests/simulators/kitchens.py DIR [--paws FILE] [--joints N...]

Writes DIR/kitchen_NN/joints.json (docs/joints-format.md) for each number of joints; with --paws also the twin of it in
every format, which makes DIR/kitchen_NN a TWIN of matrix.py. Exit code 1 where `paws` did not build every joint. The
frame, its up and its unit differ from kitchen to kitchen, as those of other people's files do.
"""

import argparse
import itertools
import json
import math
import pathlib
import random
import subprocess
import sys

# Twenty kitchens.
COUNTS = (1, 2, 3, 4, 5, 6, 8, 9, 11, 13, 15, 17, 19, 22, 24, 27, 30, 33, 36, 40)

# Metres. A room's walls are far enough apart, and its rows end far enough from its corners, for every door to open.
ROOM, ROW, ROOMS_ACROSS = 7.0, 4.2, 4
LEAF, DEPTH = 0.018, 0.56
# From the edge of a front to its handle's middle; the handle stands in front of it.
RIM, GRIP = 0.06, 0.035
KINDS = ("drawers", "drawers", "door", "pair", "oven", "dishwasher", "fridge", "larder", "bench", "slider")
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001}


class Row:
    """A wall's worth of fronts: u along the wall to the right, d into the furniture, z up."""

    def __init__(self, corner, yaw):
        self.corner, self.right, self.inward = corner, (math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))

    def direction(self, u, d, z):
        return [u * self.right[0] + d * self.inward[0], u * self.right[1] + d * self.inward[1], z]

    def point(self, u, d, z):
        x, y, z = self.direction(u, d, z)
        return [self.corner[0] + x, self.corner[1] + y, z]

    def box(self, low, high):
        """Between two corners (u, d, z)."""
        turn = [self.direction(1, 0, 0), self.direction(0, 1, 0), [0.0, 0.0, 1.0]]
        return {
            "center": self.point(*((a + b) / 2 for a, b in zip(low, high))),
            "half": [(b - a) / 2 for a, b in zip(low, high)],
            "R": [list(row) for row in zip(*turn)],
        }

    def joint(self, kind, label, low, high, axis, at, upper, handle=None, deep=DEPTH):
        """A part between two corners that moves about or along `axis` at `at`, all (u, d, z)."""
        # Furniture lies behind the front, that of a lid below it.
        lid = high[1] - low[1] > 2 * LEAF and high[2] - low[2] <= 2 * LEAF
        behind = ((low[0], low[1], high[2] - deep), high) if lid else (low, (high[0], low[1] + deep, high[2]))
        found = {
            "label": label,
            "type": kind,
            "axis": self.direction(*axis),
            "origin": self.point(*at),
            "range": [0.0, upper],
            "part_box": self.box(low, high),
            "base_box": self.box(*behind),
        }
        return found | ({"handle": self.point(*handle)} if handle else {})

    def drawer(self, rng, u, w, z, h):
        long = rng.uniform(0.40, 0.52)
        corners = (u, 0, z), (u + w, long, z + h)
        return self.joint("prismatic", "drawer", *corners, (0, -1, 0), (u + w / 2, 0, z + h / 2), round(0.8 * long, 3))

    def door(self, rng, u, w, z, h, left, label="cupboard", most=1.92, d=0.0, deep=DEPTH):
        hinge, sense, free = (u, -1, u + w - RIM) if left else (u + w, 1, u + RIM)
        upper = round(rng.uniform(1.4, most), 3)
        corners = (u, d, z), (u + w, d + LEAF, z + h)
        handle = (free, d - GRIP, z + h * rng.uniform(0.3, 0.7)) if rng.random() < 0.7 else None
        return self.joint("revolute", label, *corners, (0, 0, sense), (hinge, d, z), upper, handle, deep)

    def flap(self, rng, u, w, z, h, below, label, d=0.0, deep=DEPTH):
        # One that hangs has its hinge behind it, as furniture has: about its front edge gravity would open it a crack.
        hinge, sense = ((u, d, z), 1) if below else ((u, d + 1.5 * LEAF, z + h), -1)
        upper = round(rng.uniform(1.3, 1.57), 3)
        corners = (u, d, z), (u + w, d + LEAF, z + h)
        return self.joint("revolute", label, *corners, (sense, 0, 0), hinge, upper, None, deep)

    def lid(self, rng, u, w, z):
        corners = (u, 0, z), (u + w, DEPTH, z + LEAF)
        upper = round(rng.uniform(0.8, 1.4), 3)
        return self.joint("revolute", "bench", *corners, (-1, 0, 0), (u, DEPTH, z + LEAF), upper, None, z - 0.05)

    def slider(self, rng, u, w, z, h, to_right):
        """A leaf before one half of an opening, that goes before the other."""
        half = w / 2
        start = u if to_right else u + half
        corners = (start, 0, z), (start + half, LEAF, z + h)
        handle = (start + (RIM if to_right else half - RIM), -GRIP, z + h / 2)
        axis = (1 if to_right else -1, 0, 0)
        return self.joint("prismatic", "sliding door", *corners, axis, (start, 0, z), round(0.85 * half, 3), handle)


def column(row, rng, u):
    """(width, joints) of what stands next in a row."""
    kind = rng.choice(KINDS)
    w = round(rng.uniform(0.40, 0.60), 3)
    foot, top = 0.10, 0.86
    joints = []
    if kind == "drawers":
        edges = [foot]
        while edges[-1] < top - 0.12 and len(edges) < 5:
            edges.append(min(top, edges[-1] + rng.uniform(0.14, 0.38)))
        # A last one that would be too low becomes part of the one below.
        edges[-1] = top if top - edges[-1] < 0.12 else edges[-1]
        joints = [row.drawer(rng, u, w, a, b - a) for a, b in itertools.pairwise(edges)]
    elif kind == "door":
        joints = [row.door(rng, u, w, foot, 0.58, rng.random() < 0.5), row.drawer(rng, u, w, 0.70, 0.16)]
    elif kind == "pair":
        w = round(1.5 * w, 3)
        joints = [row.door(rng, u, w / 2, foot, 0.76, True), row.door(rng, u + w / 2, w / 2, foot, 0.76, False)]
    elif kind == "oven":
        joints = [row.flap(rng, u, w, 0.30, 0.50, True, "oven")]
    elif kind == "dishwasher":
        joints = [row.flap(rng, u, w, foot, 0.72, True, "dishwasher")]
    elif kind == "fridge":
        left = rng.random() < 0.5
        joints = [row.door(rng, u, w, 0.10, 0.60, left, "freezer"), row.door(rng, u, w, 0.72, 1.25, left, "fridge")]
    elif kind == "larder":
        w = round(0.6 * w, 3)
        joints = [row.drawer(rng, u, w, foot, 1.6)]
    elif kind == "bench":
        joints = [row.lid(rng, u, w, round(rng.uniform(0.40, 0.50), 3))]
    else:
        w = round(1.8 * w, 3)
        joints = [row.slider(rng, u, w, foot, 0.70, rng.random() < 0.5)]
    if kind in ("drawers", "door", "pair", "oven", "dishwasher", "slider") and rng.random() < 0.5:
        # Shallower than what is below: a narrow gap on either side lets its handle pass a tall neighbour.
        above = rng.choice(("door", "flap"))
        u_in, w_in = u + 0.08, w - 0.16
        if above == "door" and w_in < 0.5:
            joints.append(row.door(rng, u_in, w_in, 1.40, 0.70, rng.random() < 0.5, "wall cupboard", 1.57, 0.20, 0.35))
        else:
            joints.append(row.flap(rng, u_in, w_in, 1.40, 0.40, False, "wall cupboard", 0.20, 0.35))
    return w, joints


def rows(rng):
    """Rows along the walls of rooms beside each other, all looking into their room."""
    number = 0
    while True:
        room, wall = divmod(number, 4)
        x, y = ROOM * 1.3 * (room % ROOMS_ACROSS), ROOM * 1.3 * (room // ROOMS_ACROSS)
        yaw = wall * math.pi / 2
        row = Row((0.0, 0.0), yaw)
        # At the wall that is behind the row as it looks inward, its middle at the wall's middle.
        away = row.direction(-ROW / 2, ROOM / 2 - DEPTH, 0)
        row.corner = (x + away[0], y + away[1])
        yield row
        number += 1


def world_joints(seed, count):
    """Joints in the kitchen's own frame: +Z up, metres."""
    rng = random.Random(f"kitchen {seed} {count}")
    found = []
    for row in rows(rng):
        u = 0.0
        while len(found) < count:
            w, joints = column(row, rng, u)
            if u + w > ROW:
                break
            found += joints
            u += w + rng.choice((0.0, 0.0, 0.04))
        if len(found) >= count:
            break
    return [{"id": f"joint_{i}"} | j for i, j in enumerate(found[:count])]


def moved(value, turn, shift, unit, point):
    """A point or a direction in the file's frame."""
    x = [sum(a * b for a, b in zip(r, value)) for r in turn]
    return [(a + s) / unit for a, s in zip(x, shift)] if point else x


def kitchen(seed, count):
    """The contents of a joints.json."""
    rng = random.Random(f"frame {seed}")
    units = rng.choice(tuple(UNITS))
    unit, yaw = UNITS[units], rng.uniform(-math.pi, math.pi)
    c, s = math.cos(yaw), math.sin(yaw)
    # File from kitchen: turned about up, and as it is, or with +Y or -Z up.
    level = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
    tilt = rng.choice(
        ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, 1], [0, -1, 0]], [[1, 0, 0], [0, -1, 0], [0, 0, -1]])
    )
    turn = [[sum(a * b for a, b in zip(row, col)) for col in zip(*level)] for row in tilt]
    shift = [rng.uniform(-3.0, 3.0) for _ in range(3)]
    point = lambda p: moved(p, turn, shift, unit, True)
    direction = lambda d: moved(d, turn, shift, unit, False)

    def box(b):
        columns = [direction(c) for c in zip(*b["R"])]
        half = [h / unit for h in b["half"]]
        return {"center": point(b["center"]), "half": half, "R": [list(r) for r in zip(*columns)]}

    joints = []
    for j in world_joints(seed, count):
        lengths = 1.0 if j["type"] == "revolute" else unit
        changed = {
            "axis": direction(j["axis"]),
            "origin": point(j["origin"]),
            "range": [q / lengths for q in j["range"]],
            "part_box": box(j["part_box"]),
            "base_box": box(j["base_box"]),
        }
        joints.append(j | changed | ({"handle": point(j["handle"])} if "handle" in j else {}))
    return {"scene": f"kitchen_{count:02d}", "up": direction([0.0, 0.0, 1.0]), "units": units, "joints": joints}


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("folder", type=pathlib.Path, metavar="DIR")
    arguments.add_argument("--paws", type=lambda p: pathlib.Path(p).resolve(), help="the binary, to make the twins")
    arguments.add_argument("--joints", type=int, nargs="+", default=COUNTS, metavar="N", help="a kitchen for each")
    arguments.add_argument("--seed", type=int, default=1)
    args = arguments.parse_args()
    failed = 0
    for count in args.joints:
        folder = args.folder / f"kitchen_{count:02d}"
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "joints.json"
        file.write_text(json.dumps(kitchen(args.seed + count, count), indent=1), encoding="utf-8")
        if args.paws:
            result = subprocess.run([args.paws, "export", file, "--out", folder], capture_output=True, text=True)
            if result.returncode:
                print(f"{folder}: exit code {result.returncode}: {result.stderr.strip()}")
                failed += 1
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
