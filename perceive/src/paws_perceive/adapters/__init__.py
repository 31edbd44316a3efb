"""One file a network. Each has `ABOUT`, `load(device, weights)` and what it loads has `run`; nothing heavy is imported before `load`."""

import dataclasses
import hashlib
import importlib
import pathlib

from .. import Failure

# Files of `adapters/`, in the order of the streams.
ALL = ("pycolmap_poses", "transformers_depth", "mediapipe_hands")


@dataclasses.dataclass(frozen=True)
class About:
    """What is known of a network before it runs."""

    name: str
    stream: str
    package: str
    """The package that it needs, as `pip install` takes it."""
    extra: str
    """The extra of `pyproject.toml` that holds the package."""
    licence: str
    needs: str
    gives: str
    """What comes out: the frame, the axes, the unit."""
    devices: tuple
    secs_per_frame: float
    """On one core."""
    memory_mb: int
    version: int
    """Raised when what it gives changes, so that nothing older is taken from the cache."""
    weights: dict = dataclasses.field(default_factory=dict)
    """SHA-256 by file name."""
    weights_from: str = ""


def of(stream):
    """The adapter of a stream."""
    for name in ALL:
        module = importlib.import_module(f".{name}", __name__)
        if module.ABOUT.stream == stream:
            return module
    raise Failure(f"no network is known for {stream}")


def package(name, about):
    """Imports a package, or says how to get it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise Failure(
            f"{about.name} needs the Python package {about.package}, which cannot be loaded ({error}): install uv, which gets it "
            f"(https://docs.astral.sh/uv), or `python3 -m pip install \"{about.package}\"` (Python 3.10 to 3.12)"
        ) from error


def weights_of(about, folders):
    """The bytes of each file of weights, from the first folder that has it; their hashes have to be the expected ones."""
    out = {}
    for name, expected in about.weights.items():
        path = next((p for f in folders for p in (pathlib.Path(f) / name, pathlib.Path(f) / pathlib.Path(name).name) if p.is_file()), None)
        if path is None:
            raise Failure(
                f"{about.name}: {pathlib.Path(name).name} is in none of {', '.join(map(str, folders))}: put it into a folder and "
                f"name that with --weights DIR; {about.weights_from}"
            )
        try:
            data = path.read_bytes()
        except OSError as error:
            raise Failure(f"{path}: {error.strerror}") from error
        found = hashlib.sha256(data).hexdigest()
        if found != expected:
            raise Failure(
                f"{path}: is not the file that {about.name} was tested with (SHA-256 {found[:12]}..., expected {expected[:12]}...): "
                f"it is another version or broken; {about.weights_from}"
            )
        out[name] = data
    return out
