"""Makes a long recording of a short one by playing it again and again; images are links, so it takes no space.

    python3 examples/long_recording.py SHORT LONG MINUTES [--idle N]

Poses, hands and clips are repeated with later time stamps and frame numbers; what paws needs of memory and time on it is that
of a real recording of this length, with as many clips an hour as the short one has. With --idle every frame in which nobody is
at work is there N times: a person who does other things in between.
"""

import argparse
import json
import os
import pathlib

arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
arguments.add_argument("short", type=pathlib.Path)
arguments.add_argument("long", type=pathlib.Path)
arguments.add_argument("minutes", type=float)
arguments.add_argument("--idle", type=int, default=1, metavar="N")
options = arguments.parse_args()
short, long = options.short, options.long
cameras, clips, hands = (json.loads((short / f"{n}.json").read_text()) for n in ("cameras", "clips", "hands"))

# Which frame of the short recording each frame of a round shows, and the first that shows it.
busy = {f for c in clips["clips"] for f in range(c["start_frame"], c["end_frame"] + 1)}
shown = [f for f in range(len(cameras["frames"])) for _ in range(1 if f in busy else options.idle)]
first = {}
for place, f in enumerate(shown):
    first.setdefault(f, place)
count = len(shown)
STEP_SECS = 0.1  # between two frames that show one: a video at ten frames a second
times, clock = [], 0.0
for place, f in enumerate(shown):
    if place:
        again = shown[place - 1] == f
        clock += STEP_SECS if again else cameras["frames"][f]["timestamp"] - cameras["frames"][f - 1]["timestamp"]
    times.append(clock)
period = clock + 0.5
rounds = int(options.minutes * 60 / period) + 1
long.mkdir()
for folder in ("frames", "depth", "masks", "normals"):
    (long / folder).mkdir()
    for image in (short / folder).iterdir():
        for place in (p for p, f in enumerate(shown) if f == int(image.stem)):
            for k in range(rounds):
                os.link(image, long / folder / f"{place + k * count:06d}{image.suffix}")


def moved(row, **changes):
    return {**row, **changes}


def frame(k, place):
    name = place + k * count
    return moved(cameras["frames"][shown[place]], frame=name, timestamp=times[place] + k * period, file=f"frames/{name:06d}.jpg")


frames = [frame(k, place) for k in range(rounds) for place in range(count)]
(long / "cameras.json").write_text(json.dumps({**cameras, "frames": frames}))
again = [
    moved(
        c,
        clip=f"{c['clip']}_{k}",
        start_frame=first[c["start_frame"]] + k * count,
        end_frame=first[c["end_frame"]] + k * count,
    )
    for k in range(rounds)
    for c in clips["clips"]
]
(long / "clips.json").write_text(json.dumps({"clips": again}))
seen = [moved(h, frame=first[h["frame"]] + k * count) for k in range(rounds) for h in hands["frames"]]
(long / "hands.json").write_text(json.dumps({**hands, "frames": seen}))
(long / "labels.json").write_text((short / "labels.json").read_text())
print(f"{len(frames)} frames, {len(again)} clips, {frames[-1]['timestamp'] / 60:.1f} minutes")
