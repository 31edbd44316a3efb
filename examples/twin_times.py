#!/usr/bin/env python3
"""How long `paws twin` takes with two programs: examples/twin_times.py PAWS_A PAWS_B RECORDING... [--repeat N] [--args="..."]

The two take turns on each recording, the first one changing from repetition to repetition, so that both see the same machine; one run
of each goes before and does not count. Printed are medians of wall and processor seconds, the peak of resident memory (the largest of
the repetitions), the ratio of the processor seconds, and whether the twins are the same bytes. A recording with two programs takes
2 (N + 1) times what `paws twin` takes.
"""

import argparse
import hashlib
import os
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def run(paws: Path, recording: Path, out: Path, more: list[str]) -> dict:
    """One run: seconds, memory (MB), exit code."""
    with tempfile.TemporaryFile() as said:
        began = time.perf_counter()
        command = [paws, "twin", recording, "--out", out, *more]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said)
        _, status, used = os.wait4(process.pid, 0)
        wall = time.perf_counter() - began
        code = os.waitstatus_to_exitcode(status)
        # The process has been waited for already.
        process.returncode = code
        # 1: a joint is refuted or missing, which changes nothing here.
        if code not in (0, 1):
            said.seek(0)
            sys.exit(f"{paws} twin {recording}: exit code {code}: {said.read().decode(errors='replace').strip()[-400:]}")
    # Kilobytes on Linux, bytes on macOS.
    unit = 1e6 if sys.platform == "darwin" else 1e3
    return {"wall": wall, "cpu": used.ru_utime + used.ru_stime, "memory": used.ru_maxrss / unit}


def digest(folder: Path) -> str:
    """Of all names and bytes of a folder."""
    all_bytes = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        all_bytes.update(f"{path.relative_to(folder)}\0".encode() + path.read_bytes())
    return all_bytes.hexdigest()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paws_a", type=Path)
    parser.add_argument("paws_b", type=Path)
    parser.add_argument("recordings", type=Path, nargs="+", metavar="recording")
    parser.add_argument("--repeat", type=int, default=5, metavar="N", help="runs of each program that count (5)")
    parser.add_argument("--args", default="", help='more options of `paws twin`: --args="--no-textures --as-is"')
    args = parser.parse_args()
    programs = {"A": args.paws_a.resolve(), "B": args.paws_b.resolve()}
    more = shlex.split(args.args)
    print("| recording | A, s | B, s | A, processor s | B, processor s | A / B | A, MB | B, MB | same bytes |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    ratios = []
    for recording in map(Path.resolve, args.recordings):
        runs = {"A": [], "B": []}
        with tempfile.TemporaryDirectory() as scratch:
            # One place for both: what stands in a twin may name where it lies.
            out, digests = Path(scratch) / "twin", {}
            for turn in range(args.repeat + 1):
                for name in ("A", "B") if turn % 2 == 0 else ("B", "A"):
                    result = run(programs[name], recording, out, more)
                    digests[name] = digest(out)
                    if turn:
                        runs[name].append(result)
        of = lambda name, key: statistics.median(r[key] for r in runs[name])
        peak = lambda name: max(r["memory"] for r in runs[name])
        ratio = of("A", "cpu") / of("B", "cpu")
        ratios.append(ratio)
        same = "yes" if digests["A"] == digests["B"] else "no"
        print(
            f"| {recording.name} | {of('A', 'wall'):.2f} | {of('B', 'wall'):.2f} | {of('A', 'cpu'):.2f} | {of('B', 'cpu'):.2f} "
            f"| {ratio:.2f} | {peak('A'):.0f} | {peak('B'):.0f} | {same} |",
            flush=True,
        )
    print(f"\nMedians of {args.repeat}; A takes {statistics.median(ratios):.2f} times the processor time of B, median of {len(ratios)} recordings.")


if __name__ == "__main__":
    main()
