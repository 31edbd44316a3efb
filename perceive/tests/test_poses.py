"""Poses of networks as COLMAP's files, and videos as phones make them."""

import json
import pathlib
import sys
import types

import numpy as np
import pytest

from paws_perceive import Failure, adapters, colmap_text, poses
from paws_perceive.geometry import turn_of
from test_streams import fake_ffmpeg


@pytest.mark.parametrize("seed", range(12))
def test_quaternions_are_those_of_their_rotations(seed):
    wanted = np.random.default_rng(seed).normal(size=4)
    # Half turns, too.
    wanted[seed % 4] *= 1e3
    wanted /= np.linalg.norm(wanted) * (1 if wanted[0] > 0 else -1)
    assert np.allclose(colmap_text.quaternion(turn_of(wanted)), wanted, atol=1e-9)


def test_a_model_is_written_as_colmap_writes_it(tmp_path):
    matrix = colmap_text.resized([[100, 0, 49.5], [0, 100, 39.5], [0, 0, 1]], (100, 80), (200, 160))
    assert np.allclose(matrix, [[200, 0, 99.5], [0, 200, 79.5], [0, 0, 1]])
    colmap_text.write(tmp_path, (200, 160), matrix, ["a.jpg"], [np.hstack([np.eye(3), [[1], [2], [3]]])])
    assert (tmp_path / "cameras.txt").read_text() == "1 PINHOLE 200 160 200 200 100 80\n"
    assert "1 1 0 0 0 1 2 3 1 a.jpg\n\n" in (tmp_path / "images.txt").read_text()


def model_in(folder, **config):
    folder.mkdir(parents=True)
    (folder / "config.json").write_text(json.dumps(config))
    (folder / "model.safetensors").write_text("weights")


def test_licences_that_forbid_are_asked_for_and_others_are_not(tmp_path):
    module = adapters.of("poses", "depth-anything-3")
    model_in(tmp_path / "small/da3", model_name="da3-base")
    model_in(tmp_path / "large/da3", model_name="da3nested-giant-large")
    assert module.licence(tmp_path / "small") == "Apache-2.0" and module.licence(tmp_path / "large") == "CC BY-NC 4.0"
    images = tmp_path / "images"
    images.mkdir()
    run = lambda weights, **more: poses.run(images, tmp_path / "o", tmp_path / "c", say=str, by="depth-anything-3", weights=weights, **more)
    with pytest.raises(Failure, match="CC BY-NC 4.0.*--accept-licence depth-anything-3"):
        run(tmp_path / "large")
    (images / "a.jpg").write_text("1")
    with pytest.raises(Failure, match="wants a GPU"):
        run(tmp_path / "large", accepted=("depth-anything-3",))
    with pytest.raises(Failure, match="wants a GPU"):
        run(tmp_path / "small")
    with pytest.raises(Failure, match="--weights DIR with da3"):
        run(None)


def test_hands_under_restricted_licences_are_asked_for(tmp_path):
    from paws_perceive import hands
    from test_depth import a_recording

    pytest.importorskip("cv2")
    folder = a_recording(tmp_path / "rec", 1)
    with pytest.raises(Failure, match="MANO.*--accept-licence wilor"):
        hands.run(folder, tmp_path / "cache", say=str, by="wilor")
    with pytest.raises(Failure, match="pretrained_models: wilor_final.ckpt is missing"):
        hands.run(folder, tmp_path / "cache", say=str, by="wilor", weights=tmp_path, accepted=("wilor",))
    for name, word in (("hamer", "wilor=MESHES"), ("hawor", "examples/import/hawor.py"), ("other", "known are mediapipe-hands")):
        with pytest.raises(Failure, match=word):
            adapters.of("hands", name)


class Tensor:
    """As much of PyTorch's as the adapters ask."""

    def __init__(self, values):
        self.values = np.asarray(values, float)
        self.shape = self.values.shape

    def float(self):
        return self

    def cpu(self):
        return self.values


def gpu(monkeypatch):
    """A PyTorch that says it has a GPU."""
    torch = types.ModuleType("torch")
    torch.cuda = types.SimpleNamespace(is_available=lambda: True, empty_cache=lambda: None)
    torch.OutOfMemoryError = type("OutOfMemoryError", (RuntimeError,), {})
    monkeypatch.setitem(sys.modules, "torch", torch)
    return torch


def images_in(folder, count):
    cv2 = pytest.importorskip("cv2")
    folder.mkdir()
    for n in range(count):
        cv2.imwrite(str(folder / f"{n:06d}.jpg"), np.zeros((80, 100, 3), np.uint8))
    return folder


def test_mapanythings_poses_are_metric_and_turned_round(tmp_path, monkeypatch):
    images = images_in(tmp_path / "images", 3)
    gpu(monkeypatch)
    model_in(tmp_path / "weights/mapanything")
    (tmp_path / "weights/mapanything/README.md").write_text("---\nlicense: apache-2.0\n---\n")
    pose = np.eye(4)
    pose[:3, 3] = [1, 2, 3]
    seen = {"camera_poses": Tensor(pose[None]), "intrinsics": Tensor([[[50, 0, 24.5], [0, 50, 19.5], [0, 0, 1]]]), "depth_z": Tensor(np.ones((1, 40, 50, 1)))}

    class Model:
        def infer(self, views, memory_efficient_inference):
            return [seen for _ in views]

        to = lambda self, device: self
        eval = lambda self: self

    models, pictures = types.ModuleType("mapanything.models"), types.ModuleType("mapanything.utils.image")
    models.MapAnything = types.SimpleNamespace(from_pretrained=lambda path, local_files_only: Model())
    pictures.load_images = lambda paths: paths
    for name, module in {"mapanything": models, "mapanything.models": models, "mapanything.utils": models, "mapanything.utils.image": pictures}.items():
        monkeypatch.setitem(sys.modules, name, module)
    out = tmp_path / "poses.json"
    count = poses.run(images, out, tmp_path / "cache", "gpu", say=str, by="mapanything", weights=tmp_path / "weights")
    told = json.loads(out.read_text())
    assert count == 3 and told["format"] == "mapanything" and told["made"]["licence"] == "apache-2.0"
    folder = pathlib.Path(told["model"])
    assert (folder / "cameras.txt").read_text() == "1 PINHOLE 100 80 100 100 50 40\n"
    assert "1 1 0 0 0 -1 -2 -3 1 000000.jpg" in (folder / "images.txt").read_text()


