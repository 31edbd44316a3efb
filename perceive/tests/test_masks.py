"""Masks: hands by their joints, furniture by two networks that are told what they see."""

import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

from paws_perceive import Failure, adapters, batches, masks
from paws_perceive.geometry import Camera
from test_depth import a_recording

cv2 = pytest.importorskip("cv2")
CAMERA = Camera(64.0, 64.0, 31.5, 23.5)
FRAME = {"position": [0.0, 0.0, 0.0], "rotation_wxyz": [1, 0, 0, 0]}


def a_hand(z=0.5):
    """21 joints in a square of 10 cm before the camera."""
    x, y = np.meshgrid(np.linspace(-0.05, 0.05, 7), np.linspace(-0.05, 0.05, 3))
    return np.stack([x.ravel(), y.ravel(), np.full(21, z)], axis=1)


def test_a_hand_is_its_joints_hull_wider_by_half_a_hand():
    mask = masks.hand_mask(a_hand(), FRAME, CAMERA, (48, 64), cv2)
    half = (0.05 + masks.HALF_WIDTH_M) / 0.5 * 64
    columns, rows = np.where(mask.any(axis=0))[0], np.where(mask.any(axis=1))[0]
    assert abs(columns[0] - (31.5 - half)) <= 1.5 and abs(columns[-1] - (31.5 + half)) <= 1.5
    assert abs(rows[0] - (23.5 - half)) <= 1.5 and abs(rows[-1] - (23.5 + half)) <= 1.5
    # Round at its corners.
    assert not mask[rows[0], columns[0]] and mask[23, 31]


def test_what_is_behind_the_camera_or_far_outside_hides_nothing_here():
    assert not masks.hand_mask(a_hand(-0.5), FRAME, CAMERA, (48, 64), cv2).any()
    assert not masks.hand_mask(a_hand() + [30.0, 0, 0], FRAME, CAMERA, (48, 64), cv2).any()
    elsewhere = {"position": [0.0, 0.0, 1.0], "rotation_wxyz": [0, 0, 1, 0]}
    assert masks.hand_mask(a_hand(), elsewhere, CAMERA, (48, 64), cv2).any()


def test_the_surest_is_on_top_and_what_moves_over_all():
    whole, left = np.ones((2, 4), bool), np.array([[True, True, False, False]] * 2)
    found = [("drawer", 0.9, left), ("cabinet", 0.5, whole), ("person", 0.4, np.array([[True] + [False] * 3] * 2))]
    classes = masks.classes_of(["Cabinet", "drawer ", "", "person", "cabinet"])
    assert classes == {"cabinet": 1, "drawer": 2}
    assert masks.composed(found, classes, (2, 4)).tolist() == [[255, 2, 1, 1]] * 2


