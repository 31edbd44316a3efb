#!/usr/bin/env python3
"""What a large batch costs, from a small one: hours, gigabytes and money.

    RAYON_NUM_THREADS=2 paws batch sample.csv --out sample --jobs 2          # as many jobs as cores: a core each
    python3 examples/batch_cost.py sample --clips 6000                       # EPIC-Fields
    python3 examples/batch_cost.py sample --seconds 148680 --clips 4000   # HD-EPIC: its seconds of video, of which that many clips

SAMPLE is the folder of a finished batch. Its recordings should be like those of the large one: the size of their pictures and the
frames a clip decide. Of every recording the seconds of its process (timings.csv) count as seconds of one core; the interval is
two standard errors of the cost a clip, over recordings. Machines and their prices are in examples/machines.csv (--machines FILE).
"""

import argparse
import csv
import json
import math
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
GB = 1e9


def size(folder):
    """Bytes of all files in a folder."""
    return sum(one.stat().st_size for one in pathlib.Path(folder).rglob("*") if one.is_file())


def sample(out):
    """Of each finished recording: clips, seconds of its process, bytes of the recording and of the twin, seconds recorded."""
    with open(out / "timings.csv", newline="") as file:
        secs = {row["name"]: float(row["secs"]) for row in csv.DictReader(file)}
    with open(out / "results.csv", newline="") as file:
        clips = {row["name"]: int(row["clips"]) for row in csv.DictReader(file) if row["status"] != "failed"}
    entries = {}
    for journal in sorted(out.glob("journal*.jsonl")):
        for line in journal.read_text().splitlines():
            entry = json.loads(line)
            entries[entry["name"]] = entry
    rows = []
    for name, count in sorted(clips.items()):
        folders = entries[name]["recordings"]
        frames = [json.loads((pathlib.Path(f) / "cameras.json").read_text())["frames"] for f in folders]
        rows.append(
            {
                "clips": count,
                "secs": secs[name],
                "read": sum(size(folder) for folder in folders),
                "written": size(out / "twins" / name),
                "recorded": sum(f[-1]["timestamp"] - f[0]["timestamp"] for f in frames if f),
            }
        )
    return rows


def ratio(rows, what, per):
    """Sum over sum, and its standard error over recordings (of the ratio estimator)."""
    total = sum(row[per] for row in rows)
    value = sum(row[what] for row in rows) / total
    if len(rows) < 2:
        return value, math.nan
    spread = sum((row[what] - value * row[per]) ** 2 for row in rows) / (len(rows) - 1)
    return value, math.sqrt(spread * len(rows)) / total


def amount(value, error, scale):
    if math.isnan(error):
        return f"{value * scale:,.1f}"
    return f"{value * scale:,.1f} +- {2 * error * scale:,.1f}"


def main():
    parser = argparse.ArgumentParser(description="What a large batch costs.")
    parser.add_argument("sample", type=pathlib.Path, help="folder of a finished batch")
    parser.add_argument("--clips", type=int, required=True, help="clips of the large batch")
    parser.add_argument("--seconds", type=float, help="seconds of its video, if all of it is stored [default: as in the sample]")
    parser.add_argument("--threads", type=int, default=1, help="threads that each process had [default: 1]")
    parser.add_argument("--memory", type=float, default=2.0, metavar="GB", help="of one process [default: 2]")
    parser.add_argument("--machines", type=pathlib.Path, default=HERE / "machines.csv")
    args = parser.parse_args()
    rows = [row for row in sample(args.sample) if row["clips"] > 0]
    if not rows:
        sys.exit(f"{args.sample}: no finished recording with clips")
    secs = ratio(rows, "secs", "clips")
    secs = tuple(args.threads * x for x in secs)
    print(f"sample: {len(rows)} recordings, {sum(row['clips'] for row in rows)} clips, {amount(*secs, 1)} core seconds a clip")
    core_hours = tuple(x * args.clips / 3600 for x in secs)
    print(f"{args.clips:,} clips: {amount(*core_hours, 1)} core hours")
    if args.seconds is not None and sum(row["recorded"] for row in rows) > 0:
        read = tuple(x * args.seconds for x in ratio(rows, "read", "recorded"))
    else:
        read = tuple(x * args.clips for x in ratio(rows, "read", "clips"))
    written = tuple(x * args.clips for x in ratio(rows, "written", "clips"))
    print(f"recordings: {amount(*read, 1 / GB)} GB; twins: {amount(*written, 1 / GB)} GB")
    print(f"\n{'machine':24} {'jobs':>5} {'hours':>18} {'money, $':>20}")
    with open(args.machines, newline="") as file:
        for machine in csv.DictReader(file):
            jobs = max(1, min(int(machine["cores"]), int(float(machine["memory_gb"]) / args.memory)))
            hours = tuple(x / jobs for x in core_hours)
            price = float(machine["dollars_per_hour"])
            print(f"{machine['name']:24} {jobs:5} {amount(*hours, 1):>18} {amount(*hours, price):>20}")


if __name__ == "__main__":
    main()
