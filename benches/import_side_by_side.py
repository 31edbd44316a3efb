#!/usr/bin/env python3
"""Our readers of large files beside what people would otherwise run, on the same files, one core, in one session.

    python3 benches/import_side_by_side.py [--python PYTHON] [--size SHARE] [--inputs DIR] [--markdown FILE] [--paws PROGRAM]

PYTHON is an interpreter with numpy, polars, pycolmap and open3d; a peer that is not installed is left out and named. The files: a
trajectory of 600,000 rows, the same walk as Project Aria's services write it, COLMAP's images.bin of 1 GB, a cloud of 10,000,000 points,
depth of 1408 x 1408; --size 0.1 makes them a tenth as large. Ours is `examples/read_source.rs`, which is built first: it gives poses
with times, a model without its observations, points and depth in metres; the peers give their own tables. With PROGRAM the whole of
`paws import`, which also joins, checks and writes, is timed as well; --whole-only leaves out the reader alone.

Times are medians of files that the system has read before, the sides in turns. Memory is the peak of a process that reads the file
once, all that it loads among it. The whole takes about five minutes and 1.6 GB of disk.
"""

import argparse
import json
import os
import pathlib
import statistics
import struct
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
REPEATS = 5
# The file or folder, our format, what the peer reads of it, the peer, and how it reads.
READERS = [
    ("poses.txt", "tum", "", "polars", "import polars\nread = lambda p: polars.read_csv(p, separator=' ', has_header=False)"),
    ("aria", "aria", "slam/closed_loop_trajectory.csv", "polars", "import polars\nread = lambda p: polars.read_csv(p)"),
    ("model", "colmap", "", "pycolmap", "import pycolmap\nread = lambda p: pycolmap.Reconstruction(p)"),
    ("cloud.ply", "cloud", "", "open3d", "import open3d\nread = lambda p: open3d.io.read_point_cloud(p)"),
    ("depth.npy", "npy", "", "numpy", "import numpy\nread = lambda p: numpy.load(p)"),
]
TIMED = """
import json, sys, time
{reader}
times = []
for _ in range(int(sys.argv[2])):
    start = time.perf_counter()
    read(sys.argv[1])
    times.append(time.perf_counter() - start)
print(json.dumps(times))
"""
ONE_CORE = dict(os.environ, POLARS_MAX_THREADS="1", OMP_NUM_THREADS="1", RAYON_NUM_THREADS="1")


# ---- the files ----


def trajectory(path, rows):
    with path.open("w") as out:
        for i in range(rows):
            t = 1e-3 * i
            out.write(f"{1e5 + t:.6f} {t % 7:.6f} {t % 5:.6f} 1.600000 0.000000 0.000000 0.600000 0.800000\n")


def aria(path, rows):
    """Ten minutes of a thousand poses a second, with the columns and digits of the services, and the camera."""
    (path / "slam").mkdir(parents=True)
    pose = ["tx_world_device,ty_world_device,tz_world_device,qx_world_device,qy_world_device,qz_world_device,qw_world_device"]
    moves = ["device_linear_velocity_x_device,device_linear_velocity_y_device,device_linear_velocity_z_device"]
    moves += ["angular_velocity_x_device,angular_velocity_y_device,angular_velocity_z_device"]
    down = ["gravity_x_world,gravity_y_world,gravity_z_world,quality_score,geo_available"]
    head = ",".join(["graph_uid,tracking_timestamp_us,utc_timestamp_ns", *pose, *moves, *down])
    with (path / "slam/closed_loop_trajectory.csv").open("w") as out:
        out.write(head + "\n")
        for i in range(rows):
            t = 1e-3 * i
            out.write(
                f"3f1b2a9c-6d1e-4c3a-9d4b-0a1b2c3d4e5f,{100_000_000 + 1000 * i},-1,{t % 7:.9f},{t % 5:.9f},1.600000000,0.000000000,"
                f"0.000000000,0.600000000,0.800000000,0.100000000,0.000000000,0.000000000,0.010000000,0.020000000,0.030000000,"
                "0.000000,0.000000,-9.810000,1.000000,0\n"
            )
    lens = {"Name": "FisheyeRadTanThinPrism", "Params": [600, 704, 704, *[0] * 12]}
    camera = {"Label": "camera-rgb", "Projection": lens,
              "T_Device_Camera": {"Translation": [0, 0, 0], "UnitQuaternion": [1, [0, 0, 0]]}}  # fmt: skip
    line = {"tracking_timestamp_us": 100_000_000, "ImageSizes": [[1408, 1408]], "CameraCalibrations": [camera]}
    (path / "slam/online_calibration.jsonl").write_text(json.dumps(line) + "\n")


