"""Recordings out of numpy arrays."""

import zlib

import numpy as np
import pytest

import paws_twin
from paws_twin import recording as files


#: Half a metre before the camera, each joint some millimetres from the next.
JOINTS = np.array([0.0, 0.1, 0.5]) + 0.008 * np.arange(21)[:, None]


def arrays(frames=3, **changes):
    """The arguments of a recording that shows nothing."""
    given = {
        "intrinsics": [[50, 0, 31.5], [0, 50, 23.5], [0, 0, 1]],
        "size": (64, 48),
        "poses": np.tile(np.eye(4), (frames, 1, 1)),
        "times": np.arange(frames) / 10,
        "clips": [{"start_frame": 0, "end_frame": frames - 1, "narration": "open the drawer"}],
        "hands": [paws_twin.Hand(1, "right", JOINTS, True)],
        "depth": [np.full((48, 64), 1.5)] * frames,
    }
    return {**given, **changes}


def pixels(path, width, dtype):
    """The pixels of a PNG as `write_png` writes it: one chunk of data, nothing filtered."""
    raw = path.read_bytes()
    begin = raw.index(b"IDAT") + 4
    length = int.from_bytes(raw[begin - 8 : begin - 4], "big")
    rows = np.frombuffer(zlib.decompress(raw[begin : begin + length]), np.uint8)
    bytes_ = width * np.dtype(dtype).itemsize
    return np.ascontiguousarray(rows.reshape(-1, bytes_ + 1)[:, 1:]).view(dtype)


def test_what_was_given_is_what_is_written(tmp_path):
    depth = np.linspace(0.5, 3, 48 * 64).reshape(48, 64)
    depth[0, :2] = [np.nan, -1]
    poses = np.tile(np.eye(4), (3, 1, 1))
    poses[1, :3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    poses[2, :3, 3] = [1, 2, 3]
    made = paws_twin.Recording.from_arrays(**arrays(poses=poses, depth=[depth, None, depth]), out=tmp_path / "rec")
    assert np.allclose(made.poses, poses) and np.allclose(made.times, [0, 0.1, 0.2])
    assert np.allclose(made.intrinsics[:2], [[50, 0, 31.5], [0, 50, 23.5]])
    read = pixels(made.path / "depth/000000.png", 64, ">u2")
    assert read[0, 0] == read[0, 1] == 0 and read[47, 63] == 3000
    assert not (made.path / "depth/000001.png").exists()
    ((number, tips, held),) = made.hand_points()
    assert number == 1 and tips.shape == (3, 3) and held.all()


def test_the_commands_read_it(tmp_path):
    made = paws_twin.Recording.from_arrays(**arrays(rgb=[np.zeros((48, 64, 3), np.uint8)] * 3), out=tmp_path / "rec")
    (row,) = paws_twin.infer(made, as_is=True)
    assert row.kind is None and row.reason


def test_what_does_not_fit_is_told(tmp_path):
    for changes, words in [
        ({"intrinsics": np.eye(4)}, "intrinsics of shape"),
        ({"times": np.zeros(2)}, "poses of shape"),
        ({"depth": [None]}, "depth: 1 images for 3 poses"),
        ({"depth": [np.zeros((64, 48))] * 3}, "depth of frame 0: 48 x 64 pixels"),
        ({"hands": [paws_twin.Hand(9, "left", np.zeros((3, 3)))]}, "hand of frame 9: there are 3 frames"),
        ({"hands": [paws_twin.Hand(0, "left", np.zeros((5, 3)))]}, "hand of frame 0: joints of shape"),
        ({"poses": np.tile(np.diag([1, 1, -1, 1]), (3, 1, 1))}, "is no rotation"),
    ]:
        with pytest.raises(paws_twin.PawsError, match=words):
            paws_twin.Recording.from_arrays(**arrays(**changes))
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").touch()
    with pytest.raises(paws_twin.PawsError, match="exists and is not empty"):
        paws_twin.Recording.from_arrays(**arrays(), out=tmp_path / "full")


def test_quaternions_are_those_of_their_matrices():
    for wxyz in np.random.default_rng(0).normal(size=(200, 4)):
        wxyz *= np.sign(wxyz[0]) / np.linalg.norm(wxyz)
        assert np.allclose(files.quaternion(files.rotation(wxyz)), wxyz)
