"""Every script of examples/python runs from top to bottom."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

import paws_twin

GALLERY = Path(__file__).resolve().parents[2] / "examples/python"
#: No script of the gallery takes longer, seconds.
LIMIT = 280
#: What a script needs beside the module and numpy. Where it is not installed the script says so and ends with 1.
NEEDS = {
    "batch_daft.py": ["daft"],
    "batch_ray.py": ["ray"],
    "from_arrays.py": ["PIL"],
    "gym_random_agent.py": ["gymnasium", "mujoco"],
    "isaac_lab_scene.py": ["isaaclab"],
    "log_to_rerun.py": ["rerun"],
    "many_recordings.py": ["pyarrow"],
    "open_doors.py": ["mujoco"],
    "open_doors_arm.py": ["mujoco", "mink", "gymnasium_robotics"],
    "robosuite_scene.py": ["robosuite"],
    "sapien_scene.py": ["sapien"],
    "step_in_mujoco.py": ["mujoco"],
}
#: Scripts that say what they miss by its name: programs that most people do not have.
SAYS = {
    "batch_daft.py": "daft",
    "batch_ray.py": "ray",
    "isaac_lab_scene.py": "Isaac Lab",
    "robosuite_scene.py": "robosuite",
    "sapien_scene.py": "sapien",
}
TWIN, BATCH = "twin", "batch"
#: What a script is given; nothing: it renders something small for itself.
GIVEN = {
    "batch_daft.py": BATCH,
    "batch_ray.py": BATCH,
    "isaac_lab_scene.py": TWIN,
    "open_doors.py": TWIN,
    "open_doors_arm.py": TWIN,
    "robosuite_scene.py": TWIN,
    "sapien_scene.py": TWIN,
}


def missing(script):
    return [module for module in NEEDS.get(script, ()) if importlib.util.find_spec(module) is None]


@pytest.fixture
def run(twin, recording, tmp_path, monkeypatch):
    """Runs a script in a folder of its own."""

    def of(script):
        given = []
        if GIVEN.get(script) == TWIN:
            given = [str(twin.path)]
        elif GIVEN.get(script) == BATCH:
            (tmp_path / "manifest.csv").write_text(f"name,recording\nk,{recording.path}\n")
            given = ["manifest.csv", "out"]
            monkeypatch.setenv("PAWS_NO_TEXTURES", "1")
        words = [sys.executable, str(GALLERY / script), *given]
        return subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT)

    return of


@pytest.mark.timeout(2 * LIMIT)
@pytest.mark.parametrize("script", sorted(p.name for p in GALLERY.glob("*.py")))
def test_a_script_runs(script, run, tmp_path):
    absent = missing(script)
    if absent and script not in SAYS:
        pytest.skip(f"{script} is not run: {', '.join(absent)} is not installed")
    done = run(script)
    if absent:
        assert done.returncode == 1 and f"{SAYS[script]} is not installed" in done.stderr, done.stderr
        pytest.skip(f"{script} says that {SAYS[script]} is not installed")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.strip()
    if GIVEN.get(script) == BATCH:
        assert "k done" in done.stdout and paws_twin.Twin(tmp_path / "out/twins/k").joints
