"""A recording out of numpy arrays: python from_arrays.py [RECORDING] (needs Pillow, to read the images that are given again)"""

import sys

import numpy as np
from PIL import Image

import paws_twin

# 1. Arrays, as a program of yours has them; here they are read from a folder.
if len(sys.argv) > 1:
    source = paws_twin.Recording(sys.argv[1])
else:
    source = paws_twin.synth(seed=3, tier="clean", width=160, parts=1)
frames = range(len(source.times))


def images(pattern):
    """An image a frame; None where there is none."""
    files = [source.path / pattern.format(frame) for frame in frames]
    return [np.asarray(Image.open(file)) if file.is_file() else None for file in files]


depth = [None if mm is None else mm / 1000.0 for mm in images("depth/{:06}.png")]
rgb = images("frames/{:06}.jpg")
masks = images("masks/{:06}.png")
labels = {int(k): v for k, v in source.table("labels.json").items()}
hands = [
    paws_twin.Hand(frame["frame"], hand["side"], np.array(hand["joints_world"]), hand.get("contact"))
    for frame in source.table("hands.json")["frames"]
    for hand in frame["hands"]
]
camera = source.table("cameras.json")

# 2. The recording. Normals are left out: the slope of the depth is used.
recording = paws_twin.Recording.from_arrays(
    intrinsics=source.intrinsics,
    size=(camera["width"], camera["height"]),
    poses=source.poses,
    times=source.times,
    clips=source.clips,
    hands=hands,
    depth=depth,
    rgb=rgb,
    masks=masks,
    labels=labels,
)

# 3. Its joints.
for prediction in paws_twin.infer(recording):
    if prediction.kind:
        print(f"{prediction.clip}: {prediction.kind}, axis {np.round(prediction.axis, 2)}, {prediction.range:.2f}")
    else:
        print(f"{prediction.clip}: no answer: {prediction.reason}")
