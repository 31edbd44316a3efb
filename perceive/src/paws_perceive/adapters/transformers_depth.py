"""Depth by a metric model of `transformers`: Depth Anything's metric ones, Depth Pro.

The model is a folder as its authors publish it (`config.json`, `model.safetensors`, `preprocessor_config.json`); nothing is fetched.
"""

import json
import pathlib

from .. import Failure
from ..cache import digest_of
from . import About, package

ABOUT = About(
    name="transformers-depth",
    stream="depth",
    package="transformers>=4.57",
    extra="depth",
    licence="the model's own (Depth Anything V2 Metric Small: Apache-2.0)",
    needs="colour images; a model's folder",
    gives="metres along the camera's axis (x right, y down, z forward), a value a pixel of the image",
    devices=("gpu", "cpu"),
    # Of a base model on one core; a GPU takes a twentieth.
    secs_per_frame=5.0,
    memory_mb=4000,
    version=1,
    weights_from="a folder named by --depth-model, as its authors publish it",
)
# Kinds of models that give metres without being told so.
METRIC = ("depth_pro",)


def about_model(folder):
    """The kind of a model, its files' hashes; an error where it is none or gives no metres."""
    folder = pathlib.Path(folder)
    path = folder / "config.json"
    try:
        config = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise Failure(f"{path}: {error}: --depth-model wants a folder with config.json and model.safetensors") from error
    kind = config.get("model_type", "")
    if kind not in METRIC and config.get("depth_estimation_type") != "metric":
        raise Failure(f"{path}: a \"{kind}\" model whose depth has no unit; take a metric one (Depth-Anything-V2-Metric-Indoor, Depth Pro)")
    files = sorted(p for p in folder.iterdir() if p.suffix in (".safetensors", ".json") and p.is_file())
    if not any(p.suffix == ".safetensors" for p in files):
        raise Failure(f"{folder}: has no .safetensors file: download the model's weights into it")
    return kind, {p.name: digest_of(p) for p in files}


class Network:
    """A loaded model."""

    def __init__(self, torch, model, processor, device):
        self._torch, self._model, self._processor, self._device = torch, model, processor, device

    def run(self, image):
        """Metres along the axis for each pixel of an RGB image."""
        inputs = self._processor(images=image, return_tensors="pt").to(self._device)
        try:
            with self._torch.no_grad():
                out = self._model(**inputs)
        except self._torch.OutOfMemoryError as error:
            raise Failure(
                "depth: the GPU's memory is too small for this model: take a smaller one, or leave out --gpu; what is finished stays in "
                "the cache"
            ) from error
        scaled = self._processor.post_process_depth_estimation(out, target_sizes=[image.shape[:2]])
        return scaled[0]["predicted_depth"].float().cpu().numpy()


def load(device="cpu", weights=None):
    """The model of a folder."""
    torch, transformers = package("torch", ABOUT), package("transformers", ABOUT)
    if device == "gpu" and not torch.cuda.is_available():
        raise Failure("depth: no GPU that PyTorch can use is here: leave out --gpu (slow), or install PyTorch for your GPU")
    on = "cuda" if device == "gpu" else "cpu"
    try:
        model, told = transformers.AutoModelForDepthEstimation.from_pretrained(weights, local_files_only=True, output_loading_info=True)
        processor = transformers.AutoImageProcessor.from_pretrained(weights, local_files_only=True)
    except Exception as error:  # Each of the libraries below has an error of its own.
        raise Failure(f"{weights}: cannot be loaded ({(str(error).splitlines() or [repr(error)])[0]}): download the model again") from error
    # What a file lacks would be random numbers.
    if told["missing_keys"]:
        raise Failure(f"{weights}: {len(told['missing_keys'])} of the model's weights are not in its file: it is of another version")
    model = model.to(on).eval()
    return Network(torch, model, processor, on)
