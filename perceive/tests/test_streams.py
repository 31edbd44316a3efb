"""A stream from its folder to its folder, with a network that is told what it sees."""

import json
import pathlib
import sys

import numpy as np
import pytest

from paws_perceive import Failure, adapters, hands, poses, recording
from test_geometry import CAMERA, hand

FRAMES = 12


class Cv2:
    """Reads what these tests write."""

    IMREAD_UNCHANGED = -1

    @staticmethod
    def imread(path, flags=1):
        try:
            return np.load(path)
        except (OSError, ValueError):
            return None


class Network:
    """Sees one hand in every view, where `truth` has it."""

    def __init__(self, truth):
        self.truth, self.calls = truth, 0

    def run(self, image):
        self.calls += 1
        number = int(image.max()) - 1
        if number < 0 or self.truth[number] is None:
            return []
        left_top = np.array([0, 0])
        pixels = CAMERA.project(self.truth[number]) - left_top
        return [{"right": 0.9, "score": 0.9, "pixels": pixels, "shape": self.truth[number] - self.truth[number].mean(axis=0)}]


@pytest.fixture
def made(tmp_path, monkeypatch):
    """A recording with one hand that moves, and the network that sees it in the whole picture."""
    folder = tmp_path / "rec"
    (folder / "frames").mkdir(parents=True)
    frames = []
    truth = []
    for n in range(FRAMES):
        with open(folder / "frames" / f"{n:06d}.jpg", "wb") as file:
            np.save(file, np.full((480, 640, 3), n + 1, np.uint8))
        frames.append(
            {"frame": n, "file": f"frames/{n:06d}.jpg", "timestamp": 0.1 * n, "position": [1.0, 2.0, 3.0], "rotation_wxyz": [1, 0, 0, 0]}
        )
        truth.append(None if n == FRAMES - 1 else hand() + [0.01 * n, 0.05, 0.5])
    cameras = {"width": 640, "height": 480, "fx": 500, "fy": 500, "cx": 319.5, "cy": 239.5, "frames": frames}
    (folder / "cameras.json").write_text(json.dumps(cameras))
    network = Network(truth)
    module = adapters.of("hands")
    monkeypatch.setattr(module, "load", lambda device, weights: network)
    monkeypatch.setattr(adapters, "package", lambda name, about: Cv2)
    monkeypatch.setattr(hands, "views", lambda width, height: [(0, 0, 640)])
    monkeypatch.setattr(hands.tracks, "gaps", lambda frames, times, tracks: [[] for _ in frames])
    return folder, network, truth


def test_hands_stand_in_the_world_and_their_origin_is_kept(made, tmp_path):
    folder, network, truth = made
    (folder / "import.json").write_text(json.dumps({"missing": [{"what": "hands"}, {"what": "clips"}], "sources": []}))
    said = []
    assert hands.run(folder, tmp_path / "cache", say=said.append) == FRAMES - 1
    written = json.loads((folder / "hands.json").read_text())["frames"]
    assert [f["frame"] for f in written] == list(range(FRAMES - 1))
    one = written[3]["hands"][0]
    assert one["side"] == "right" and one["distance_by"] == "size" and one["std_along_ray_m"] > 0.02
    assert np.abs(np.array(one["joints_world"]) - (truth[3] + [1, 2, 3])).max() < 2e-3
    known = json.loads((folder / "import.json").read_text())
    assert known["missing"] == [{"what": "clips"}]
    assert known["perceived"][0]["licence"] == "Apache-2.0" and known["perceived"][0]["weights"]
    assert "11 in 11 of 12 frames" in said[-1]


def test_a_second_run_asks_nothing_and_writes_the_same(made, tmp_path):
    folder, network, _ = made
    hands.run(folder, tmp_path / "cache", say=str)
    first, calls = (folder / "hands.json").read_bytes(), network.calls
    hands.run(folder, tmp_path / "cache", say=str)
    assert (folder / "hands.json").read_bytes() == first and network.calls == calls
    hands.run(folder, tmp_path / "cache", redo=True, say=str)
    assert network.calls == 2 * calls


