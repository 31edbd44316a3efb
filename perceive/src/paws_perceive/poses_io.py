"""Images of a folder, as networks of poses take them."""

import pathlib

from . import Failure

ENDINGS = (".jpg", ".jpeg", ".png")


def images_in(folder):
    """The images of a folder by name."""
    found = sorted(p for p in pathlib.Path(folder).iterdir() if p.suffix.lower() in ENDINGS)
    if not found:
        raise Failure(f"{folder}: holds no JPEG or PNG images")
    return found


def size_of(path, about):
    """Width and height of an image, pixels."""
    from .adapters import package

    read = package("cv2", about).imread(str(path))
    if read is None:
        raise Failure(f"{path}: cannot be read")
    return read.shape[1], read.shape[0]
