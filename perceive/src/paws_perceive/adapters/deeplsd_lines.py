"""Line segments by DeepLSD, where its authors' package `deeplsd` is installed."""

import pathlib

from .. import Failure
from . import About, files_of, first_line, offline, package, torch_on, within_memory

CHECKPOINT = "deeplsd_md.tar"
# As its authors' example has them.
CONFIG = {
    "detect_lines": True,
    "line_detection_params": {"merge": False, "filtering": True, "grad_thresh": 3, "grad_nfa": True},
}

ABOUT = About(
    name="deeplsd",
    stream="lines",
    package="git+https://github.com/cvg/DeepLSD.git",
    extra="lines",
    licence="MIT",
    needs="grey images; --weights DIR with deeplsd_md.tar in it; a Python that has the package (--python PATH)",
    gives="ends of line segments, pixels",
    devices=("gpu", "cpu"),
    secs_per_frame=3.0,
    memory_mb=3000,
    version=1,
    weights_from=f"--weights DIR with {CHECKPOINT} as the authors publish it",
)


def digests(weights):
    """SHA-256 of the checkpoint."""
    if not weights or not (pathlib.Path(weights) / CHECKPOINT).is_file():
        raise Failure(f"{weights or ABOUT.name}: {CHECKPOINT} is missing: {ABOUT.weights_from}")
    return {CHECKPOINT: files_of(weights, (".tar",), ".tar", "--weights")[CHECKPOINT]}


class Network:
    """A loaded detector."""

    def __init__(self, torch, model, device):
        self._torch, self._model, self._device = torch, model, device

    def run(self, grey):
        """Segments of a grey image, n x 2 x 2: two ends of (column, row), pixels."""
        with within_memory(self._torch), self._torch.no_grad():
            held = self._torch.tensor(grey, dtype=self._torch.float, device=self._device)[None, None] / 255
            return self._model({"image": held})["lines"][0]


def load(device="cpu", weights=None):
    """The detector."""
    offline()
    torch, on = torch_on(device, ABOUT)
    module = package("deeplsd.models.deeplsd_inference", ABOUT)
    path = pathlib.Path(weights) / CHECKPOINT
    try:
        held = torch.load(path, map_location="cpu", weights_only=True)
        model = module.DeepLSD(CONFIG)
        model.load_state_dict(held["model"])
    except Exception as error:  # Whatever PyTorch has against the file.
        raise Failure(f"{path}: cannot be loaded ({first_line(error)}): download it again") from error
    return Network(torch, model.to(on).eval(), on)
