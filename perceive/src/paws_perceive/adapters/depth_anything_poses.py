"""Poses by Depth Anything 3 on a GPU, where its package `depth_anything_3` is installed."""

import json
import pathlib

from ..poses_io import images_in, size_of
from . import About, files_of_published, from_folder, gpu_only, licence_of, offline, package, torch_on, within_memory

ABOUT = About(
    name="depth-anything-3",
    stream="poses",
    package="git+https://github.com/ByteDance-Seed/Depth-Anything-3.git",
    extra="poses",
    licence="Apache-2.0 (DA3-SMALL, DA3-BASE), CC BY-NC 4.0 (DA3-LARGE, DA3-GIANT, DA3NESTED)",
    needs="colour images; --weights DIR with a folder da3 as the authors publish it; a Python that has the package (--python PATH)",
    gives="world-to-camera poses, OpenCV axes, arbitrary unit (of DA3NESTED: metres); one camera",
    devices=("gpu",),
    secs_per_frame=0.2,
    memory_mb=12000,
    version=1,
    weights_from="--weights DIR with da3/config.json and da3/model.safetensors (depth-anything/DA3-BASE and others)",
    asks=True,
)
FOLDER = "da3"
OPTIONS = {"process_res": 504}
FORMAT = "colmap"
# Words in the names of models that are not for commercial use.
NOT_COMMERCIAL = ("large", "giant", "nested")


def digests(weights):
    """SHA-256 of the model's files."""
    return files_of_published(ABOUT, weights, FOLDER)


def licence(weights):
    """The licence of the given model, by its name."""
    folder = pathlib.Path(weights) / FOLDER
    try:
        name = str(json.loads((folder / "config.json").read_text(encoding="utf-8"))["model_name"])
    except (OSError, ValueError, KeyError, TypeError):
        # Of an unknown model the stricter one.
        return "CC BY-NC 4.0"
    strict = any(word in name.lower() for word in NOT_COMMERCIAL) and "metric" not in name.lower()
    return "CC BY-NC 4.0" if strict else licence_of(folder, "Apache-2.0")


class Network:
    """A loaded model."""

    def __init__(self, torch, model):
        self._torch, self._model = torch, model

    def run(self, images, folder):
        """A model of the images of a folder as COLMAP text in `folder/0`: how many images it has."""
        import numpy as np  # Not needed to say what this is.

        from .. import colmap_text

        paths = images_in(images)
        with within_memory(self._torch):
            found = self._model.inference([str(p) for p in paths], process_res=OPTIONS["process_res"])
        rows, columns = np.asarray(found.depth).shape[1:]
        size = size_of(paths[0], ABOUT)
        matrix = colmap_text.resized(np.median(np.asarray(found.intrinsics, float), axis=0), (columns, rows), size)
        colmap_text.write(pathlib.Path(folder) / "0", size, matrix, [p.name for p in paths], np.asarray(found.extrinsics, float))
        return [len(paths)]


def load(device="cpu", weights=None):
    """The model of the folder of weights."""
    gpu_only(device, ABOUT)
    offline()
    torch, on = torch_on(device, ABOUT)
    api = package("depth_anything_3.api", ABOUT)
    model = from_folder(api.DepthAnything3, str(pathlib.Path(weights) / FOLDER))
    return Network(torch, model.to(on))
