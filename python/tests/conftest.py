"""What the tests share: a small recording with a known answer, and its twin, made once, without textures: they take most of the
time, and are what `make_a_twin.py` of the gallery has.
"""

import pytest

import paws_twin


@pytest.fixture(scope="session")
def recording(tmp_path_factory):
    return paws_twin.synth(tmp_path_factory.mktemp("rec") / "kitchen", seed=3, tier="clean", width=160, parts=2)


@pytest.fixture(scope="session")
def twin(recording, tmp_path_factory):
    return paws_twin.twin(recording, tmp_path_factory.mktemp("twin") / "twin", no_textures=True)
