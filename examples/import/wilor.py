"""Hands of WiLoR or HaMeR with all joints as JSON lines, which `paws import` reads.

Call `row` in the loop of the network's own demo, for each hand, and write the lines below `header`:

    lines = [wilor.header(width, height)]
    ...
    joints = out["pred_keypoints_3d"][n].cpu().numpy()  # 21, of a right hand
    lines.append(wilor.row(image_name, is_right, joints, cam_t_full[n]))
    ...
    open("hands.jsonl", "w").write("".join(json.dumps(line) + "\\n" for line in lines))
"""

import pathlib

FOCAL, CROP = 5000.0, 256.0


def header(width, height):
    """The first line, for images of this size, pixels: the demo's focal length is no real one, and `paws` corrects it."""
    return {
        "format": "paws-hands",
        "space": "camera",
        "focal_per_width": FOCAL / CROP * max(width, height) / width,
        "title": "WiLoR hands",
        "licence": "CC BY-NC-ND 4.0 (WiLoR), MANO's licence",
    }


def row(image, is_right, joints, cam_t):
    """A hand: joints about its own middle (metres, those of a left hand still mirrored) and where the camera sees that middle."""
    sign = 1.0 if is_right else -1.0
    placed = [[sign * float(p[0]) + float(cam_t[0]), float(p[1]) + float(cam_t[1]), float(p[2]) + float(cam_t[2])] for p in joints]
    return {"image": pathlib.PurePath(image).stem, "side": "right" if is_right else "left", "joints": placed}
