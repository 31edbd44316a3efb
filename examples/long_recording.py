"""Makes a long recording of a short one by playing it again and again; images are links, so it takes no space.

    python3 examples/long_recording.py SHORT LONG MINUTES

Poses, hands and clips are repeated with later time stamps and frame numbers; what paws needs of memory and time on it is that
of a real recording of this length, with as many clips an hour as the short one has.
"""

import json
import os
import pathlib
import sys

short, long, minutes = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]), float(sys.argv[3])
cameras, clips, hands = (json.loads((short / f"{n}.json").read_text()) for n in ("cameras", "clips", "hands"))
count = len(cameras["frames"])
period = cameras["frames"][-1]["timestamp"] - cameras["frames"][0]["timestamp"] + 0.5
rounds = int(minutes * 60 / period) + 1
long.mkdir()
for folder in ("frames", "depth", "masks", "normals"):
    (long / folder).mkdir()
    for image in (short / folder).iterdir():
        for k in range(rounds):
            os.link(image, long / folder / f"{int(image.stem) + k * count:06d}{image.suffix}")


def moved(row, **changes):
    return {**row, **changes}


frames = [
    moved(f, frame=f["frame"] + k * count, timestamp=f["timestamp"] + k * period, file=f"frames/{f['frame'] + k * count:06d}.jpg")
    for k in range(rounds)
    for f in cameras["frames"]
]
(long / "cameras.json").write_text(json.dumps({**cameras, "frames": frames}))
again = [
    moved(c, clip=f"{c['clip']}_{k}", start_frame=c["start_frame"] + k * count, end_frame=c["end_frame"] + k * count)
    for k in range(rounds)
    for c in clips["clips"]
]
(long / "clips.json").write_text(json.dumps({"clips": again}))
seen = [moved(h, frame=h["frame"] + k * count) for k in range(rounds) for h in hands["frames"]]
(long / "hands.json").write_text(json.dumps({**hands, "frames": seen}))
(long / "labels.json").write_text((short / "labels.json").read_text())
print(f"{len(frames)} frames, {len(again)} clips, {frames[-1]['timestamp'] / 60:.1f} minutes")
