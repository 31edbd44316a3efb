"""Our readers of large files beside what people would otherwise run, on the same files, one core, in one session.

    python3 benches/import_side_by_side.py [--python PYTHON] [--markdown FILE] [--peers-only]

PYTHON is an interpreter with numpy, polars, pycolmap and open3d; a peer that is not installed is left out and named. Times are
of files that the system has read before, medians of the repetitions of either side. Ours gives poses with times, a model
without its observations, points and depth in metres; the peers give their own tables.
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

REPEATS = 7
# Our bench, the file, the peer, and how it reads.
READERS = [
    ("import_tum", "poses.txt", "polars", "import polars\nread = lambda p: polars.read_csv(p, separator=' ', has_header=False)"),
    ("import_colmap", "model", "pycolmap", "import pycolmap\nread = lambda p: pycolmap.Reconstruction(p)"),
    ("import_ply", "cloud.ply", "open3d", "import open3d\nread = lambda p: open3d.io.read_point_cloud(p)"),
    ("import_npy", "depth.npy", "numpy", "import numpy\nread = lambda p: numpy.load(p)"),
]
TIMED = """
import json, sys, time
{reader}
read(sys.argv[1])
times = []
for _ in range({repeats}):
    start = time.perf_counter()
    read(sys.argv[1])
    times.append(time.perf_counter() - start)
print(json.dumps(times))
"""


def trajectory(path, rows):
    with path.open("w") as out:
        for i in range(rows):
            t = 1e-3 * i
            out.write(f"{1e5 + t:.6f} {t % 7:.6f} {t % 5:.6f} 1.600000 0.000000 0.000000 0.600000 0.800000\n")


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
    with path.open("wb") as out:
        out.write(head.encode())
        for start in range(0, points, 5000):
            block = range(start, min(start + 5000, points))
            out.write(b"".join(struct.pack("<3f", 1e-3 * (i % 5000), 1, 5e-4 * (i % 5000)) for i in block))


def depth(path, side):
    text = f"{{'descr': '<f4', 'fortran_order': False, 'shape': ({side}, {side}), }}"
    text = text.ljust((10 + len(text) + 1 + 63) // 64 * 64 - 11) + "\n"
    row = b"".join(struct.pack("<f", 1 + 1e-3 * i) for i in range(side))
    path.write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode() + row * side)


def peer(python, reader, path):
    """Its median seconds, or why there is none."""
    env = dict(os.environ, POLARS_MAX_THREADS="1", OMP_NUM_THREADS="1")
    code = TIMED.format(reader=reader, repeats=REPEATS)
    out = subprocess.run([python, "-c", code, str(path)], env=env, capture_output=True, text=True)
    lines = [line for line in out.stdout.splitlines() if line.startswith("[")]
    if out.returncode != 0 or not lines:
        return None, (out.stderr.strip().splitlines() or ["it says nothing"])[-1]
    return statistics.median(json.loads(lines[-1])), None


def ours(root, target, inputs, name):
    env = dict(os.environ, PAWS_BENCH_INPUT=str(inputs), RAYON_NUM_THREADS="1")
    command = ["cargo", "bench", "--bench", "importers", "--", "--exact", name]
    subprocess.run(command, cwd=root, env=env, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    estimate = json.loads((target / "criterion" / name / "new/estimates.json").read_text())
    return estimate["median"]["point_estimate"] * 1e-9


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--markdown", type=pathlib.Path)
    parser.add_argument("--peers-only", action="store_true")
    args = parser.parse_args()
    root = pathlib.Path(__file__).resolve().parent.parent
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", root / "target"))
    header = ["file", "MB", "ours, ms", "peer", "its ms", "peer / ours"]
    table = [header, ["---"] * len(header)]
    with tempfile.TemporaryDirectory() as folder:
        inputs = pathlib.Path(folder)
        trajectory(inputs / "poses.txt", 600_000)
        model(inputs / "model", 2_000, 2_000, 100_000)
        cloud(inputs / "cloud.ply", 2_000_000)
        depth(inputs / "depth.npy", 1408)
        for name, file, library, reader in READERS:
            path = inputs / file
            size = sum(p.stat().st_size for p in ([path] if path.is_file() else path.iterdir())) / 1e6
            # The two take turns, so that both see the same machine.
            mine = None if args.peers_only else ours(root, target, inputs, name)
            theirs, why = peer(args.python, reader, path)
            if why:
                print(f"{library}: {why}", file=sys.stderr)
            milliseconds = lambda s: "-" if s is None else f"{1e3 * s:.1f}"
            ratio = "-" if mine is None or theirs is None else f"{theirs / mine:.1f}"
            table.append([file, f"{size:.0f}", milliseconds(mine), library, milliseconds(theirs), ratio])
    text = "\n".join("| " + " | ".join(row) + " |" for row in table) + "\n"
    print(text)
    if args.markdown:
        args.markdown.write_text(text)


if __name__ == "__main__":
    main()
