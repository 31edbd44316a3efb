"""Checks the checks: breaks a twin in the ways that simulators accept without a word, and asks for the failure.

    DIR/python/bin/python tests/simulators/mutations.py TWIN_DIR

Each of these was seen in published exports; nearly all load everywhere. Exit code 1 if a point does not notice.
"""

import pathlib
import re
import shutil
import sys
import tempfile

import definition
import matrix
from drivers.text import FILES

# (what, file, pattern, replacement, the point and the simulator that must notice)
MUTATIONS = (
    ("no limit", "scene.urdf", r"<limit [^>]*/>", "", 1, "check_urdf"),
    ("upper limit in degrees", "scene.urdf", r'upper="([\d.]+)"', r'upper="57\1"', 15, "MuJoCo"),
    ("no inertial", "scene.urdf", r"<inertial>.*?</inertial>", "", 3, "MuJoCo"),
    ("inertia of the wrong part", "scene.urdf", r'ixx="', 'ixx="9', 3, "Pinocchio"),
    (
        "axis the other way",
        "scene.urdf",
        r'<axis xyz="(\S+) (\S+) (\S+)"',
        r'<axis xyz="-(\1) -(\2) -(\3)"',
        2,
        "Drake",
    ),
    ("no friction", "scene.urdf", r'friction="[^"]*"', 'friction="0"', 15, "MuJoCo"),
    ("bases fused", "scene.urdf", r"<mujoco>.*?</mujoco>", "", 4, "MuJoCo"),
    ("much more damping", "scene.urdf", r'damping="([^"]*)"', r'damping="1\1"', 12, "Drake"),
    ("free base", "scene.urdf", r'<link name="world">\s*</link>', '<link name="floor_1"/>', 4, "the text"),
    ("fronts 5 mm too deep", "scene.urdf", "fronts", "deep", 11, "PyBullet"),
    ("degrees", "scene.xml", r'angle="radian"', 'angle="degree"', 6, "the text"),
    ("degrees", "scene.xml", r'angle="radian"', 'angle="degree"', 15, "MuJoCo"),
    ("no excludes", "scene.xml", r"<exclude [^>]*/>", "", 6, "the text"),
    ("no mass", "scene.xml", r"<inertial [^>]*/>", "", 3, "MuJoCo"),
    ("no friction", "scene.xml", r'frictionloss="[^"]*"', "", 14, "MuJoCo"),
    ("fronts 5 mm too deep", "scene.xml", "fronts", "deep", 11, "MuJoCo"),
    ("no handle", "scene.xml", r'<site name="([^"]*)_handle"', r'<site name="\1_grip"', 5, "the text"),
    ("not +Y up", "scene.glb", rb'"rotation":\[-0.70710\d*,0.0,0.0,', b'"rotation":[0.0,0.0,0.0,', 7, "three.js"),
)


def axis_negated(match):
    return '<axis xyz="' + " ".join(f"{-float(v):.17g}" for v in match.groups()) + '"'


def deeper(text, twin):
    """Moves every front 5 mm into its furniture, where the gap is 3 mm."""
    for part in twin.parts:
        local = -0.005 * part.outward
        front = next(s["name"] for s in part.solids if s["role"] == "front")
        shift = lambda m, d=local: m[1] + " ".join(f"{float(x) + y:.17g}" for x, y in zip(m[2].split(), d)) + '"'
        text = re.sub(rf'(<collision name="{front}">\s*<origin xyz=")([^"]*)"', shift, text)
        text = re.sub(rf'(<geom name="{front}" class="collision" pos=")([^"]*)"', shift, text)
    return text


def broken(file, pattern, replacement, twin):
    """Contents with the fault in them; bytes of a binary file keep their number."""
    if pattern == "fronts":
        return deeper(file.read_text(), twin).encode()
    if isinstance(pattern, bytes):
        fix = lambda m: replacement + b" " * (len(m[0]) - len(replacement))
        return re.sub(pattern, fix, file.read_bytes())
    if pattern.startswith("<axis"):
        replacement = axis_negated
    return re.sub(pattern, replacement, file.read_text(), flags=re.S).encode()


def main():
    source = pathlib.Path(sys.argv[1])
    tools = pathlib.Path(sys.prefix).parent
    readers = matrix.readers(tools, None)[0]
    missed = 0
    for what, name, pattern, replacement, point, simulator in MUTATIONS:
        with tempfile.TemporaryDirectory() as folder:
            copy = pathlib.Path(folder) / "twin"
            shutil.copytree(source, copy)
            twin = definition.Twin(copy)
            before = (copy / name).read_bytes()
            (copy / name).write_bytes(broken(copy / name, pattern, replacement, twin))
            assert (copy / name).read_bytes() != before, f"{what}: nothing to break in {name}"
            reader = next(r for r in readers if r.simulator == simulator and FILES[r.format] == name)
            rows = matrix.answers(reader, twin, {1, point})[0]
            reasons = [r for p, s, found, _ in rows if s == "FAIL" for r in found]
            missed += not reasons
            said = reasons[0][:120] if reasons else "MISSED"
            print(f"{what} in {name}: point {point}, {simulator}: {said}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
