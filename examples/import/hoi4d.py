"""Hands and cameras of an HOI4D sequence as JSON lines, which `paws import` reads.

    python3 hoi4d.py HANDPOSE_FOLDER 3Dseg/output.log MANO_MODELS hands.jsonl

HANDPOSE_FOLDER holds the sequence's pickles, one a frame (`12.pickle`), of the right hand. Joints need MANO's models and
manopth, which each user has to get. Import it with the sequence's images or video: paws import VIDEO.mp4 hands.jsonl --out DIR
"""

import json
import pathlib
import sys

FPS = 15


def cameras(log):
    """Poses x y z qx qy qz qw by frame from Open3D's log: a line of numbers, then four rows of camera to world."""
    lines = [line.split() for line in log.splitlines() if line.strip()]
    out = {}
    for at in range(0, len(lines) - 4, 5):
        rows = [[float(v) for v in line] for line in lines[at + 1 : at + 5]]
        out[int(lines[at][0])] = [*(row[3] for row in rows[:3]), *quaternion([row[:3] for row in rows[:3]])]
    return out


def quaternion(r):
    """x y z w of a rotation matrix, by its largest part so that nothing small is divided by."""
    trace = r[0][0] + r[1][1] + r[2][2]
    squares = [1 + 2 * r[i][i] - trace for i in range(3)] + [1 + trace]
    best = max(range(4), key=squares.__getitem__)
    s = squares[best] ** 0.5
    if best == 3:
        q = [r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1], s * s]
    else:
        i, j, k = best, (best + 1) % 3, (best + 2) % 3
        q = [0.0] * 4
        q[i], q[j], q[k], q[3] = s * s, r[j][i] + r[i][j], r[k][i] + r[i][k], r[k][j] - r[j][k]
    return [v / (2 * s) for v in q]


def rows(poses, hands):
    """Lines of the file. `poses`: x y z qx qy qz qw by frame; `hands`: (frame, 21 joints in the camera, metres)."""
    yield {"format": "paws-hands", "space": "camera", "fps": FPS, "title": "HOI4D hands and cameras", "licence": "CC BY-NC 4.0 (HOI4D)"}
    for frame, pose in sorted(poses.items()):
        yield {"frame": frame, "image": f"{frame:05d}", "camera": pose}
    for frame, joints in hands:
        yield {"frame": frame, "image": f"{frame:05d}", "side": "right", "joints": [[float(v) for v in p] for p in joints]}


def main(folder, log, models, out):
    import pickle

    import numpy as np
    import torch
    from manopth.manolayer import ManoLayer

    layer = ManoLayer(mano_root=models, use_pca=False, ncomps=45, flat_hand_mean=True, side="right")
    hands = []
    for file in sorted(pathlib.Path(folder).glob("*.pickle"), key=lambda f: int(f.stem)):
        data = pickle.loads(file.read_bytes())
        number = lambda key: torch.tensor(np.asarray(data[key], dtype=np.float32)).reshape(1, -1)
        _, joints = layer(number("poseCoeff"), number("beta"))
        hands.append((int(file.stem), (joints[0] / 1000 + number("trans")).numpy()))
    lines = rows(cameras(pathlib.Path(log).read_text()), hands)
    pathlib.Path(out).write_text("".join(json.dumps(line) + "\n" for line in lines))


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
