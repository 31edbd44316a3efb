"""The log for the rerun viewer."""

import pytest

import paws_twin

pytest.importorskip("rerun")


def test_a_log_is_written(recording, twin, tmp_path):
    file = paws_twin.rerun_log(recording, twin, tmp_path / "log.rrd")
    # Images and depth are in it.
    assert file.stat().st_size > 100_000
