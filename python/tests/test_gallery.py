"""Every script of examples/python runs from top to bottom."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

GALLERY = Path(__file__).resolve().parents[2] / "examples/python"
#: Scripts of programs that are not installed here: they have to say so.
ELSEWHERE = {
    "robosuite_scene.py": "robosuite",
    "sapien_scene.py": "sapien",
    "isaac_lab_scene.py": "Isaac Lab",
    "batch_ray.py": "ray",
}
NEEDS = {"log_to_rerun.py": "rerun", "many_recordings.py": "pyarrow", "from_arrays.py": "PIL"}


def run(script, cwd, *args):
    return subprocess.run([sys.executable, str(GALLERY / script), *args], cwd=cwd, capture_output=True, text=True)


@pytest.mark.parametrize("script", sorted(p.name for p in GALLERY.glob("*.py") if p.name not in ELSEWHERE))
def test_a_script_runs(script, tmp_path):
    if script in NEEDS:
        pytest.importorskip(NEEDS[script])
    if script == "many_recordings.py" and os.environ.get("PAWS_COMMAND"):
        os.environ.setdefault("PAWS_PROGRAM", os.environ["PAWS_COMMAND"])
    done = run(script, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.strip()


@pytest.mark.parametrize("script", sorted(ELSEWHERE))
def test_a_script_of_an_absent_program_says_so(script, twin, tmp_path):
    done = run(script, tmp_path, str(twin.path))
    if f"{ELSEWHERE[script]} is not installed" not in done.stderr:
        pytest.skip("it is installed here; run it by hand")
    assert done.returncode == 1
