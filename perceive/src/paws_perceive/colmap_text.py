"""COLMAP's text files, of poses that come from somewhere else."""

import pathlib

import numpy as np


def quaternion(turn):
    """The unit quaternion (w, x, y, z; w not negative) of a 3 x 3 rotation."""
    # The largest of four is not near zero, and the others follow from it.
    m = np.asarray(turn, float)
    squares = 1 + np.array([np.trace(m), 2 * m[0, 0] - np.trace(m), 2 * m[1, 1] - np.trace(m), 2 * m[2, 2] - np.trace(m)])
    i = int(np.argmax(squares))
    s = 2 * np.sqrt(max(squares[i], 1e-12))
    x, y, z = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    xy, xz, yz = m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]
    q = np.array([[s * s / 4, x, y, z], [x, s * s / 4, xy, xz], [y, xy, s * s / 4, yz], [z, xz, yz, s * s / 4]][i]) / s
    q = q / np.linalg.norm(q)
    return -q if q[0] < 0 else q


def write(folder, size, camera_matrix, names, camera_from_world):
    """Writes a model of one pinhole camera.

    `size`: width and height, pixels; `camera_matrix`: 3 x 3, pixels counted from pixel centres; `names`: of the images;
    `camera_from_world`: for each a 3 x 4 or 4 x 4 matrix, OpenCV axes.
    """
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    k = np.asarray(camera_matrix, float)
    # COLMAP counts pixels from their corner.
    numbers = [k[0, 0], k[1, 1], k[0, 2] + 0.5, k[1, 2] + 0.5]
    camera = " ".join(f"{v:.9g}" for v in numbers)
    (folder / "cameras.txt").write_text(f"1 PINHOLE {size[0]} {size[1]} {camera}\n", encoding="utf-8")
    lines = ["# Image list", "# of pose lines,", "# each followed by a line of points,", "# which is empty here"]
    for number, (name, pose) in enumerate(zip(names, camera_from_world), 1):
        pose = np.asarray(pose, float)
        values = " ".join(f"{v:.9g}" for v in [*quaternion(pose[:3, :3]), *pose[:3, 3]])
        lines += [f"{number} {values} 1 {name}", ""]
    (folder / "images.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "points3D.txt").write_text("# none\n", encoding="utf-8")


def resized(camera_matrix, from_size, to_size):
    """A camera's matrix for images of another size (width, height); pixels counted from pixel centres."""
    k = np.asarray(camera_matrix, float).copy()
    for axis in (0, 1):
        factor = to_size[axis] / from_size[axis]
        k[axis, axis] *= factor
        k[axis, 2] = (k[axis, 2] + 0.5) * factor - 0.5
    return k
