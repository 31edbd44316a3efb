"""Writes a reconstruction by COLMAP's own writer, as text and as binary files.

    python3 colmap.py INPUT.json TEXT_DIR BINARY_DIR

INPUT.json: {"camera": [width, height, fx, fy, cx, cy], "images": [[name, qw, qx, qy, qz, tx, ty, tz], ...],
"points": [[x, y, z], ...]}; principal points from the corner of the first pixel, poses from the world to the camera.
"""

import json
import pathlib
import sys

import numpy as np
import pycolmap


def reconstruction(given):
    out = pycolmap.Reconstruction()
    width, height, *params = given["camera"]
    camera = pycolmap.Camera(camera_id=1, model="PINHOLE", width=width, height=height, params=params)
    out.add_camera_with_trivial_rig(camera)
    for number, (name, qw, qx, qy, qz, *place) in enumerate(given["images"], 1):
        turn = pycolmap.Rotation3d(np.array([qx, qy, qz, qw]))
        image = pycolmap.Image(image_id=number, camera_id=1, name=name)
        out.add_image_with_trivial_frame(image, pycolmap.Rigid3d(turn, np.array(place)))
    for point in given["points"]:
        out.add_point3D(np.array(point, dtype=float), pycolmap.Track(), np.array([200, 100, 50], dtype=np.uint8))
    return out


def main(given, text, binary):
    made = reconstruction(json.loads(pathlib.Path(given).read_text()))
    for folder, write in ((text, made.write_text), (binary, made.write_binary)):
        pathlib.Path(folder).mkdir(parents=True, exist_ok=True)
        write(folder)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
