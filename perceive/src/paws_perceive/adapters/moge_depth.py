"""Depth and normals by MoGe-2, where its authors' package `moge` is installed.

The model is a folder with `model.pt` as its authors publish it; nothing is fetched.
"""

import pathlib

from . import About, files_of, first_line, licence_of, offline, package, torch_on, within_memory
from .. import Failure

ABOUT = About(
    name="moge",
    stream="depth",
    package="git+https://github.com/microsoft/MoGe.git",
    extra="depth",
    licence="MIT (code and weights), Apache-2.0 (its DINOv2)",
    needs="colour images; a folder with MoGe-2's model.pt",
    gives="metres along the camera's axis (x right, y down, z forward), a value a pixel; of models with a head for them normals, too",
    devices=("gpu", "cpu"),
    secs_per_frame=10.0,
    memory_mb=5000,
    version=1,
    weights_from="a folder with model.pt named by --depth-model (Ruicheng/moge-2-vitb-normal and others)",
)
CHECKPOINT = "model.pt"


def fits(folder):
    """Whether a folder holds such a model."""
    return (pathlib.Path(folder) / CHECKPOINT).is_file()


def about_model(folder):
    """The kind of a model, its files' hashes."""
    return "moge-2", files_of(folder, (".pt",), ".pt", "--depth-model")


def licence(folder):
    """The licence of a model, as its card says it."""
    return licence_of(folder, ABOUT.licence)


class Network:
    """A loaded model."""

    def __init__(self, torch, model, device):
        self._torch, self._model, self._device = torch, model, device

    def run(self, images, prompts=None, fov_deg=None):
        """For each RGB image metres along the axis, 0 where there is none, and unit normals in the camera's axes (0 0 0: none).

        `fov_deg`: the images' field of view along their width; else the model guesses it.
        """
        import numpy as np  # Not needed to say what this is.

        torch = self._torch
        with within_memory(torch):
            stacked = np.stack([image.transpose(2, 0, 1) for image in images])
            tensor = torch.tensor(stacked, dtype=torch.float32, device=self._device) / 255
            # Half precision is for GPUs alone.
            out = self._model.infer(tensor, fov_x=fov_deg, use_fp16=self._device == "cuda")
            depth = out["depth"].float().cpu().numpy()
            normal = out["normal"].float().cpu().numpy() if "normal" in out else None
        depth = np.where(np.isfinite(depth), depth, 0)
        return [(depth[i], None if normal is None else normal[i]) for i in range(len(images))]


def load(device="cpu", weights=None):
    """The model of a folder."""
    offline()
    torch, on = torch_on(device, ABOUT)
    module = package("moge.model.v2", ABOUT)
    path = pathlib.Path(weights) / CHECKPOINT
    try:
        model = module.MoGeModel.from_pretrained(str(path))
    except Exception as error:  # Whatever PyTorch has against the file.
        raise Failure(f"{path}: cannot be loaded ({first_line(error)}): MoGe-2's model.pt belongs there; download it again") from error
    if not hasattr(model, "scale_head"):
        raise Failure(f"{path}: a model of MoGe whose depth has no unit: take one of MoGe-2")
    return Network(torch, model.to(on).eval(), on)
