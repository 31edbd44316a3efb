"""Depth: what a model has to be, the files that come out, and the real classes with a tiny random model where torch is there."""

import json
import struct

import numpy as np
import pytest

from paws_perceive import Failure, adapters, depth, exr


def values_of(data):
    """The values of a file as `exr.encoded` writes it, by the table of offsets."""
    assert data[:4] == struct.pack("<i", 20000630)
    at = data.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
    _, _, right, bottom = struct.unpack_from("<4i", data, at)
    table = data.index(b"screenWindowWidth\0") + len(b"screenWindowWidth\0float\0") + 4 + 4 + 1
    out = []
    for row in range(bottom + 1):
        (offset,) = struct.unpack_from("<Q", data, table + 8 * row)
        number, length = struct.unpack_from("<ii", data, offset)
        assert (number, length) == (row, 4 * (right + 1))
        out.append(np.frombuffer(data, "<f4", right + 1, offset + 8))
    return np.array(out)


def test_depth_files_hold_their_values():
    values = np.random.default_rng(0).uniform(0.1, 9, (5, 7)).astype(np.float32)
    assert np.array_equal(values_of(exr.encoded(values)), values)


def model_folder(path, **config):
    path.mkdir(exist_ok=True)
    (path / "config.json").write_text(json.dumps({"model_type": "depth_anything", "depth_estimation_type": "metric", **config}))
    (path / "model.safetensors").write_bytes(b"weights")
    return path


def test_models_without_a_unit_or_without_weights_are_refused(tmp_path):
    module = adapters.of("depth")
    with pytest.raises(Failure, match="config.json.*--depth-model"):
        module.about_model(tmp_path)
    folder = model_folder(tmp_path / "model", depth_estimation_type="relative")
    with pytest.raises(Failure, match="has no unit"):
        module.about_model(folder)
    kind, weights = module.about_model(model_folder(folder))
    assert kind == "depth_anything" and set(weights) == {"config.json", "model.safetensors"}
    (folder / "model.safetensors").unlink()
    with pytest.raises(Failure, match="no .safetensors"):
        module.about_model(folder)


class Network:
    """Sees a plane."""

    def __init__(self):
        self.calls = 0

    def run(self, image):
        self.calls += 1
        if self.calls == 3:
            raise KeyboardInterrupt
        return np.full(image.shape[:2], 2.5, np.float32)


class Cv2:
    @staticmethod
    def imread(path):
        return None if "broken" in path else np.zeros((4, 6, 3), np.uint8)


def test_a_run_that_is_stopped_goes_on_and_a_changed_image_alone_is_made_anew(tmp_path, monkeypatch):
    images, model = tmp_path / "images", model_folder(tmp_path / "model")
    images.mkdir()
    for name in ("a", "b", "broken", "c", "d"):
        (images / f"{name}.jpg").write_text(name)
    network, said = Network(), []
    monkeypatch.setattr(adapters.of("depth"), "load", lambda device, weights: network)
    monkeypatch.setattr(adapters, "package", lambda name, about: Cv2)
    run = lambda: depth.run(images, tmp_path / "depth.json", tmp_path / "cache", model, say=said.append)
    with pytest.raises(KeyboardInterrupt):
        run()
    assert run() == 4 and network.calls == 5 and "broken.jpg" in said[-2]
    folder = json.loads((tmp_path / "depth.json").read_text())["depth"]
    assert (values_of(open(f"{folder}/c/depth.exr", "rb").read()) == 2.5).all()
    run()
    assert network.calls == 5
    (images / "b.jpg").write_text("another")
    run()
    assert network.calls == 6


@pytest.mark.parametrize("kind", ["depth_anything"])
def test_the_real_classes_run_with_a_tiny_random_model(tmp_path, kind):
    """Shapes and units: the largest depth of a metric model is what its config says."""
    torch = pytest.importorskip("torch")
    transformers = pytest.importorskip("transformers")
    torch.manual_seed(0)
    backbone = transformers.Dinov2Config(
        image_size=28, patch_size=14, hidden_size=8, num_hidden_layers=4, num_attention_heads=2,
        out_features=["stage1", "stage2", "stage3", "stage4"], reshape_hidden_states=False, apply_layernorm=True,
    )
    config = transformers.DepthAnythingConfig(
        backbone_config=backbone, patch_size=14, reassemble_hidden_size=8, neck_hidden_sizes=[4, 4, 8, 8], fusion_hidden_size=8,
        head_hidden_size=4, depth_estimation_type="metric", max_depth=20,
    )
    folder = tmp_path / "model"
    transformers.DepthAnythingForDepthEstimation(config).save_pretrained(folder)
    transformers.DPTImageProcessor(size={"height": 28, "width": 28}, ensure_multiple_of=14).save_pretrained(folder)
    module = adapters.of("depth")
    assert module.about_model(folder)[0] == kind
    found = module.load("cpu", folder).run(np.random.default_rng(0).integers(0, 255, (30, 40, 3), dtype=np.uint8))
    assert found.shape == (30, 40) and found.dtype == np.float32 and (found > 0).all() and (found < 20).all()
    if not torch.cuda.is_available():
        with pytest.raises(Failure, match="no GPU.*leave out --gpu"):
            module.load("gpu", folder)
    from safetensors.torch import load_file, save_file

    weights = load_file(folder / "model.safetensors")
    weights.pop(sorted(weights)[0])
    save_file(weights, folder / "model.safetensors", metadata={"format": "pt"})
    with pytest.raises(Failure, match="1 of the model's weights are not in its file"):
        module.load("cpu", folder)
    (folder / "model.safetensors").write_bytes(b"broken")
    with pytest.raises(Failure, match="cannot be loaded"):
        module.load("cpu", folder)