def model(path, images, observations, points):
    path.mkdir()
    (path / "cameras.bin").write_bytes(struct.pack("<QIiQQ4d", 1, 1, 1, 640, 480, 500, 500, 320, 240))
    seen = b"".join(struct.pack("<ddq", k % 640, k % 480, -1) for k in range(observations))
    with (path / "images.bin").open("wb") as out:
        out.write(struct.pack("<Q", images))
        for i in range(1, images + 1):
            out.write(struct.pack("<I7dI", i, 1, 0, 0, 0, 1e-3 * i, 0, 1.6, 1))
            out.write(f"frame_{i:06}.jpg\0".encode() + struct.pack("<Q", observations) + seen)
    with (path / "points3D.bin").open("wb") as out:
        out.write(struct.pack("<Q", points))
        for i in range(1, points + 1):
            out.write(struct.pack("<Q3d3BdQ", i, 1e-4 * i, 1, 2, 9, 9, 9, 0.5, 0))


def cloud(path, points):
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {points}\n"
    head += "property float x\nproperty float y\nproperty float z\nend_header\n"
    block = b"".join(struct.pack("<3f", 1e-3 * i, 1, 5e-4 * i) for i in range(5000))
    with path.open("wb") as out:
        out.write(head.encode())
        for start in range(0, points, 5000):
            out.write(block[: 12 * min(points - start, 5000)])


def depth(path, side):
    text = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({side}, {side}), }}"
    text = text.ljust((10 + len(text) + 1 + 63) // 64 * 64 - 11) + "\n"
    row = b"".join(struct.pack("<f", 1 + 1e-3 * i) for i in range(side))
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode() + row * side)


def write(inputs, size):
    """All files that are not there yet."""
    of = lambda whole: max(int(whole * size), 1)
    makers = {
        "poses.txt": lambda p: trajectory(p, of(600_000)),
        "aria": lambda p: aria(p, of(600_000)),
        # 24 bytes an observation.
        "model": lambda p: model(p, of(20_000), 2_080, of(100_000)),
        "cloud.ply": lambda p: cloud(p, of(10_000_000)),
        "depth.npy": lambda p: depth(p, max(int(1408 * size**0.5), 1)),
    }
    for name, make in makers.items():
        if not (inputs / name).exists():
            print(f"writing {name} ...", file=sys.stderr)
            make(inputs / name)


# ---- the runs ----


def run(command):
    """(exit code, output, errors, seconds, peak MB) of a process."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        began = time.perf_counter()
        process = subprocess.Popen([str(c) for c in command], env=ONE_CORE, stdout=out, stderr=err)
        _, status, used = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - began
        code = process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0), err.seek(0)
        # Kilobytes on Linux, bytes on macOS.
        peak = used.ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
        return code, out.read().decode(errors="replace"), err.read().decode(errors="replace"), seconds, peak


def times(command, repeats):
    """Seconds of each read, the process's peak, and why there is none."""
    code, out, err, _, peak = run([*command, repeats])
    lines = [line for line in out.splitlines() if line.startswith("[")]
    if code != 0 or not lines:
        return [], None, (err.strip().splitlines() or ["it says nothing"])[-1]
    return json.loads(lines[-1]), peak, None


