"""The real classes of the networks, with tiny random weights saved and loaded as checkpoints are. Needs PyTorch.

`perceive/run-tests --torch` gets it; elsewhere these are skipped.
"""

import json
import os
import pathlib
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from paws_perceive import Failure, adapters, batches, depth, masks
from test_depth import a_recording, values_of

if os.environ.get("PAWS_PERCEIVE_TORCH") == "1":
    import torch
    import transformers
else:
    torch = pytest.importorskip("torch")
    transformers = pytest.importorskip("transformers")
cv2 = pytest.importorskip("cv2")

SOURCES = pathlib.Path(__file__).parent.parent / "src"


def backbone():
    return transformers.Dinov2Config(
        image_size=28, patch_size=14, hidden_size=8, num_hidden_layers=4, num_attention_heads=2,
        out_features=["stage1", "stage2", "stage3", "stage4"], reshape_hidden_states=False, apply_layernorm=True,
    )


SIZES = {"patch_size": 14, "reassemble_hidden_size": 8, "neck_hidden_sizes": [4, 4, 8, 8], "fusion_hidden_size": 8, "head_hidden_size": 4}


def depth_anything(folder, max_depth=20):
    torch.manual_seed(0)
    config = transformers.DepthAnythingConfig(
        backbone_config=backbone(), depth_estimation_type="metric", max_depth=max_depth, **SIZES
    )
    transformers.DepthAnythingForDepthEstimation(config).save_pretrained(folder)
    transformers.DPTImageProcessor(size={"height": 28, "width": 28}, ensure_multiple_of=14).save_pretrained(folder)
    return folder


def prompt_depth_anything(folder):
    torch.manual_seed(0)
    config = transformers.PromptDepthAnythingConfig(backbone_config=backbone(), depth_estimation_type="metric", max_depth=20, **SIZES)
    transformers.PromptDepthAnythingForDepthEstimation(config).save_pretrained(folder)
    transformers.PromptDepthAnythingImageProcessor(size={"height": 28, "width": 28}, ensure_multiple_of=14).save_pretrained(folder)
    return folder


def depth_pro(folder):
    torch.manual_seed(0)
    encoder = transformers.Dinov2Config(image_size=32, patch_size=8, hidden_size=16, num_hidden_layers=2, num_attention_heads=2)
    config = transformers.DepthProConfig(
        image_model_config=encoder, patch_model_config=encoder, fov_model_config=encoder, fusion_hidden_size=16, patch_size=32,
        initializer_range=0.02, intermediate_hook_ids=[1, 0], intermediate_feature_dims=[8, 8], scaled_images_ratios=[0.5, 1.0],
        scaled_images_overlap_ratios=[0.0, 0.2], scaled_images_feature_dims=[8, 8], use_batch_norm_in_fusion_residual=False,
        use_fov_model=True, num_fov_head_layers=0,
    )
    transformers.DepthProForDepthEstimation(config).save_pretrained(folder)
    transformers.DepthProImageProcessor(size={"height": 64, "width": 64}).save_pretrained(folder)
    return folder


