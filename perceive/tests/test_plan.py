"""What would run is told without anything that would run it."""

import json
import pathlib
import subprocess
import sys

import pytest

from paws_perceive import Failure, plan

SOURCES = pathlib.Path(__file__).parent.parent / "src"
PHONE = {"images": 3000, "frames": 600, "poses": True, "depth": True, "hands": False, "clips": True}
VIDEO = {"images": 3000, "frames": 600, "poses": False, "depth": False, "hands": False, "clips": False}


def test_a_phones_scan_lacks_its_hands():
    rows = {r[0]: r for r in plan.plan(PHONE)}
    assert rows["poses"][1] == rows["depth"][1] == "is there"
    assert rows["hands"][1:] == ("mediapipe-hands", "cpu", "90 s", "0.6 GB", "Apache-2.0") or rows["hands"][3].endswith("min")


def test_what_is_not_made_here_is_told_with_the_way_out():
    text = plan.text(VIDEO, "gpu")
    for word in ("pycolmap", "BSD-3-Clause", "moge infer", "subtitles", "nothing of this uses a GPU", "nothing was run"):
        assert word in text


def test_redo_and_streams_without_images():
    done = {**PHONE, "hands": True}
    assert {r[0]: r[1] for r in plan.plan(done)}["hands"] == "is there"
    assert {r[0]: r[1] for r in plan.plan(done, redo=["hands"])}["hands"] == "mediapipe-hands"
    assert {r[0]: r[1] for r in plan.plan({**PHONE, "images": 0})}["hands"] == "needs images"


def test_what_is_asked_for_is_planned_with_its_licence(tmp_path):
    model = tmp_path / "moge"
    model.mkdir()
    (model / "model.pt").write_bytes(b"1")
    wishes = plan.Wishes("gpu", depth_model=str(model), make=("masks", "lines"), by=("lines=limap", "poses=mapanything"))
    rows = {r[0]: r for r in plan.plan(VIDEO, wishes=wishes)}
    assert rows["depth"][1] == "moge" and rows["masks"][1] == "hands' joints" and rows["lines"][1] == "limap"
    text = plan.text(VIDEO, wishes)
    for word in ("--accept-licence mapanything", "CC BY-NC 4.0", "BSD-3-Clause", "two of five", "grounding-dino"):
        assert word in text, word
    for name in ("grounding-dino", "sam2"):
        (tmp_path / "weights" / name).mkdir(parents=True)
    wishes = plan.Wishes("gpu", weights=str(tmp_path / "weights"), make=("masks",))
    assert {r[0]: r for r in plan.plan(PHONE, wishes=wishes)}["masks"][1] == "grounded-sam2"
    # Nobody asked for them: they are no rows.
    assert not {"masks", "lines"} & {r[0] for r in plan.plan(PHONE)}
    with pytest.raises(Failure, match="no network is known as nothing"):
        plan.plan(VIDEO, wishes=plan.Wishes(by=("hands=nothing",)))


def test_the_standard_library_is_enough():
    """Isolated, without site-packages: what is not of the standard library cannot be loaded."""
    code = f"import sys; sys.path.insert(0, {str(SOURCES)!r}); from paws_perceive.__main__ import main; sys.exit(main())"
    command = [sys.executable, "-I", "-S", "-c", code, "plan", "--facts", json.dumps(PHONE)]
    out = subprocess.run(command, capture_output=True, text=True, check=False)
    assert out.returncode == 0, out.stderr
    assert "mediapipe-hands" in out.stdout


def test_folders_and_videos(tmp_path):
    with pytest.raises(Failure, match="neither a recording"):
        plan.facts_of(tmp_path / "nothing")
    (tmp_path / "a.jpg").write_bytes(b"")
    assert plan.facts_of(tmp_path)["images"] == 1
    (tmp_path / "walk.mp4").write_bytes(b"1")
    assert plan.facts_of(tmp_path / "walk.mp4")["images"] is None
    (tmp_path / "cameras.json").write_text("{")
    with pytest.raises(Failure, match="cameras.json"):
        plan.facts_of(tmp_path)
