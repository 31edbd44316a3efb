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
    assert np.array_equal(exr.decoded(exr.encoded(values)), values)
    assert exr.decoded(exr.encoded(values)[:-40]) is None and exr.decoded(b"rubbish") is None


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

    def run(self, images, prompts=None, fov_deg=None):
        self.calls += 1
        if self.calls == 3:
            raise KeyboardInterrupt
        return [(np.full(image.shape[:2], 2.5, np.float32), None) for image in images]


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


def test_a_file_that_is_not_what_its_sums_say_is_named_with_its_place(tmp_path):
    folder = model_folder(tmp_path / "model")
    digest = adapters.of("depth").about_model(folder)[1]["model.safetensors"]
    (folder / "SHA256SUMS").write_text(f"{digest}  model.safetensors\n{'0' * 64} *other.bin\n")
    adapters.of("depth").about_model(folder)
    (folder / "SHA256SUMS").write_text(f"{'1' * 64}  model.safetensors\n")
    with pytest.raises(Failure, match="model.safetensors: is not the file that SHA256SUMS.*put the right model.safetensors into"):
        adapters.of("depth").about_model(folder)
    (folder / "model.safetensors").write_bytes(b"")
    with pytest.raises(Failure, match="0 bytes.*download it again"):
        adapters.of("depth").about_model(folder)


def test_the_licence_of_a_model_is_that_of_its_card(tmp_path):
    module, folder = adapters.of("depth"), model_folder(tmp_path / "model")
    assert "the model's own" in module.licence(folder)
    (folder / "README.md").write_text("---\nlicense: apache-2.0\ntags:\n- depth\n---\n# A model\n")
    assert module.licence(folder) == "apache-2.0"


def a_recording(folder, frames, with_depth=()):
    """A recording of so many frames, its images grey, with a sensor's depth in some of them."""
    cv2 = pytest.importorskip("cv2")
    (folder / "frames").mkdir(parents=True)
    (folder / "depth").mkdir()
    listed = []
    for n in range(frames):
        cv2.imwrite(str(folder / f"frames/{n:06d}.jpg"), np.full((48, 64, 3), 40 + n, np.uint8))
        listed.append({"frame": n, "file": f"frames/{n:06d}.jpg", "timestamp": 0.1 * n, "position": [0, 0, 0], "rotation_wxyz": [1, 0, 0, 0]})
    for n in with_depth:
        sensor = np.full((48, 64), 1500, np.uint16)
        sensor[:, :20] = 0
        sensor[10, 30] = 0
        cv2.imwrite(str(folder / f"depth/{n:06d}.png"), sensor)
    cameras = {"width": 64, "height": 48, "fx": 64, "fy": 64, "cx": 31.5, "cy": 23.5, "frames": listed}
    (folder / "cameras.json").write_text(json.dumps(cameras))
    return folder


class Tilted:
    """Sees a wall at 2.5 m whose normal leans up, with a hole in a corner."""

    def __init__(self):
        self.seen, self.fov, self.prompts = [], None, None

    def run(self, images, prompts=None, fov_deg=None):
        self.seen.append(len(images))
        self.fov, self.prompts = fov_deg, prompts
        depth = np.full(images[0].shape[:2], 2.5, np.float32)
        depth[0, 0], depth[1, 1] = 0, 70.0
        normals = np.zeros((*depth.shape, 3))
        normals[...] = [0.0, -0.6, -0.8]
        normals[0, 0] = 0
        return [(depth, normals) for _ in images]


def test_depth_and_normals_of_chosen_frames_go_into_a_recording(tmp_path, monkeypatch):
    cv2 = pytest.importorskip("cv2")
    folder, model = a_recording(tmp_path / "rec", 6, with_depth=[1]), model_folder(tmp_path / "model")
    network, said = Tilted(), []
    monkeypatch.setattr(adapters.of("depth"), "load", lambda device, weights: network)
    before = (folder / "depth/000001.png").read_bytes()
    count = depth.run_recording(folder, tmp_path / "cache", model, "gpu", say=said.append, frames=[0, 1, 4])
    assert count == 2 and network.seen == [2] and abs(network.fov - 53.13) < 0.01
    assert sorted(p.name for p in (folder / "depth").iterdir()) == ["000000.png", "000001.png", "000004.png"]
    assert (folder / "depth/000001.png").read_bytes() == before
    held = cv2.imread(str(folder / "depth/000004.png"), cv2.IMREAD_UNCHANGED)
    # No value, and what is farther than 16 bits of millimetres, are none.
    assert held.dtype == np.uint16 and held[5, 5] == 2500 and held[0, 0] == 0 and held[1, 1] == 0
    normals = cv2.imread(str(folder / "normals/000004.png"))[:, :, ::-1].astype(float)
    read = (normals[5, 5] - 128) / 127
    assert np.allclose(read, [0, -0.6, -0.8], atol=0.012) and (normals[0, 0] == 0).all()
    made = json.loads((folder / "import.json").read_text())["perceived"][0]
    assert made["stream"] == "depth" and made["frames"] == 2 and made["normals"] == 2 and made["weights"]
    depth.run_recording(folder, tmp_path / "cache", model, "gpu", redo=False, say=said.append, frames=[0, 4])
    assert network.seen == [2]


def test_what_a_sensor_saw_is_refined_by_a_network_that_takes_it(tmp_path, monkeypatch):
    cv2 = pytest.importorskip("cv2")
    folder, model = a_recording(tmp_path / "rec", 3, with_depth=[0, 2]), model_folder(tmp_path / "model", model_type="prompt_depth_anything")
    network = Tilted()
    monkeypatch.setattr(adapters.of("depth"), "load", lambda device, weights: network)
    assert depth.run_recording(folder, tmp_path / "cache", model, say=str) == 2
    assert (network.prompts[0] == 1500).all() and network.prompts[0].shape == (48, 64)
    assert cv2.imread(str(folder / "depth/000002.png"), cv2.IMREAD_UNCHANGED)[5, 5] == 2500
    bare = a_recording(tmp_path / "bare", 2)
    with pytest.raises(Failure, match="refines that of a phone's LiDAR"):
        depth.run_recording(bare, tmp_path / "cache", model, say=str)
    with pytest.raises(Failure, match="give it a recording that has depth"):
        depth.run(bare / "frames", tmp_path / "out.json", tmp_path / "cache", model, say=str)


def test_of_many_images_a_few_evenly_spread_tell_the_scale(tmp_path):
    assert depth.spread(list(range(100)), 4) == [0, 25, 50, 75]
    assert depth.spread([1, 2], 4) == depth.spread([1, 2], None) == [1, 2]


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
    found, normals = module.load("cpu", folder).run([np.random.default_rng(0).integers(0, 255, (30, 40, 3), dtype=np.uint8)])[0]
    assert normals is None
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