def grounded_sam2(folder):
    torch.manual_seed(0)
    at = folder / "grounding-dino"
    at.mkdir(parents=True)
    pieces = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", ".", "drawer", "fridge", "washing", "machine", *masks.MOVING]
    (at / "vocab.txt").write_text("\n".join(pieces))
    swin = transformers.SwinConfig(
        image_size=64, patch_size=4, embed_dim=8, depths=[1, 1, 1, 1], num_heads=[1, 1, 1, 1], window_size=4,
        out_features=["stage2", "stage3", "stage4"],
    )
    words = transformers.BertConfig(
        vocab_size=len(pieces), hidden_size=16, num_hidden_layers=1, num_attention_heads=2, intermediate_size=16, max_position_embeddings=256
    )
    config = transformers.GroundingDinoConfig(
        backbone_config=swin, text_config=words, num_queries=6, encoder_layers=1, decoder_layers=2, encoder_ffn_dim=16, decoder_ffn_dim=16,
        d_model=32, encoder_attention_heads=2, decoder_attention_heads=2, encoder_n_points=2, decoder_n_points=2,
    )
    transformers.GroundingDinoForObjectDetection(config).save_pretrained(at)
    images = transformers.GroundingDinoImageProcessor(size={"shortest_edge": 64, "longest_edge": 96})
    transformers.GroundingDinoProcessor(images, transformers.BertTokenizerFast(str(at / "vocab.txt"))).save_pretrained(at)
    at = folder / "sam2"
    hiera = transformers.Sam2HieraDetConfig(
        hidden_size=8, num_attention_heads=1, image_size=[64, 64], blocks_per_stage=[1, 1, 1, 1], embed_dim_per_stage=[8, 16, 32, 64],
        num_attention_heads_per_stage=[1, 1, 2, 4], window_size_per_stage=[4, 4, 4, 4], window_positional_embedding_background_size=[4, 4],
        global_attention_blocks=[],
    )
    vision = transformers.Sam2VisionConfig(
        backbone_config=hiera, backbone_channel_list=[64, 32, 16, 8], fpn_hidden_size=16, backbone_feature_sizes=[[16, 16], [8, 8], [4, 4]]
    )
    prompts = transformers.Sam2PromptEncoderConfig(hidden_size=16, image_size=64)
    decoder = transformers.Sam2MaskDecoderConfig(
        hidden_size=16, mlp_dim=16, num_hidden_layers=2, num_attention_heads=2, iou_head_hidden_dim=16
    )
    config = transformers.Sam2Config(vision_config=vision, prompt_encoder_config=prompts, mask_decoder_config=decoder)
    transformers.Sam2Model(config).save_pretrained(at)
    squares = transformers.Sam2ImageProcessor(size={"height": 64, "width": 64}, mask_size={"height": 16, "width": 16})
    transformers.Sam2Processor(squares).save_pretrained(at)
    return folder


def noise(rows=30, columns=40, seed=0):
    return np.random.default_rng(seed).integers(0, 255, (rows, columns, 3), dtype=np.uint8)


def test_a_batch_gives_what_single_images_give(tmp_path):
    network = adapters.of("depth").load("cpu", depth_anything(tmp_path / "model"))
    images = [noise(seed=n) for n in range(3)]
    together = network.run(images)
    for image, (found, normals) in zip(images, together):
        assert found.shape == (30, 40) and normals is None and (found > 0).all() and (found < 20).all()
        assert np.allclose(found, network.run([image])[0][0], atol=1e-4)


def test_metres_are_metres(tmp_path):
    """The same weights told to reach twice as far see everything twice as far."""
    near = adapters.of("depth").load("cpu", depth_anything(tmp_path / "near", 10)).run([noise()])[0][0]
    far = adapters.of("depth").load("cpu", depth_anything(tmp_path / "far", 20)).run([noise()])[0][0]
    assert np.allclose(far, 2 * near, rtol=1e-4)


def test_a_sensors_depth_goes_into_the_network_that_refines_it(tmp_path):
    module, model = adapters.of("depth"), prompt_depth_anything(tmp_path / "model")
    assert module.about_model(model)[0] == module.PROMPTED
    network = module.load("cpu", model)
    slope = np.linspace(1000, 3000, 192 * 256, dtype=np.float32).reshape(192, 256)
    # It answers in the sensor's own range: twice the depth in, twice the depth out.
    found, again = (network.run([noise()], prompts=[k * slope])[0][0] for k in (1, 2))
    assert found.shape == (30, 40) and np.allclose(again, 2 * found, rtol=1e-3)
    folder = a_recording(tmp_path / "rec", 2, with_depth=[1])
    assert depth.run_recording(folder, tmp_path / "cache", model, say=str) == 1


