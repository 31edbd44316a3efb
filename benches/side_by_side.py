"""Our stages beside what people would otherwise run, on the same bytes, one core, in one session.

    python3 benches/side_by_side.py [PEERS] [--python PYTHON] [--markdown FILE] [--only NAME]

PEERS is a folder of peer benchmarks (peer_voxel.py, ...): scripts that take --dump DIR, --peer all, --cores 1 and print a
JSON line a peer; where none is named PAWS_PEERS, else ../shared/peers, and without such a folder nothing is compared, which is said.
PYTHON is an interpreter that has what they need. Prints for each stage our time, every peer's, and the ratios; medians of the
repetitions of either side. A stage whose peers or bench fail costs itself only: it is told, and the exit code is 1.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

# Our bench, and the peer's script with its size.
STAGES = [
    ("voxel_views", ["peer_voxel.py"]),
    ("voxel_views_10m", ["peer_voxel.py", "--points", "10000000"]),
    ("view_select", ["peer_views.py"]),
    ("view_select_100k", ["peer_views.py", "--frames", "100000"]),
    ("lsd", ["peer_lsd.py"]),
    ("lsd_456", ["peer_lsd.py", "--res", "456x256", "--views", "50"]),
    # One of its peers (filterpy) alone takes a quarter of an hour at this size.
    ("kalman_rts", ["peer_kalman.py"]),
    ("normals_manhattan", ["peer_normals.py", "--res", "456x256", "--views", "50", "--sample", "20000"]),
    ("lines3d_ransac", ["peer_lines3d.py", "--part", "ransac", "--max-tracks", "30"]),
    ("score_axes", ["peer_score.py", "--clips", "2000"]),
]
# Written by hand for this very stage, not libraries that people use.
BY_HAND = {"numba", "numpy", "numpy_dense", "numba+fpsample", "numpy+fpsample"}


def json_lines(text):
    return [json.loads(line) for line in text.splitlines() if line.startswith("{")]


def triad_bytes_per_s(python, peers):
    out = subprocess.run([python, "peer_stream.py", "--peer", "triad", "--cores", "1"], cwd=peers, capture_output=True, text=True)
    for row in json_lines(out.stdout):
        return row["rate"]["value"] * 1e9
    return None


def dumped(args, command, folder):
    """Has the peers' script write the inputs of a stage."""
    command = [args.python, *command, "--dump", folder]
    done = subprocess.run(command, cwd=args.peers, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{command[1]} --dump: {done.stderr.strip()[-300:]}")


def ours_of(root, target, inputs, name):
    """Median seconds of our bench on these inputs, and their interval."""
    env = dict(os.environ, PAWS_BENCH_INPUT=inputs, RAYON_NUM_THREADS="1")
    command = ["cargo", "bench", "--bench", "stages", "--", "--exact", name]
    done = subprocess.run(command, cwd=root, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    estimates = target / "criterion" / name / "new" / "estimates.json"
    if done.returncode or not estimates.is_file():
        raise RuntimeError(f"cargo bench: {done.stderr.strip()[-300:]}")
    median = json.loads(estimates.read_text())["median"]
    interval = [median["confidence_interval"][k] * 1e-9 for k in ("lower_bound", "upper_bound")]
    return median["point_estimate"] * 1e-9, interval


def peers_of(args, command):
    """What each peer says of a stage, by its name."""
    command = [args.python, *command, "--peer", "all", "--cores", "1"]
    out = subprocess.run(command, cwd=args.peers, capture_output=True, text=True)
    peers = {r["peer"]: r for r in json_lines(out.stdout) if "seconds" in r}
    if not peers:
        raise RuntimeError(f"no peer ran: {out.stderr.strip()[-300:]}")
    return peers


def measured(args, root, target, name, command, band):
    """A stage: ours, its interval, the best library, the best by hand, the bound by bytes, all peers."""
    with tempfile.TemporaryDirectory() as inputs:
        dumped(args, command, os.path.join(inputs, name))
        # The two take turns, so that both see the same machine.
        ours, interval = ours_of(root, target, inputs, name)
    peers = peers_of(args, command)
    library = min((r["seconds"] for p, r in peers.items() if p not in BY_HAND), default=None)
    by_hand = min((r["seconds"] for p, r in peers.items() if p in BY_HAND), default=None)
    work = next(iter(peers.values())).get("bound") or {}
    bound = work["bytes"] / band if band and "bytes" in work else None
    print(f"{name}: ours {ours * 1e3:.2f} ms", file=sys.stderr)
    return name, ours, interval, library, by_hand, bound, peers


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = pathlib.Path(__file__).resolve().parent.parent
    usual = pathlib.Path(os.environ.get("PAWS_PEERS") or root / "../shared/peers")
    parser.add_argument("peers", type=pathlib.Path, nargs="?", default=usual)
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("--markdown", type=pathlib.Path)
    parser.add_argument("--only", help="stages with this in their name")
    args = parser.parse_args()
    if not args.peers.is_dir():
        if args.peers != usual:
            sys.exit(f"{args.peers}: no such folder")
        return print(f"skipped: there is no folder of peers at {usual} (PAWS_PEERS names another)")
    target = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", root / "target"))
    stages = [s for s in STAGES if not args.only or args.only in s[0]]
    band = triad_bytes_per_s(args.python, args.peers)
    rows, failed = [], 0
    for name, command in stages:
        try:
            rows.append(measured(args, root, target, name, command, band))
        except RuntimeError as error:
            failed += 1
            print(f"{name}: {error}", file=sys.stderr)
    header = ["stage", "ours, ms (95 %)", "best library / ours", "by hand (numba) / ours", "ours / bytes bound", "peers, ms"]
    table = [header, ["---"] * len(header)]
    ratio = lambda a, b: "-" if a is None or not b else f"{a / b:.1f}"
    for name, ours, interval, library, by_hand, bound, peers in rows:
        listed = ", ".join(f"{p} {r['seconds'] * 1e3:.1f}" for p, r in sorted(peers.items(), key=lambda x: x[1]["seconds"]))
        spread = f"{ours * 1e3:.2f} ({interval[0] * 1e3:.2f}..{interval[1] * 1e3:.2f})"
        table.append([name, spread, ratio(library, ours), ratio(by_hand, ours), ratio(ours, bound), listed])
    text = "\n".join("| " + " | ".join(r) + " |" for r in table) + "\n"
    print(text)
    if args.markdown:
        args.markdown.write_text(text)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
