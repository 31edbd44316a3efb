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
from drivers.text import model

# (what, format, pattern, replacement, the point and the simulator that must notice)
MUTATIONS = (
    ("no limit", "URDF", r"<limit [^>]*/>", "", 1, "check_urdf"),
    ("upper limit in degrees", "URDF", r'upper="([\d.]+)"', r'upper="57\1"', 15, "MuJoCo"),
    ("no inertial", "URDF", r"<inertial>.*?</inertial>", "", 3, "MuJoCo"),
    ("inertia of the wrong part", "URDF", r'ixx="', 'ixx="9', 3, "Pinocchio"),
    (
        "axis the other way",
        "URDF",
        r'<axis xyz="(\S+) (\S+) (\S+)"',
        r'<axis xyz="-(\1) -(\2) -(\3)"',
        2,
        "Drake",
    ),
    ("no friction", "URDF", r'friction="[^"]*"', 'friction="0"', 15, "MuJoCo"),
    ("bases fused", "URDF", r"<mujoco>.*?</mujoco>", "", 4, "MuJoCo"),
    ("much more damping", "URDF", r'damping="([^"]*)"', r'damping="1\1"', 12, "Drake"),
    ("free base", "URDF", r'<link name="world">\s*</link>', '<link name="floor_1"/>', 4, "the text"),
    ("fronts 5 mm too deep", "URDF", "fronts", "deep", 11, "PyBullet"),
    ("degrees", "MJCF", r'angle="radian"', 'angle="degree"', 6, "the text"),
    ("degrees", "MJCF", r'angle="radian"', 'angle="degree"', 15, "MuJoCo"),
    ("no excludes", "MJCF", r"<exclude [^>]*/>", "", 6, "the text"),
    ("no mass", "MJCF", r"<inertial [^>]*/>", "", 3, "MuJoCo"),
    ("no friction", "MJCF", r'frictionloss="[^"]*"', "", 14, "MuJoCo"),
    ("no friction", "MJCF", r'frictionloss="[^"]*"', "", 16, "MuJoCo"),
    ("much more damping", "MJCF", r'damping="([^"]*)"', r'damping="1\1"', 16, "MuJoCo"),
    ("fronts 5 mm too deep", "MJCF", "fronts", "deep", 11, "MuJoCo"),
    ("handle elsewhere", "MJCF", r'(_handle" pos=")[^ ]*', r"\g<1>9", 9, "Drake"),
    ("no handle", "MJCF", r'<site name="([^"]*)_handle"', r'<site name="\1_grip"', 5, "the text"),
    ("radians", "USD", r"(physics:upperLimit = )[\d.]+", r"\g<1>1.92", 15, "usd-core"),
    ("frames apart", "USD", r"(physics:localPos1 = \()0", r"\g<1>0.1", 8, "usd-core"),
    ("axis token elsewhere", "USD", r'physics:axis = "X"', 'physics:axis = "Z"', 9, "usd-core"),
    ("no articulation", "USD", r"PhysicsArticulationRootAPI", "PhysicsFilteredPairsAPI", 8, "usd-core"),
    ("mass in grams", "USD", r"(physics:mass = [\d.]+)", r"\g<1>e3", 3, "usd-core"),
    ("a slide off its line", "glTF", rb'"linearAxes":\[1,2\]', b'"linearAxes":[2]', 7, "validator, physics.glb"),
    ("mass of another part", "glTF", rb'"mass":\d', b'"mass":9', 3, "validator, physics.glb"),
    ("not +Y up", "glTF", rb'"rotation":\[-0.70710\d*,0.0,0.0,', b'"rotation":[0.0,0.0,0.0,', 7, "three.js"),
)
# The same for twins with a look.
OF_LOOKS = (
    ("a mesh elsewhere", "URDF", r'filename="look/', 'filename="meshes/', 5, "the text"),
    ("a mesh that collides", "MJCF", r'class="visual" type="mesh"', 'class="collision" type="mesh"', 5, "the text"),
    ("a material without a picture", "MJCF", r' texture="[^"]*"', "", 6, "MuJoCo"),
    ("a picture elsewhere", "USD", r"@\./look/", "@./looks/", 8, "usd-core"),
    ("a box before a mesh", "USD", r'uniform token purpose = "guide"', "", 8, "usd-core"),
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
    mutations = MUTATIONS + (OF_LOOKS if definition.Twin(source).look else ())
    for what, format, pattern, replacement, point, simulator in mutations:
        with tempfile.TemporaryDirectory() as folder:
            copy = pathlib.Path(folder) / "twin"
            shutil.copytree(source, copy)
            twin = definition.Twin(copy)
            reader = next(r for r in readers if (r.simulator, r.format) == (simulator, format))
            # A format may have a file for viewers and one for engines.
            file = copy / reader.file if hasattr(reader, "file") else model(twin, format)
            before = file.read_bytes()
            file.write_bytes(broken(file, pattern, replacement, twin))
            assert file.read_bytes() != before, f"{what}: nothing to break in {file.name}"
            rows = matrix.answers(reader, twin, {1, point})[0]
            reasons = [r for _, status, found, _ in rows if status == "FAIL" for r in found]
            missed += not reasons
            said = reasons[0][:120] if reasons else "MISSED"
            print(f"{what} in {file.name}: point {point}, {simulator}: {said}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
