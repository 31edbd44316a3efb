"""The annotations are whole and agree with the code: what editors and type checkers tell users."""

import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "python/paws_twin"


def test_mypy_finds_nothing(tmp_path):
    pytest.importorskip("mypy")
    words = ["--strict", "--ignore-missing-imports", "--disable-error-code=no-any-return", "--disable-error-code=unused-ignore"]
    command = [sys.executable, "-m", "mypy", *words, "--disable-error-code=type-arg", "--cache-dir", str(tmp_path)]
    done = subprocess.run([*command, str(PACKAGE)], capture_output=True, text=True, timeout=280, cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
