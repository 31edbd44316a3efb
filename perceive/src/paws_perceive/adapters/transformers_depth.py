"""Depth by a metric model of `transformers`: Depth Anything's metric ones, Prompt Depth Anything, Depth Pro.

The model is a folder as its authors publish it (`config.json`, `model.safetensors`, `preprocessor_config.json`); nothing is fetched.
"""

import json
import pathlib

from .. import Failure
from . import About, files_of, from_folder, licence_of, loaded, offline, package, torch_on, within_memory

ABOUT = About(
    name="transformers-depth",
    stream="depth",
    package="transformers>=4.57",
    extra="depth",
    licence="the model's own (Depth Anything V2 Metric Small, Prompt Depth Anything: Apache-2.0; Depth Pro: Apple's, for research)",
    needs="colour images; a model's folder; Prompt Depth Anything: the depth of the phone's LiDAR, too",
    gives="metres along the camera's axis (x right, y down, z forward), a value a pixel of the image",
    devices=("gpu", "cpu"),
    # Of a base model on one core; a GPU takes a twentieth.
    secs_per_frame=5.0,
    memory_mb=4000,
    version=1,
    weights_from="a folder named by --depth-model, as its authors publish it",
)
# The kind of model that refines a sensor's depth.
PROMPTED = "prompt_depth_anything"
# Kinds of models that give metres without being told so.
METRIC = ("depth_pro", PROMPTED)


def fits(folder):
    """Whether a folder holds such a model."""
    return (pathlib.Path(folder) / "config.json").is_file()


def about_model(folder):
    """The kind of a model, its files' hashes; an error where it is none or gives no metres."""
    folder = pathlib.Path(folder)
    path = folder / "config.json"
    try:
        config = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise Failure(
            f"{path}: {error}: --depth-model wants a folder with config.json and model.safetensors, or with MoGe's model.pt"
        ) from error
    kind = config.get("model_type", "") if isinstance(config, dict) else ""
    if kind not in METRIC and config.get("depth_estimation_type") != "metric":
        raise Failure(f"{path}: a \"{kind}\" model whose depth has no unit; take a metric one (Depth-Anything-V2-Metric-Indoor, Depth Pro)")
    return kind, files_of(folder, (".safetensors", ".json"), ".safetensors", "--depth-model")


def licence(folder):
    """The licence of a model, as its card says it."""
    return licence_of(folder, ABOUT.licence)


class Network:
    """A loaded model."""

    def __init__(self, torch, model, processor, device):
        self._torch, self._model, self._processor, self._device = torch, model, processor, device

    def run(self, images, prompts=None, fov_deg=None):
        """For each RGB image metres along the axis for each pixel, and no normals.

        `prompts`: for each image a sensor's depth, millimetres, of any size and without holes, for models that refine one.
        `fov_deg`: passed over, as these models find it themselves or have learnt it.
        """
        given = {"prompt_depth": prompts} if prompts else {}
        with within_memory(self._torch):
            inputs = self._processor(images=images, return_tensors="pt", **given).to(self._device)
            with self._torch.no_grad():
                out = self._model(**inputs)
            sizes = [image.shape[:2] for image in images]
            scaled = self._processor.post_process_depth_estimation(out, target_sizes=sizes)
            return [(one["predicted_depth"].float().cpu().numpy(), None) for one in scaled]


def load(device="cpu", weights=None):
    """The model of a folder."""
    offline()
    torch, on = torch_on(device, ABOUT)
    transformers = package("transformers", ABOUT)
    model = loaded(transformers.AutoModelForDepthEstimation, weights)
    processor = from_folder(transformers.AutoImageProcessor, weights)
    return Network(torch, model.to(on).eval(), processor, on)