def test_depth_pro_gives_a_value_a_pixel(tmp_path):
    model = depth_pro(tmp_path / "model")
    assert adapters.of("depth").about_model(model)[0] == "depth_pro"
    found = adapters.of("depth").load("cpu", model).run([noise(), noise(seed=1)])
    assert [d.shape for d, _ in found] == [(30, 40)] * 2 and all(np.isfinite(d).all() for d, _ in found)


def test_grounding_dino_and_sam_2_give_masks_of_words(tmp_path, monkeypatch):
    module, weights = adapters.of("masks"), grounded_sam2(tmp_path / "weights")
    monkeypatch.setattr(module, "BOX_SCORE", 0.0)
    network = module.load("cpu", weights)
    words = ["drawer", "washing machine", *masks.MOVING]
    found = network.run(noise(48, 64), words)
    assert len(found) == 6 and {w for w, _, _ in found} <= set(words)
    assert all(mask.shape == (48, 64) and mask.dtype == bool and 0 <= score <= 1 for _, score, mask in found)
    # Questions of a few words at a time find the same boxes again, and their best words.
    monkeypatch.setattr(module, "WORDS", 3)
    assert len(network.run(noise(48, 64), words)) == 18
    folder = a_recording(tmp_path / "rec", 2)
    masks.run(folder, tmp_path / "cache", weights=weights, say=str, words=("drawer", "washing machine"))
    mask = cv2.imread(str(folder / "masks/000001.png"), cv2.IMREAD_UNCHANGED)
    assert mask.shape == (48, 64) and set(np.unique(mask)) <= {0, 1, 2, 255}
    monkeypatch.setattr(module, "BOX_SCORE", 1.1)
    assert network.run(noise(48, 64), words) == []


def test_memory_that_runs_out_halves_the_batch(tmp_path, monkeypatch):
    model, folder = depth_anything(tmp_path / "model"), a_recording(tmp_path / "rec", 7)
    asked, said = [], []
    real = transformers.DepthAnythingForDepthEstimation.forward

    def forward(self, pixel_values, **more):
        asked.append(len(pixel_values))
        if len(pixel_values) > 2:
            raise torch.OutOfMemoryError("CUDA out of memory")
        return real(self, pixel_values, **more)

    monkeypatch.setattr(transformers.DepthAnythingForDepthEstimation, "forward", forward)
    monkeypatch.setattr(batches, "AT_ONCE", {"cpu": 8})
    assert depth.run_recording(folder, tmp_path / "cache", model, say=said.append) == 7
    assert asked == [7, 3, 1, 1, 1, 1, 1, 1, 1] and "going on with" in said[0]

    def never(self, pixel_values, **more):
        raise RuntimeError("[enforce fail at alloc_cpu.cpp:114] err == 0. DefaultCPUAllocator: can't allocate memory")

    monkeypatch.setattr(transformers.DepthAnythingForDepthEstimation, "forward", never)
    with pytest.raises(Failure, match="64 x 48.*--width 32"):
        depth.run_recording(folder, tmp_path / "other", model, redo=True, say=str)


def test_nothing_is_fetched(tmp_path):
    """A model whose folder lacks a file ends at once with the file's name, whatever the network is like."""
    model = depth_anything(tmp_path / "model")
    (model / "preprocessor_config.json").unlink()
    with pytest.raises(Failure, match="model: cannot be loaded.*download the model again"):
        adapters.of("depth").load("cpu", model)
    assert os.environ["HF_HUB_OFFLINE"] == "1"


