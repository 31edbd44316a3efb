#!/usr/bin/env python3
"""How fast a batch is: one worker and two, this machine's processes and Ray; and what kill -9 does to it.

    python3 examples/batch_throughput.py WORK                         # 250 recordings of 4 clips; an hour on two cores
    python3 examples/batch_throughput.py WORK --recordings 20 --kills 5

Needs the program `paws` (--paws FILE, else the one in PATH); with --ray also ray and the Python package in this Python. WORK
keeps the recordings for the next time. It ends with 1 where tables or models differ between two ways to run, or a kill has
lost or repeated something.
"""

import argparse
import csv
import hashlib
import json
import os
import pathlib
import random
import shutil
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]
#: What `paws synth` renders: small pictures, two parts, each opened and closed once.
WIDTH, PARTS, CLIPS = 64, 2, 4
#: Twins are compared by these; the page and its pictures follow from them.
MODELS = ("twin.json", "validation.json", "predictions.json", "scene.xml", "scene.urdf", "scene.usda")
#: Seeds of development kitchens.
SEEDS = 1000


def recordings(args):
    """Renders the recordings that are not there yet; answers with their manifest."""
    folder = args.work / "recordings"
    folder.mkdir(parents=True, exist_ok=True)
    running = []
    for number in range(args.recordings):
        target = folder / f"r{number:05}"
        if target.is_dir():
            continue
        tier = ("clean", "realistic", "t2")[number % 3]
        words = ["synth", "--seed", str(number % SEEDS), "--tier", tier, "--width", str(WIDTH), "--parts", str(PARTS)]
        running.append(subprocess.Popen([args.paws, *words, "--out", str(target)], stdout=subprocess.DEVNULL))
        if len(running) == os.cpu_count():
            finish(running.pop(0))
    for one in running:
        finish(one)
    manifest = args.work / "manifest.csv"
    rows = "".join(f"k{number:05},recordings/r{number:05}\n" for number in range(args.recordings))
    manifest.write_text("name,recording\n" + rows)
    return manifest


def finish(process):
    if process.wait() != 0:
        sys.exit("a recording could not be rendered")


def environment(args, cores):
    """The variables of a run on so many cores."""
    found = {**os.environ, "RAYON_NUM_THREADS": str(cores)}
    if args.ray:
        found.update(PAWS_COMMAND=args.paws, PAWS_NO_TEXTURES="1")
    return found


def batch(args, manifest, out, workers):
    options = ["--no-textures"] if args.no_textures else []
    return [args.paws, "batch", str(manifest), "--out", str(out), "--jobs", str(workers), *options]


def timed(args, name, command, workers):
    """Runs a batch on as many cores as workers; answers with its wall-clock seconds."""
    cores = set(sorted(os.sched_getaffinity(0))[:workers])
    begun = time.monotonic()
    done = subprocess.run(
        command,
        env=environment(args, workers),
        preexec_fn=lambda: os.sched_setaffinity(0, cores),
        capture_output=True,
        text=True,
    )
    secs = time.monotonic() - begun
    if done.returncode not in (0, 1):
        sys.exit(f"{name}: {done.stderr[-2000:]}")
    return secs


def in_processes(out):
    """Seconds that the processes of all recordings took, together."""
    with open(out / "timings.csv", newline="") as file:
        return sum(float(row["secs"]) for row in csv.DictReader(file))


def fingerprint(out):
    """A hash of the tables without times, and of every twin's models."""
    found = hashlib.sha256()
    for table in ("results", "joints", "predictions"):
        found.update((out / f"{table}.csv").read_bytes())
    for twin in sorted((out / "twins").iterdir()):
        for name in MODELS:
            found.update(name.encode() + (twin / name).read_bytes())
    return found.hexdigest()


def finished(out):
    """Names in the journals of a folder, one for each entry."""
    names = []
    for journal in sorted(out.glob("journal*.jsonl")):
        for line in journal.read_text().splitlines():
            try:
                names.append(json.loads(line)["name"])
            except ValueError:
                pass  # cut off by a kill
    return names