class Network:
    """Sees a drawer in the left half, and somebody in the last column."""

    calls = 0

    def run(self, image, words):
        type(self).calls += 1
        drawer, person = np.zeros((2, *image.shape[:2]), bool)
        drawer[:, : image.shape[1] // 2] = True
        person[:, -1] = True
        return [("drawer", 0.8, drawer), ("person", 0.7, person)]


def with_hands(folder, frames):
    hands = {"frames": [{"frame": n, "hands": [{"side": "right", "joints_world": a_hand().tolist()}]} for n in frames]}
    (folder / "hands.json").write_text(json.dumps(hands))


def weights_in(folder):
    for name in ("grounding-dino", "sam2"):
        (folder / name).mkdir(parents=True)
        (folder / name / "config.json").write_text("{}")
        (folder / name / "model.safetensors").write_text(name)
    return folder


def read(path):
    return cv2.imread(str(path), cv2.IMREAD_UNCHANGED)


def test_without_weights_hands_are_masked_and_masks_that_are_there_stay(tmp_path):
    folder = a_recording(tmp_path / "rec", 3)
    with pytest.raises(Failure, match="no hands.*grounding-dino"):
        masks.run(folder, tmp_path / "cache", say=str)
    with_hands(folder, [1, 2])
    (folder / "masks").mkdir()
    cv2.imwrite(str(folder / "masks/000001.png"), np.full((48, 64), 7, np.uint8))
    (folder / "labels.json").write_text('{"7": "oven"}')
    assert masks.run(folder, tmp_path / "cache", say=str, frames=[0, 1]) == 1
    assert not read(folder / "masks/000000.png").any() and not (folder / "masks/000002.png").exists()
    mask = read(folder / "masks/000001.png")
    assert mask[0, 0] == 7 and mask[23, 31] == 255 and "oven" in (folder / "labels.json").read_text()
    made = json.loads((folder / "import.json").read_text())["perceived"][0]
    assert made["stream"] == "masks" and made["adapter"] == "hand-joints"


def test_the_command_takes_frames_as_paws_frames_writes_them(tmp_path):
    folder = a_recording(tmp_path / "rec", 3)
    with_hands(folder, [0, 1, 2])
    (tmp_path / "frames.json").write_text(json.dumps({"recording": "rec", "frames": [{"frame": 2, "file": "x", "why": ["open"]}]}))
    command = [sys.executable, "-m", "paws_perceive", "masks", str(folder), "--cache", str(tmp_path / "cache"), "--words", "drawer,fridge"]
    env = {**os.environ, "PYTHONPATH": str(pathlib.Path(__file__).parent.parent / "src")}
    run = lambda *more: subprocess.run([*command, *more], env=env, capture_output=True, text=True, check=False)
    out = run("--frames", str(tmp_path / "frames.json"))
    assert out.returncode == 0 and "1 of 1 frames show hands" in out.stderr, out.stderr
    assert [p.name for p in (folder / "masks").iterdir()] == ["000002.png"]
    (tmp_path / "frames.json").write_text('["a"]')
    out = run("--frames", str(tmp_path / "frames.json"))
    assert out.returncode == 2 and "paws frames RECORDING --json" in out.stderr, out.stderr


def test_furniture_and_hands_are_kept_by_image(tmp_path, monkeypatch):
    folder, weights = a_recording(tmp_path / "rec", 3), weights_in(tmp_path / "weights")
    with_hands(folder, [0])
    monkeypatch.setattr(adapters.of("masks"), "load", lambda device, weights: Network())
    Network.calls = 0
    run = lambda **more: masks.run(folder, tmp_path / "cache", weights=weights, say=str, words=("drawer", "fridge"), **more)
    assert run(frames=[0, 1]) == 2
    mask = read(folder / "masks/000000.png")
    assert mask[0, 0] == 1 and mask[23, 31] == 255 and mask[0, -1] == 255 and mask[0, 40] == 0
    assert json.loads((folder / "labels.json").read_text()) == {"1": "drawer"}
    made = json.loads((folder / "import.json").read_text())["perceived"][0]
    assert made["licence"].startswith("Apache-2.0") and set(made["weights"]) == {
        f"{n}/{f}" for n in ("grounding-dino", "sam2") for f in ("config.json", "model.safetensors")
    }
    # Hands may change: they are no part of what is kept.
    with_hands(folder, [1])
    run()
    assert Network.calls == 3 and read(folder / "masks/000000.png")[23, 31] == 1 and read(folder / "masks/000001.png")[23, 31] == 255
    run(redo=True)
    assert Network.calls == 6
    with pytest.raises(Failure, match="no words"):
        masks.run(folder, tmp_path / "cache", weights=weights, say=str)


def test_an_image_that_does_not_fit_is_told(tmp_path, monkeypatch):
    folder, weights = a_recording(tmp_path / "rec", 1), weights_in(tmp_path / "weights")

    class Small:
        def run(self, image, words):
            raise batches.TooLarge

    monkeypatch.setattr(adapters.of("masks"), "load", lambda device, weights: Small())
    with pytest.raises(Failure, match="64 x 48.*--width 32"):
        masks.run(folder, tmp_path / "cache", weights=weights, say=str, words=("drawer",))


def test_tokens_belong_to_the_word_between_two_full_stops():
    module = adapters.of("masks")
    # [CLS] washing machine . drawer . [SEP] [PAD]
    assert module.spans([2, 8, 9, 5, 7, 5, 3, 0], 5, {0, 2, 3}, 2) == [[1, 2], [4]]