def test_a_run_that_is_killed_goes_on_where_it_stopped(tmp_path):
    """The whole command on a real checkpoint; frames that were finished are not computed again."""
    model, folder = depth_anything(tmp_path / "model"), a_recording(tmp_path / "rec", 80)
    cache = tmp_path / "cache"
    command = [sys.executable, "-m", "paws_perceive", "depth", str(folder), "--cache", str(cache), "--depth-model", str(model)]
    env = {**os.environ, "PYTHONPATH": str(SOURCES)}
    first = subprocess.Popen(command, env=env, stderr=subprocess.DEVNULL)
    marks = lambda: sorted(cache.glob("depth-*/*/image.sha256"))
    deadline = time.monotonic() + 900
    while time.monotonic() < deadline and first.poll() is None and len(marks()) < 3:
        time.sleep(0.005)
    first.send_signal(signal.SIGKILL)
    first.wait()
    done = {path: path.stat().st_mtime_ns for path in marks()}
    assert 3 <= len(done) < 80
    # Nothing half-written counts: the recording itself is whole without depth.
    assert not list((folder / "depth").iterdir())
    out = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert out.returncode == 0, out.stderr
    assert len(marks()) == 80 and all(path.stat().st_mtime_ns == when for path, when in done.items())
    assert len(list((folder / "depth").iterdir())) == 80
    made = json.loads((folder / "import.json").read_text())["perceived"][0]
    assert made["kind"] == "depth_anything" and made["frames"] == 80


def test_a_folder_of_images_gives_files_that_paws_reads_as_moges(tmp_path):
    folder = a_recording(tmp_path / "rec", 4)
    model, out = depth_anything(tmp_path / "model"), tmp_path / "depth.json"
    assert depth.run(folder / "frames", out, tmp_path / "cache", model, say=str, most=2) == 2
    found = pathlib.Path(json.loads(out.read_text())["depth"])
    assert sorted(p.name for p in found.iterdir()) == ["000000", "000002"]
    assert values_of((found / "000002/depth.exr").read_bytes()).shape == (48, 64)


class TinyMoge(torch.nn.Module):
    """As MoGe-2's `infer` answers: metres, infinity where masked, normals."""

    def __init__(self):
        super().__init__()
        self.scale_head = torch.nn.Parameter(torch.tensor(2.0))

    @classmethod
    def from_pretrained(cls, path):
        model = cls()
        model.load_state_dict(torch.load(path, weights_only=True)["model"])
        return model

    def infer(self, image, fov_x=None, use_fp16=True):
        assert image.dtype == torch.float32 and image.max() <= 1 and not use_fp16
        depth = self.scale_head.detach() * torch.ones(len(image), *image.shape[-2:]) * (1 if fov_x is None else fov_x / 50)
        depth[:, 0, 0] = torch.inf
        normal = torch.zeros(*depth.shape, 3)
        normal[..., 2] = -1
        return {"depth": depth, "normal": normal}


def test_moges_adapter_takes_its_checkpoint_and_gives_depth_and_normals(tmp_path, monkeypatch):
    """The package is its authors' own and in no registry: a stand-in of its interface."""
    import types

    fake = types.ModuleType("moge.model.v2")
    fake.MoGeModel = TinyMoge
    for name in ("moge", "moge.model", "moge.model.v2"):
        monkeypatch.setitem(sys.modules, name, fake)
    model = tmp_path / "model"
    model.mkdir()
    torch.save({"model": TinyMoge().state_dict()}, model / "model.pt")
    folder = a_recording(tmp_path / "rec", 2)
    assert depth.run_recording(folder, tmp_path / "cache", model, say=str) == 2
    held = cv2.imread(str(folder / "depth/000001.png"), cv2.IMREAD_UNCHANGED)
    # The recording's camera told the field of view, 53.13 degrees.
    assert held[5, 5] == round(2000 * 53.13 / 50) and held[0, 0] == 0
    normals = cv2.imread(str(folder / "normals/000001.png"))[:, :, ::-1].astype(int)
    assert normals[5, 5].tolist() == [128, 128, 1]
    (model / "model.pt").write_bytes(b"broken")
    with pytest.raises(Failure, match="model.pt: cannot be loaded.*MoGe-2's model.pt belongs there"):
        depth.run_recording(folder, tmp_path / "cache", model, redo=True, say=str)
