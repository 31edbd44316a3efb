#!/usr/bin/env python3
"""How time and memory of `paws infer` grow with the clips of a recording and with the parts that they show: one table.

    python3 benches/growth.py [--paws PROGRAM] [--work DIR] [--clips 50,200,1000]

Two recordings for each number of clips: one part that is opened and closed again and again, and as many parts as are each seen five
times (200 clips: one part opened 200 times, 40 parts opened 5 times). They are made of `paws synth`'s kitchens (tier hd, 160 x 120
pixels), played one after the other, each kitchen a room of its own 30 m beside the last one; images are links. Processor seconds are of
all cores together, memory is the peak of what the process held.

DIR keeps the kitchens and, in growth.jsonl, every result of a program: a run that was stopped goes on where it was, and a second one
only prints.
All of it takes about 20 minutes on two cores, the 1000 clips most of them, and 1 GB of disk; `--clips 50` takes two minutes.
`cargo bench --bench growth` has 8 to 32 clips in a minute.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ("frames", "depth", "masks", "normals")
# What a round is made of: parts of a kitchen, clips of each part.
ROUNDS = {"one part": (1, 10), "five clips a part": (10, 5)}
SEED = 5
APART_M = 30.0  # of two rooms
PAUSE_SECS = 0.5  # between two rounds


def kitchen(args, seed, parts, clips):
    """The folder of a short recording, made once."""
    out = args.work / f"kitchen_{args.tier}_{args.width}_{seed}_{parts}x{clips}"
    if not out.is_dir():
        command = [args.paws, "synth", "--seed", seed, "--tier", args.tier, "--parts", parts, "--clips-per-part", clips]
        command += ["--width", args.width, "--out", out]
        subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    return out


def tables(folder):
    return {name: json.loads((folder / f"{name}.json").read_text()) for name in ("cameras", "clips", "hands", "labels")}


def shifted(place, by_m):
    return [place[0] + by_m, *place[1:]]


def joined(rounds, out):
    """Plays recordings one after the other, each (folder, metres along x), as one; its number of frames."""
    making = out.with_suffix(".part")
    shutil.rmtree(making, ignore_errors=True)
    for folder in IMAGES:
        (making / folder).mkdir(parents=True)
    frames, clips, hands, labels, clock, first = [], [], [], {}, 0.0, None
    for k, (folder, by_m) in enumerate(rounds):
        of = tables(folder)
        first = first or of
        if any(labels.setdefault(number, name) != name for number, name in of["labels"].items()):
            sys.exit(f"{folder}: its labels number other things than those of the kitchens before it")
        base = len(frames)
        for place, frame in enumerate(of["cameras"]["frames"]):
            number = base + place
            frames.append({**frame, "frame": number, "timestamp": clock + frame["timestamp"],
                           "position": shifted(frame["position"], by_m), "file": f"frames/{number:06d}.jpg"})  # fmt: skip
        clips += [{**c, "clip": f"{c['clip']}_{k}", "start_frame": c["start_frame"] + base, "end_frame": c["end_frame"] + base}
                  for c in of["clips"]["clips"]]  # fmt: skip
        for seen in of["hands"]["frames"]:
            moved = [{**h, "joints_world": [shifted(p, by_m) for p in h["joints_world"]]} for h in seen["hands"]]
            hands.append({**seen, "frame": int(seen["frame"]) + base, "hands": moved})
        for images in IMAGES:
            for image in (folder / images).iterdir():
                os.link(image, making / images / f"{int(image.stem) + base:06d}{image.suffix}")
        clock = frames[-1]["timestamp"] + PAUSE_SECS
    whole = {"cameras": {**first["cameras"], "frames": frames}, "clips": {"clips": clips},
             "hands": {**first["hands"], "frames": hands}, "labels": labels}  # fmt: skip
    for name, value in whole.items():
        (making / f"{name}.json").write_text(json.dumps(value))
    shutil.rmtree(out, ignore_errors=True)
    making.rename(out)
    return len(frames)


def measured(args, recording):
    """Seconds and memory of one `paws infer`."""
    with open(args.work / "infer.log", "wb") as log:
        began = time.perf_counter()
        command = [args.paws, "infer", recording, "--as-is", "--out", args.work / "predictions.json"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=log)
        _, status, used = os.wait4(process.pid, 0)
        wall = time.perf_counter() - began
    code = process.returncode = os.waitstatus_to_exitcode(status)
    if code not in (0, 1):
        sys.exit(f"{recording}: exit code {code}: {(args.work / 'infer.log').read_text()[-400:]}")
    # Kilobytes on Linux, bytes on macOS.
    unit = 1e9 if sys.platform == "darwin" else 1e6
    return {"processor_secs": used.ru_utime + used.ru_stime, "wall_secs": wall, "peak_gb": used.ru_maxrss / unit}


def result(args, kind, clips):
    """What a recording of so many clips takes: from the journal, else measured and written there."""
    program = args.paws.stat()
    name = f"{kind}, {clips}, {args.tier}, {args.width}, {program.st_size}, {int(program.st_mtime)}"
    journal = args.work / "growth.jsonl"
    for line in journal.read_text().splitlines() if journal.is_file() else []:
        if json.loads(line)["name"] == name:
            return json.loads(line)
    parts, each = ROUNDS[kind]
    count = clips // (parts * each)
    same = kind == "one part"
    rounds = [(kitchen(args, SEED if same else SEED + k, parts, each), 0.0 if same else APART_M * k) for k in range(count)]
    print(f"{kind}, {clips} clips: a recording of {count} rounds ...", file=sys.stderr)
    recording = args.work / "recording"
    frames = joined(rounds, recording)
    row = {"name": name, "kind": kind, "clips": clips, "parts": parts if same else parts * count, "frames": frames}
    row |= measured(args, recording)
    shutil.rmtree(recording)
    with journal.open("a") as out:
        out.write(json.dumps(row) + "\n")
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    parser.add_argument("--paws", type=Path, default=target / "release/paws")
    parser.add_argument("--work", type=Path, default=target / "tmp/growth", metavar="DIR")
    parser.add_argument("--clips", default="50,200,1000", help="multiples of 50, by commas")
    parser.add_argument("--tier", default="hd")
    parser.add_argument("--width", type=int, default=160, help="of the images, pixels")
    args = parser.parse_args()
    args.paws, args.work = args.paws.resolve(), args.work.resolve()
    counts = [int(n) for n in args.clips.split(",")]
    if any(n <= 0 or n % 50 for n in counts):
        parser.error("--clips are multiples of 50")
    args.work.mkdir(parents=True, exist_ok=True)
    # Ten seconds a kitchen of ten parts, a third of a second a clip for two cores' work.
    about = max(counts) / 50 * 10 + sum(counts) * 2 * 0.35
    print(f"up to {about / 60 + 1:.0f} minutes where nothing is measured yet", file=sys.stderr)
    began = time.perf_counter()
    print("| recording | clips | parts | frames | processor s | a clip | wall s | peak memory, GB |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for kind in ROUNDS:
        for clips in counts:
            r = result(args, kind, clips)
            print(f"| {kind} | {r['clips']:,} | {r['parts']} | {r['frames']:,} | {r['processor_secs']:.1f} | "
                  f"{r['processor_secs'] / r['clips']:.2f} | {r['wall_secs']:.1f} | {r['peak_gb']:.2f} |", flush=True)  # fmt: skip
    print(f"{(time.perf_counter() - began) / 60:.1f} minutes", file=sys.stderr)


if __name__ == "__main__":
    main()