def killed(args, manifest, secs):
    """Kills a batch at random moments, then lets it end; answers with what was lost and what was made twice."""
    out = fresh(args.work / "killed")
    draw = random.Random(args.seed)
    workers = min(2, os.cpu_count() or 1)
    for number in range(args.kills):
        process = subprocess.Popen(
            batch(args, manifest, out, workers), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        # So that all kills together come before the end.
        time.sleep(draw.uniform(0.0, 1.6 * secs / (args.kills + 1)))
        process.kill()
        process.wait()
        print(f"  kill {number + 1}: {len(set(finished(out)))} of {args.recordings} are finished")
        # What it had started ends with it, but not in no time.
        time.sleep(0.2)
    timed(args, "after the kills", batch(args, manifest, out, workers), workers)
    names = finished(out)
    wanted = {f"k{number:05}" for number in range(args.recordings)}
    return out, sorted(wanted - set(names)), sorted({name for name in names if names.count(name) > 1})


def fresh(out):
    shutil.rmtree(out, ignore_errors=True)
    return out


def main():
    parser = argparse.ArgumentParser(description="Throughput of paws batch.")
    parser.add_argument("work", type=pathlib.Path, help="folder for recordings and results")
    parser.add_argument("--recordings", type=int, default=250, help=f"of {CLIPS} clips each [default: 250]")
    parser.add_argument("--kills", type=int, default=20, help="kill -9 at so many random moments [default: 20]")
    parser.add_argument("--seed", type=int, default=0, help="of the moments [default: 0]")
    parser.add_argument("--paws", default=shutil.which("paws"), help="the program [default: the one in PATH]")
    parser.add_argument("--ray", action="store_true", help="on Ray, too")
    parser.add_argument("--textures", dest="no_textures", action="store_false", help="with textures, which take most of the time")
    parser.add_argument("--out", type=pathlib.Path, metavar="FILE", help="the numbers as JSON")
    args = parser.parse_args()
    if not args.paws:
        parser.error("no paws in PATH; give --paws")
    args.paws, args.work = str(pathlib.Path(args.paws).resolve()), args.work.resolve()
    manifest = recordings(args)
    ways = {f"{n} worker{'s' * (n > 1)}": n for n in (1, 2) if n <= (os.cpu_count() or 1)}
    rows = {}
    for name, workers in ways.items():
        out = fresh(args.work / f"out_{workers}")
        rows[name] = row(args, out, timed(args, name, batch(args, manifest, out, workers), workers), workers)
    if args.ray:
        out = fresh(args.work / "out_ray")
        workers = max(ways.values())
        script = [sys.executable, str(ROOT / "examples/python/batch_ray.py"), str(manifest), str(out)]
        rows["Ray"] = row(args, out, timed(args, "Ray", script, workers), workers)
    report(args, rows)
    first = next(iter(rows.values()))
    same = all(one["bytes"] == first["bytes"] for one in rows.values())
    print(f"the same bytes whatever ran them: {'yes' if same else 'NO'}")
    whole = True
    if args.kills:
        last = list(ways)[-1]
        out, lost, twice = killed(args, manifest, rows[last]["secs"])
        whole = not lost and not twice and fingerprint(out) == first["bytes"]
        print(f"after {args.kills} kills: lost {len(lost)}, made twice {len(twice)}, the same bytes: {'yes' if whole else 'NO'}")
    if args.out:
        args.out.write_text(json.dumps({"rows": rows, "kills": args.kills, "whole": whole}, indent=2) + "\n")
    return 0 if same and whole else 1


def row(args, out, secs, workers):
    """A way's numbers; the overhead is the share of the workers' time in which no recording was worked on."""
    work = in_processes(out)
    return {
        "workers": workers,
        "secs": secs,
        "clips_per_minute": 60.0 * CLIPS * args.recordings / secs,
        "overhead": 1.0 - work / (secs * workers),
        "bytes": fingerprint(out),
    }


def report(args, rows):
    one = next(iter(rows.values()))["secs"]
    print(f"{args.recordings} recordings, {CLIPS * args.recordings} clips")
    for name, numbers in rows.items():
        print(
            f"  {name:10} {numbers['secs']:8.1f} s  {numbers['clips_per_minute']:7.0f} clips a minute"
            f"  {one / numbers['secs']:5.2f} x  overhead {100 * numbers['overhead']:5.1f} %"
        )


if __name__ == "__main__":
    sys.exit(main())
