"""Poses by COLMAP's structure from motion on a CPU: features, matches of neighbouring frames, incremental mapping."""

import pathlib
import shutil

from .. import Failure
from . import About, package

# A frame is matched with this many before it, and with those 2, 4, 8 ... before.
OVERLAP = 12
# Models of fewer images are no walk through a kitchen.
LEAST_IMAGES = 10
OPTIONS = {"overlap": OVERLAP}
# The reader of `paws import` for what it writes.
FORMAT = "colmap"

ABOUT = About(
    name="pycolmap",
    stream="poses",
    package="pycolmap>=4.2.1,<5",
    extra="poses",
    licence="BSD-3-Clause",
    needs="colour images in order, with texture and without much blur",
    gives="world-to-camera poses, OpenCV axes, arbitrary unit; one camera; points; one model a piece of the walk that hangs together",
    devices=("cpu",),
    # 60 frames of 640x480 took 56 s on one core.
    secs_per_frame=1.0,
    memory_mb=1500,
    version=1,
)


class Network:
    """COLMAP with fixed options and seed."""

    def __init__(self, pycolmap):
        self._pycolmap = pycolmap

    def run(self, images, folder):
        """Models of the images of a folder, largest first, as COLMAP text in `folder/0`, `folder/1`, ...: images of each."""
        colmap = self._pycolmap
        folder = pathlib.Path(folder)
        database = folder / "database.db"
        database.unlink(missing_ok=True)
        cpu = colmap.Device.cpu
        colmap.set_random_seed(0)
        colmap.extract_features(database, images, camera_mode=colmap.CameraMode.SINGLE, device=cpu)
        pairs = colmap.SequentialPairingOptions()
        pairs.overlap = OVERLAP
        colmap.match_sequential(database, pairing_options=pairs, device=cpu)
        options = colmap.IncrementalPipelineOptions()
        options.min_model_size = LEAST_IMAGES
        options.random_seed = 0
        raw = folder / "mapping"
        shutil.rmtree(raw, ignore_errors=True)
        raw.mkdir(parents=True)
        models = sorted(colmap.incremental_mapping(database, images, raw, options).values(), key=lambda m: -m.num_reg_images())
        if not models:
            raise Failure(
                f"{images}: no poses can be found: neighbouring images have too little in common (motion blur, bare walls, a camera "
                "that only turns); give poses of another source (a phone with ARKit), or film more slowly and with more light"
            )
        counts = []
        for number, model in enumerate(models):
            out = folder / str(number)
            out.mkdir(exist_ok=True)
            model.write_text(out)
            counts.append(model.num_reg_images())
        shutil.rmtree(raw, ignore_errors=True)
        database.unlink(missing_ok=True)
        return counts


def load(device="cpu", weights=None):
    """COLMAP; it has no weights."""
    return Network(package("pycolmap", ABOUT))