def read_times(command):
    """Median seconds of a warm read, and the peak of a process that reads once."""
    _, peak, why = times(command, 1)
    seconds = [] if why else times(command, REPEATS + 1)[0][1:]
    return (statistics.median(seconds) if seconds else None), peak, why


def whole_times(paws, kind, path, scratch):
    """The same of `paws import`, from the start of the process to the last file."""
    walk, out = scratch / "walk.txt", scratch / "out"
    walk.write_text("0 0 0 1.6 -0.5 0.5 -0.5 0.5\n1 1 0 1.6 -0.5 0.5 -0.5 0.5\n")
    options = ["--scale", "1", "--camera", "640,480,500,500,319.5,239.5", "--ffmpeg", "/nowhere/ffmpeg"]
    # A cloud needs somebody's poses.
    sources = [f"tum={walk}", f"cloud={path}"] if kind == "cloud" else [f"{kind}={path}"]
    seconds, peaks = [], []
    for _ in range(3):
        code, _, err, secs, peak = run([paws, "import", *sources, *options, "--out", out])
        if code not in (0, 1):
            return None, None, err.strip().splitlines()[-1]
        seconds.append(secs)
        peaks.append(peak)
    return statistics.median(seconds), max(peaks), None


def reader(args):
    """Our readers' program, built where nobody gave it."""
    if args.whole_only:
        return None
    command = ["cargo", "build", "--release", "--quiet", "--example", "read_source"]
    subprocess.run(command, cwd=ROOT, check=True)
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    return target / "release/examples/read_source"


def row(args, program, inputs, scratch, of):
    """A row of the table."""
    name, kind, part, library, code = of
    path = inputs / name
    files = [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]
    size = sum(p.stat().st_size for p in files) / 1e6
    nothing = (None, None, None)
    mine = read_times([program, kind, path]) if program else nothing
    theirs = read_times([args.python, "-c", TIMED.format(reader=code), path / part if part else path])
    whole = whole_times(args.paws, kind, path, scratch) if args.paws and kind != "npy" else nothing
    for who, (_, _, why) in (("read_source", mine), (library, theirs), ("paws import", whole)):
        if why:
            print(f"{name}: {who}: {why}", file=sys.stderr)
    shown = lambda value, by, digits: "-" if value is None else f"{by * value:.{digits}f}"
    against = lambda i: "-" if not theirs[i] or not mine[i] else f"{theirs[i] / mine[i]:.1f}"
    return [
        name, f"{size:.0f}", shown(mine[0], 1e3, 1), shown(mine[1], 1, 0), library, shown(theirs[0], 1e3, 1), shown(theirs[1], 1, 0),
        against(0), against(1), shown(whole[0], 1e3, 0), shown(whole[1], 1, 0),
    ]  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--size", type=float, default=1.0, metavar="SHARE")
    parser.add_argument("--inputs", type=pathlib.Path, metavar="DIR", help="keep the files here, and take those that are there")
    parser.add_argument("--markdown", type=pathlib.Path)
    parser.add_argument("--paws", type=lambda p: pathlib.Path(p).resolve(), metavar="PROGRAM")
    parser.add_argument("--whole-only", action="store_true")
    args = parser.parse_args()
    program = reader(args)
    head = ["file", "MB", "ours, ms", "ours, MB", "peer", "its ms", "its MB", "time, peer / ours", "memory, peer / ours"]
    head += ["`paws import`, ms", "MB"]
    table = [head, ["---"] * len(head)]
    with tempfile.TemporaryDirectory() as folder:
        scratch = pathlib.Path(folder)
        inputs = args.inputs or scratch / "inputs"
        inputs.mkdir(parents=True, exist_ok=True)
        write(inputs, args.size)
        for of in READERS:
            table.append(row(args, program, inputs, scratch, of))
            print(" ".join(table[-1]), file=sys.stderr)
    text = "\n".join("| " + " | ".join(r) + " |" for r in table) + "\n"
    print(text)
    if args.markdown:
        args.markdown.write_text(text)


if __name__ == "__main__":
    main()
