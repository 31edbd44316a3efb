"""Hands by WiLoR, where the package `wilor_mini` is installed and its licences are accepted. Nothing is fetched."""

import pathlib

from .. import Failure
from ..cache import digest_of
from . import About, first_line, offline, package, torch_on, within_memory

ABOUT = About(
    name="wilor",
    stream="hands",
    package="git+https://github.com/warmshao/WiLoR-mini",
    extra="hands",
    licence="CC BY-NC-ND 4.0 (WiLoR), MANO's licence, AGPL-3.0 (its detector)",
    needs="colour images; --weights DIR with a folder pretrained_models; a Python that has the package (--python PATH)",
    gives="21 joints in MANO's order: pixels of the image; a shape about the hand's middle, camera axes (x right, y down, z forward), metres",
    devices=("gpu", "cpu"),
    secs_per_frame=4.0,
    memory_mb=4000,
    version=1,
    weights_from="--weights DIR with pretrained_models/ as warmshao/WiLoR-mini has it; MANO_RIGHT.pkl is MANO's own, after its registration",
    asks=True,
)
FOLDER = "pretrained_models"
FILES = ("wilor_final.ckpt", "detector.pt", "MANO_RIGHT.pkl", "mano_mean_params.npz")
# The network says which hand it is and not how sure it is.
SURE = 0.9
SCORE = 0.8


def digests(weights):
    """SHA-256 of the files of weights."""
    if not weights:
        raise Failure(f"{ABOUT.name}: {ABOUT.weights_from}")
    folder = pathlib.Path(weights) / FOLDER
    missing = [name for name in FILES if not (folder / name).is_file()]
    if missing:
        raise Failure(f"{folder}: {missing[0]} is missing: put it there; {ABOUT.weights_from}")
    return {name: digest_of(folder / name) for name in FILES}


class Network:
    """The loaded pipeline."""

    def __init__(self, torch, pipeline):
        self._torch, self._pipeline = torch, pipeline

    def run(self, image):
        """Hands in a square RGB image: `right` (how likely it is a right hand), `score`, `pixels` (21 x 2), `shape` (21 x 3)."""
        import numpy as np  # Not needed to say what this is.

        with within_memory(self._torch):
            found = self._pipeline.predict(np.ascontiguousarray(image))
        out = []
        for hand in found:
            joints = np.asarray(hand["wilor_preds"]["pred_keypoints_3d"], float).reshape(21, 3)
            # It counts from the pixel's corner.
            pixels = np.asarray(hand["wilor_preds"]["pred_keypoints_2d"], float).reshape(21, 2) - 0.5
            right = SURE if hand["is_right"] > 0.5 else 1 - SURE
            out.append({"right": right, "score": SCORE, "pixels": pixels, "shape": joints - joints.mean(axis=0)})
        return out


def load(device="cpu", weights=None):
    """The pipeline with the given weights."""
    offline()
    torch, on = torch_on(device, ABOUT)
    module = package("wilor_mini.pipelines.wilor_hand_pose3d_estimation_pipeline", ABOUT)
    try:
        pipeline = module.WiLorHandPose3dEstimationPipeline(
            device=torch.device(on), dtype=torch.float32, wilor_pretrained_dir=str(weights), verbose=False
        )
    except Exception as error:  # Whatever the libraries below have against a file.
        raise Failure(f"{weights}: cannot be loaded ({first_line(error)}): {ABOUT.weights_from}") from error
    return Network(torch, pipeline)
