"""Metric poses by MapAnything on a GPU, where its package `mapanything` is installed."""

import pathlib

from ..poses_io import images_in, size_of
from . import About, files_of_published, from_folder, gpu_only, licence_of, offline, package, torch_on, within_memory

ABOUT = About(
    name="mapanything",
    stream="poses",
    package="git+https://github.com/facebookresearch/map-anything.git",
    extra="poses",
    licence="Apache-2.0 (code, map-anything-apache), CC BY-NC 4.0 (map-anything)",
    needs="colour images; --weights DIR with a folder mapanything as the authors publish it; a Python that has the package (--python PATH)",
    gives="camera-to-world poses, OpenCV axes, metres as far as the network tells; one camera",
    devices=("gpu",),
    secs_per_frame=0.3,
    memory_mb=16000,
    version=1,
    weights_from="--weights DIR with mapanything/config.json and mapanything/model.safetensors (facebook/map-anything-apache)",
    asks=True,
)
FOLDER = "mapanything"
OPTIONS = {"memory_efficient": True}
FORMAT = "mapanything"


def digests(weights):
    """SHA-256 of the model's files."""
    return files_of_published(ABOUT, weights, FOLDER)


def licence(weights):
    """The licence of the given model, as its card says it; else the stricter one."""
    named = licence_of(pathlib.Path(weights) / FOLDER, "CC BY-NC 4.0")
    return "CC BY-NC 4.0" if "nc" in named.lower() else named


class Network:
    """A loaded model."""

    def __init__(self, torch, model, load_images):
        self._torch, self._model, self._load_images = torch, model, load_images

    def run(self, images, folder):
        """A model of the images of a folder as COLMAP text in `folder/0`: how many images it has."""
        import numpy as np  # Not needed to say what this is.

        from .. import colmap_text

        paths = images_in(images)
        with within_memory(self._torch):
            found = self._model.infer(self._load_images([str(p) for p in paths]), memory_efficient_inference=OPTIONS["memory_efficient"])
        numbers = lambda key: np.array([np.asarray(one[key].float().cpu())[0] for one in found], float)
        world_from_camera, matrices = numbers("camera_poses"), numbers("intrinsics")
        rows, columns = found[0]["depth_z"].shape[1:3]
        size = size_of(paths[0], ABOUT)
        matrix = colmap_text.resized(np.median(matrices, axis=0), (columns, rows), size)
        poses = np.linalg.inv(world_from_camera)
        colmap_text.write(pathlib.Path(folder) / "0", size, matrix, [p.name for p in paths], poses)
        return [len(paths)]


def load(device="cpu", weights=None):
    """The model of the folder of weights."""
    gpu_only(device, ABOUT)
    offline()
    torch, on = torch_on(device, ABOUT)
    models, pictures = package("mapanything.models", ABOUT), package("mapanything.utils.image", ABOUT)
    model = from_folder(models.MapAnything, str(pathlib.Path(weights) / FOLDER))
    return Network(torch, model.to(on).eval(), pictures.load_images)
