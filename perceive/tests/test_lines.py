"""Line segments: what detectors that are installed elsewhere say, in a recording's own files."""

import json
import sys
import types

import numpy as np
import pytest

from paws_perceive import Failure, adapters, lines
from test_depth import a_recording


class Detector:
    """LIMAP's: rows of x1, y1, x2, y2, width."""

    def detect(self, view):
        grey = view.read_image(set_gray=True)
        return np.array([[1.0, 2.0, grey.shape[1] - 1.0, 4.0, 1.0]])


def test_limaps_segments_are_written_as_recordings_have_them(tmp_path, monkeypatch):
    pytest.importorskip("cv2")
    folder = a_recording(tmp_path / "rec", 3)
    fake = types.ModuleType("limap.line2d")
    fake.get_detector = lambda config, **more: Detector()
    monkeypatch.setitem(sys.modules, "limap", types.ModuleType("limap"))
    monkeypatch.setitem(sys.modules, "limap.line2d", fake)
    assert lines.run(folder, tmp_path / "cache", say=str, frames=[0, 2], by="limap") == 2
    assert sorted(p.name for p in (folder / "segments").iterdir()) == ["000000.npz", "000002.npz"]
    held = np.load(folder / "segments/000002.npz")["lines"]
    # Row before column.
    assert held.tolist() == [[[2.0, 1.0], [4.0, 63.0]]]
    made = json.loads((folder / "import.json").read_text())["perceived"][0]
    assert made["stream"] == "segments" and made["licence"] == "BSD-3-Clause"


def test_detectors_that_are_not_here_say_what_they_need(tmp_path):
    pytest.importorskip("cv2")
    folder = a_recording(tmp_path / "rec", 1)
    with pytest.raises(Failure, match="deeplsd_md.tar"):
        lines.run(folder, tmp_path / "cache", weights=tmp_path, say=str)
    with pytest.raises(Failure, match="limap needs the Python package pylimap"):
        lines.run(folder, tmp_path / "cache", say=str, by="limap")
    with pytest.raises(Failure, match="known are deeplsd, limap"):
        adapters.of("lines", "lsd")
