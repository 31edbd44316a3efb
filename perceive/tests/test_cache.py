"""What is kept, what is made anew, what a killed run leaves."""

import errno
import os
import pathlib
import signal
import subprocess
import sys
import textwrap
import time

import pytest

from paws_perceive import Failure, adapters, cache
from paws_perceive.cache import Stream

SOURCES = pathlib.Path(__file__).parent.parent / "src"


def test_the_same_inputs_compute_nothing_and_others_do(tmp_path):
    asked = []

    def compute(number):
        asked.append(number)
        return {"n": number}

    facts = {"adapter": "a", "weights": {"w": "1"}, "options": {"x": 1}, "images": "i"}
    assert Stream(tmp_path, "hands", facts, 4).run(10, compute) == [{"n": n} for n in range(10)]
    Stream(tmp_path, "hands", facts, 4).run(10, compute)
    assert asked == list(range(10))
    for change in ({"adapter": "b"}, {"weights": {"w": "2"}}, {"options": {"x": 2}}, {"images": "j"}):
        asked.clear()
        Stream(tmp_path, "hands", {**facts, **change}, 4).run(10, compute)
        assert len(asked) == 10
    asked.clear()
    again = Stream(tmp_path, "hands", facts, 4)
    again.forget()
    again.run(10, compute)
    assert len(asked) == 10


def test_a_part_that_is_damaged_is_made_anew(tmp_path):
    stream = Stream(tmp_path, "hands", {}, 4)
    stream.run(8, lambda n: n)
    (stream.folder / "000004.json").write_text("[4, 5")
    asked = []
    assert stream.run(8, lambda n: asked.append(n) or n) == list(range(8))
    assert asked == [4, 5, 6, 7]


def test_a_run_that_is_killed_goes_on_where_it_stopped(tmp_path):
    script = textwrap.dedent(
        """
        import sys, time
        from paws_perceive.cache import Stream
        def compute(n):
            with open(sys.argv[2], "a") as log:
                log.write(f"{n}\\n")
            time.sleep(0.03)
            return n
        print(sum(Stream(sys.argv[1], "hands", {}, 2).run(40, compute)))
        """
    )
    log = tmp_path / "log"
    command = [sys.executable, "-c", script, str(tmp_path / "cache"), str(log)]
    env = {**os.environ, "PYTHONPATH": str(SOURCES)}
    first = subprocess.Popen(command, env=env)
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline and (not log.exists() or len(log.read_text().split()) < 9):
        time.sleep(0.01)
    first.send_signal(signal.SIGKILL)
    first.wait()
    before = [int(n) for n in log.read_text().split()]
    assert 9 <= len(before) < 40
    second = subprocess.run(command, env=env, capture_output=True, text=True, check=True)
    assert second.stdout.strip() == str(sum(range(40)))
    after = [int(n) for n in log.read_text().split()][len(before) :]
    # At the most one part of two is made twice.
    assert after[0] >= len(before) - 2 and after == list(range(after[0], 40))


def test_a_full_disk_is_told_and_leaves_no_half(tmp_path, monkeypatch):
    stream = Stream(tmp_path, "hands", {}, 2)
    stream.run(2, lambda n: n)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(cache.os, "fsync", full)
    with pytest.raises(Failure, match="disk is full.*--cache"):
        stream.run(4, lambda n: n)
    assert sorted(p.name for p in stream.folder.iterdir()) == ["000000.json", "facts.json"]


def test_weights_of_another_kind_are_refused_and_missing_ones_named(tmp_path):
    about = adapters.of("hands").ABOUT
    with pytest.raises(Failure, match="palm_detection_full.tflite is in none.*--weights"):
        adapters.weights_of(about, [tmp_path])
    (tmp_path / "palm_detection_full.tflite").write_bytes(b"something else")
    with pytest.raises(Failure, match="is not the file.*SHA-256"):
        adapters.weights_of(about, [tmp_path])


def test_a_package_that_is_not_there_is_named():
    about = adapters.of("hands").ABOUT
    with pytest.raises(Failure, match="mediapipe==0.10.21.*uv"):
        adapters.package("no_such_package_here", about)