def test_a_broken_image_costs_itself_and_no_hand_is_an_answer(made, tmp_path):
    folder, network, truth = made
    (folder / "frames/000004.jpg").write_bytes(b"broken")
    said = []
    assert hands.run(folder, tmp_path / "cache", say=said.append) == FRAMES - 2
    assert "1 images cannot be read" in said[0]
    network.truth = [None] * FRAMES
    assert hands.run(folder, tmp_path / "other", say=said.append) == 0
    assert json.loads((folder / "hands.json").read_text())["frames"] == []


def test_a_hand_that_never_moves_is_told(made, tmp_path):
    folder, network, _ = made
    network.truth = [hand() + [0.0, 0.05, 0.5]] * FRAMES
    said = []
    assert hands.run(folder, tmp_path / "cache", say=said.append) == FRAMES
    assert any("hardly moves in the picture" in s for s in said)
    network.truth = [hand() + [0.05 * n - 0.3, 0.05, 0.5] for n in range(FRAMES)]
    said.clear()
    hands.run(folder, tmp_path / "other", say=said.append)
    assert not any("hardly moves" in s for s in said)


def test_files_outside_of_the_recording_are_not_read(made):
    folder, _, _ = made
    cameras = json.loads((folder / "cameras.json").read_text())
    (folder.parent / "secret.jpg").write_bytes(b"1")
    cameras["frames"][0]["file"] = "../secret.jpg"
    (folder / "cameras.json").write_text(json.dumps(cameras))
    opened = recording.Recording(folder)
    assert opened.image_path(opened.frames[0]) is None and opened.image_path(opened.frames[1]) is not None


@pytest.mark.parametrize("text, word", [("{", "no JSON"), ("{}", "KeyError"), ('{"fx":1,"fy":1,"cx":1,"cy":1,"frames":[{}]}', "frame")])
def test_a_broken_list_of_cameras_is_named(tmp_path, text, word):
    (tmp_path / "cameras.json").write_text(text)
    with pytest.raises(Failure, match=word) as failure:
        recording.Recording(tmp_path)
    assert "cameras.json" in str(failure.value)


def fake_ffmpeg(tmp_path, body):
    """A program in ffmpeg's place."""
    path = tmp_path / "ffmpeg"
    path.write_text(f"#!{sys.executable}\nimport sys, pathlib\n{body}\n")
    path.chmod(0o755)
    return str(path)


def test_videos_that_cannot_be_read_are_told(tmp_path):
    video = tmp_path / "walk.mp4"
    with pytest.raises(Failure, match="walk.mp4: No such file"):
        poses.images_of(video, tmp_path)
    video.write_bytes(b"")
    with pytest.raises(Failure, match="0 bytes"):
        poses.images_of(video, tmp_path)
    video.write_bytes(b"rubbish")
    with pytest.raises(Failure, match="needs ffmpeg"):
        poses.images_of(video, tmp_path, say=str, ffmpeg=str(tmp_path / "nowhere"))
    broken = fake_ffmpeg(tmp_path, "sys.exit('moov atom not found')")
    with pytest.raises(Failure, match="moov atom not found"):
        poses.images_of(video, tmp_path, say=str, ffmpeg=broken)
    assert not [p for p in tmp_path.iterdir() if "images-" in p.name]


def test_a_video_is_decoded_once_with_its_times(tmp_path):
    video = tmp_path / "walk.mp4"
    video.write_bytes(b"a video")
    works = fake_ffmpeg(
        tmp_path,
        "out = sys.argv[-1]\nfor n in range(3): pathlib.Path(out % n).write_bytes(b'x')\nopen(sys.argv[0] + '.log', 'a').write('1')",
    )
    folder, key = poses.images_of(video, tmp_path, 10, say=str, ffmpeg=works)
    again, same = poses.images_of(video, tmp_path, 10, say=str, ffmpeg=works)
    assert (folder, key) == (again, same) and pathlib.Path(works + ".log").read_text() == "1"
    assert (folder / "timestamps.txt").read_text().split() == ["0.000000", "0.100000", "0.200000"]
