"""Functions, results, errors, progress and Ctrl-C."""

import os
import signal
import threading
import time

import numpy as np
import pytest

import paws_twin
from paws_twin import _call

native = pytest.mark.skipif(bool(os.environ.get("PAWS_COMMAND")), reason="a child process tells no progress")


def test_a_twin_is_made_and_its_objects_say_what_its_files_say(recording, twin):
    assert [j.kind for j in twin.joints] == ["revolute", "prismatic"]
    assert twin.validation.passed and twin.left_out == []
    verdict = twin.validation.joint("joint_0")
    assert verdict.verdict == "pass" and verdict.margin_nats > 3 and verdict.rms_m < 0.05
    assert verdict.clips[0].hand.shape[1] == 3 and verdict.clips[0].hand.shape == verdict.clips[0].handle.shape
    clip, times, positions = twin.hands("joint_0")[0]
    assert clip == verdict.clips[0].clip and positions.shape == (len(times), 3)
    with pytest.raises(KeyError, match="joint_9: there is no such joint; there are joint_0, joint_1"):
        twin.joint("joint_9")


def test_joints_are_inferred_and_held_against_the_truth(recording):
    rows = paws_twin.infer(recording)
    assert len(rows) == len(recording.clips) and sum(row.kind is not None for row in rows) == 4
    assert "moves no door or drawer" in next(row.reason for row in rows if row.kind is None)
    report = paws_twin.evaluate(rows, recording)
    assert report.clips == report.answered == 4 and report.rules["sim"]["mao"] == 1.0


def test_a_bare_path_is_an_array():
    angle = np.linspace(0, 1, 30)
    joint = paws_twin.infer_path(np.stack([angle, np.cos(angle), np.sin(angle), 0 * angle], axis=1))
    assert joint.kind == "revolute" and not joint.ambiguous
    assert np.allclose(np.abs(joint.axis), [0, 0, 1], atol=1e-2) and joint.range == pytest.approx(1, abs=0.15)
    assert paws_twin.infer_path(np.zeros((3, 3))).kind is None
    with pytest.raises(paws_twin.PawsError, match=r"a path of shape \(4, 5\)"):
        paws_twin.infer_path(np.zeros((4, 5)))


def test_a_path_is_held_against_anybodys_model(twin):
    paths = {"joint_0": twin.hands("joint_0")[0][2]}
    report = paws_twin.validate(twin.file("scene.urdf"), paths)
    assert report.joint("joint_0").clips and report.joint("joint_0").verdict != "fail"
    assert paws_twin.validate(twin).passed


def test_files_are_checked_and_exported(twin, tmp_path):
    assert all(file.ready for file in paws_twin.check(twin))
    files = paws_twin.export(twin, tmp_path / "out", ["urdf", "mjcf"])
    assert sorted(file.name for file in files) == ["kitchen.xml", "scene.urdf", "scene.xml"]
    assert files[0].read_bytes() == twin.file("scene.urdf").read_bytes()


def test_errors_have_the_words_of_the_command(tmp_path):
    for call, words in [
        (lambda: paws_twin.twin("nowhere", tmp_path / "t"), "^nowhere: no such folder; a recording is a folder with"),
        (lambda: paws_twin.synth(parts=99), "^invalid value '99' for '--parts"),
        (lambda: paws_twin.twin("nowhere", tmp_path / "t", colour="red"), "^unexpected argument '--colour'"),
        (lambda: paws_twin.infer("nowhere", config={"inferens": {"a": 1}}), "unknown field `inferens`"),
        (lambda: paws_twin.Twin(tmp_path), "twin.json: no such file or folder"),
    ]:
        with pytest.raises(paws_twin.PawsError, match=words):
            call()
    assert list(tmp_path.iterdir()) == []


def test_a_configuration_is_a_mapping_too(recording):
    plain = paws_twin.infer(recording)
    nameless = paws_twin.infer(recording, config={"seed": 1, "reasoning": {"use_names": False}})
    assert len(plain) == len(nameless)
    assert _call.toml({"a": {"b": [1, 2.5, "x\"y"], "c": False}, "s": 1e-5}) == 's = 1e-05\n[a]\nb = [1, 2.5, "x\\"y"]\nc = false\n'


@native
def test_progress_is_told_in_the_calling_thread(recording, tmp_path):
    heard = []
    def hear(*step):
        heard.append((threading.get_ident(), *step))

    paws_twin.twin(recording, tmp_path / "t", no_textures=True, progress=hear)
    assert {step for _, step, _, _ in heard} >= {"inferring", "simulating", "writing"}
    assert {thread for thread, *_ in heard} == {threading.get_ident()}


@native
def test_what_a_progress_function_raises_ends_the_command_and_nothing_is_left(recording, tmp_path):
    class Enough(Exception):
        pass

    def enough(step, done, total):
        raise Enough(step)

    with pytest.raises(Enough):
        paws_twin.twin(recording, tmp_path / "t", no_textures=True, progress=enough)
    assert list(tmp_path.iterdir()) == []
    # The next command is not disturbed.
    assert paws_twin.twin(recording, tmp_path / "t", no_textures=True).joints


@native
def test_ctrl_c_ends_a_command_and_nothing_is_left(tmp_path):
    def interrupt():
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt).start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        # A kitchen that takes far longer to render.
        paws_twin.synth(tmp_path / "big", seed=1, width=2048, parts=12)
    assert time.monotonic() - begun < 30
    assert list(tmp_path.iterdir()) == []


@native
def test_python_goes_on_while_a_command_runs(recording, tmp_path):
    counted = 0
    done = threading.Event()

    def work():
        try:
            paws_twin.twin(recording, tmp_path / "t", no_textures=True)
        finally:
            done.set()

    threading.Thread(target=work).start()
    while not done.wait(0.001):
        counted += 1
    assert counted > 20 and (tmp_path / "t/twin.json").is_file()
