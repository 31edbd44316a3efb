"""Hands and cameras of HaWoR as JSON lines, which `paws import` reads.

    python3 hawor.py HAWOR_CHECKOUT VIDEO_FOLDER hands.jsonl [--native]

Run it in HaWoR's own environment, with MANO's models where HaWoR wants them: joints need them, and each user has to get them.
VIDEO_FOLDER is the folder that HaWoR made of the video. `--native` says that the video itself has 30 frames a second, so that
HaWoR's images are the video's frames. Hands that HaWoR filled in without seeing them are left out.
"""

import glob
import json
import pathlib
import sys

FPS = 30


def rotation(q):
    """Rows of the rotation of a quaternion x y z w."""
    x, y, z, w = q
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]


def in_camera(joints, pose):
    """Points of the world in a camera whose pose (x y z qx qy qz qw) maps it into the world."""
    r = rotation(pose[3:])
    moved = [[p[i] - pose[i] for i in range(3)] for p in joints]
    return [[sum(r[k][i] * p[k] for k in range(3)) for i in range(3)] for p in moved]


def observed(names):
    """Frames that files named `FIRST_LAST.json` cover, both included."""
    spans = [pathlib.Path(n).stem.split("_") for n in names]
    return {frame for first, last in spans for frame in range(int(first), int(last) + 1)}


def rows(cameras, hands, native=False):
    """Lines of the file. `cameras`: a pose (x y z qx qy qz qw, metres) by frame; `hands`: (frame, side, 21 joints, world)."""
    yield {
        "format": "paws-hands",
        "space": "camera",
        "fps": FPS,
        "title": "HaWoR hands and cameras",
        "licence": "CC BY-NC-ND 4.0 (HaWoR), MANO's licence",
    }
    place = lambda frame: {"image": f"{frame:04d}", **({"frame": frame} if native else {})}
    for frame, pose in sorted(cameras.items()):
        yield {**place(frame), "camera": [float(v) for v in pose]}
    for frame, side, joints in hands:
        if frame in cameras:
            camera = in_camera(joints, cameras[frame])
            yield {**place(frame), "side": side, "joints": [[float(v) for v in p] for p in camera]}


def main(checkout, folder, out, native):
    sys.path.insert(0, checkout)
    import joblib
    import numpy as np
    import torch
    from hawor.utils.process import run_mano, run_mano_left

    folder = pathlib.Path(folder)
    slam = np.load(sorted(glob.glob(str(folder / "SLAM/hawor_slam_w_scale_*.npz")))[0])
    scale = float(slam["scale"])
    start = int(pathlib.Path(sorted(glob.glob(str(folder / "SLAM/hawor_slam_w_scale_*.npz")))[0]).stem.split("_")[-2])
    cameras = {start + i: [*(t[:3] * scale), *t[3:]] for i, t in enumerate(slam["traj"])}
    trans, rot, pose, betas, _ = (torch.as_tensor(v) for v in joblib.load(folder / "world_space_res.pth"))
    hands = []
    for index, (side, run) in enumerate([("left", run_mano_left), ("right", run_mano)]):
        seen = observed(glob.glob(str(folder / f"cam_space/{index}/*.json")))
        one = slice(index, index + 1)
        joints = run(trans[one], rot[one], pose[one], betas=betas[one])["joints"][0].detach().cpu().numpy()
        hands += [(start + i, side, joints[i]) for i in range(len(joints)) if start + i in seen]
    pathlib.Path(out).write_text("".join(json.dumps(row) + "\n" for row in rows(cameras, hands, native)))


if __name__ == "__main__":
    words = [w for w in sys.argv[1:] if w != "--native"]
    if len(words) != 3:
        sys.exit(__doc__)
    main(*words, native="--native" in sys.argv)