def test_more_images_than_the_gpu_holds_are_told(tmp_path, monkeypatch):
    images = images_in(tmp_path / "images", 2)
    torch = gpu(monkeypatch)
    model_in(tmp_path / "weights/da3", model_name="da3-small")

    def full(*_, **__):
        raise torch.OutOfMemoryError("CUDA out of memory")

    api = types.ModuleType("depth_anything_3.api")
    model = types.SimpleNamespace(inference=full, to=lambda device: model)
    api.DepthAnything3 = types.SimpleNamespace(from_pretrained=lambda path, local_files_only: model)
    monkeypatch.setitem(sys.modules, "depth_anything_3", api)
    monkeypatch.setitem(sys.modules, "depth_anything_3.api", api)
    with pytest.raises(Failure, match=r"does not hold 2 images at once: take fewer \(--fps 5\)"):
        poses.run(images, tmp_path / "o", tmp_path / "cache", "gpu", say=str, by="depth-anything-3", weights=tmp_path / "weights")


FILTERS = " ... zscale  V->V  x\\n ... tonemap  V->V  x\\n"


def video_tool(tmp_path, curve, filters, ends="", pictures=3):
    """An ffmpeg that knows a video of a curve and has some filters; it notes what it is called with."""
    return fake_ffmpeg(
        tmp_path,
        "open(sys.argv[0] + '.log', 'a').write(' '.join(sys.argv[1:]) + '\\n')\n"
        f"if '-filters' in sys.argv: sys.stdout.write('{filters}'); sys.exit(0)\n"
        f"if '-vf' not in sys.argv: sys.exit('  Stream #0:0: Video: hevc, yuv420p10le(tv, bt2020nc/bt2020/{curve}), 1920x1080')\n"
        f"for n in range({pictures}): pathlib.Path(sys.argv[-1] % n).write_bytes(b'x')\n{ends}",
    )


@pytest.mark.parametrize("curve, filters, mapped, said", [
    ("bt709", FILTERS, False, None),
    ("arib-std-b67", FILTERS, True, "mapped to that of common video"),
    ("smpte2084", " ... scale V->V x", False, "pictures are pale"),
])
def test_hdr_is_mapped_or_told(tmp_path, curve, filters, mapped, said):
    video, heard = tmp_path / "walk.mov", []
    video.write_bytes(b"a video")
    tool = video_tool(tmp_path, curve, filters)
    poses.images_of(video, tmp_path, 10, say=heard.append, ffmpeg=tool)
    call = pathlib.Path(tool + ".log").read_text().splitlines()[-1]
    assert ("tonemap=" in call) == mapped and "fps=10:start_time=0," in call
    assert any(said in h for h in heard) if said else len(heard) == 1


@pytest.mark.parametrize("ends", ["sys.exit('Invalid data found')", "sys.stderr.write('partial file')"])
def test_a_video_that_is_cut_off_gives_what_it_has(tmp_path, ends):
    video, heard = tmp_path / "walk.mp4", []
    video.write_bytes(b"a video")
    tool = video_tool(tmp_path, "bt709", "", ends, pictures=20)
    folder, _ = poses.images_of(video, tmp_path, 10, say=heard.append, ffmpeg=tool)
    assert len(list(folder.glob("*.jpg"))) == 20 and any("2.0 s of it are taken" in h for h in heard)


def test_a_disk_that_fills_up_while_decoding_leaves_no_half(tmp_path):
    video = tmp_path / "walk.mp4"
    video.write_bytes(b"a video")
    tool = video_tool(tmp_path, "bt709", "", "sys.exit('No space left on device')")
    with pytest.raises(Failure, match="the disk is full"):
        poses.images_of(video, tmp_path, 10, say=str, ffmpeg=tool)
    assert not [p for p in tmp_path.iterdir() if "images-" in p.name]


def test_blur_that_breaks_the_poses_is_told_from_bare_walls(tmp_path):
    cv2 = pytest.importorskip("cv2")
    folder, model = tmp_path / "images", tmp_path / "0"
    folder.mkdir()
    model.mkdir()
    picture = np.random.default_rng(0).integers(0, 255, (60, 80, 3), dtype=np.uint8)
    lines = ["# a", "# b"]
    for n in range(10):
        seen = picture if n < 4 else cv2.GaussianBlur(picture, (0, 0), 4)
        cv2.imwrite(str(folder / f"{n:06d}.jpg"), seen)
        lines += [f"{n} 1 0 0 0 0 0 0 1 {n:06d}.jpg", "1 2 3"] if n < 4 else []
    (model / "images.txt").write_text("\n".join(lines))
    assert "blurred" in poses.why_few(folder, model) and "more slowly" in poses.why_few(folder, model)
    for n in range(10):
        cv2.imwrite(str(folder / f"{n:06d}.jpg"), picture)
    assert "too little in common" in poses.why_few(folder, model)
