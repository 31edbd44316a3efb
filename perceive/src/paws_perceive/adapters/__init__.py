"""One file a network. Each has `ABOUT`, `load(device, weights)` and what it loads has `run`; nothing heavy is imported before `load`."""

import contextlib
import dataclasses
import hashlib
import importlib
import os
import pathlib

from .. import Failure
from ..batches import TooLarge
from ..cache import digest_of

# Files of `adapters/`, in the order of the streams; of each stream the one that is taken where nobody says which stands first.
ALL = (
    "pycolmap_poses",
    "depth_anything_poses",
    "mapanything_poses",
    "transformers_depth",
    "moge_depth",
    "mediapipe_hands",
    "wilor_hands",
    "transformers_masks",
    "deeplsd_lines",
    "limap_lines",
)
# Networks that run in places of their own, and how their results come into a recording.
ELSEWHERE = {
    ("hands", "hamer"): "HaMeR (MIT code; MANO's licence for its weights) runs in its own checkout: `python demo.py --img_folder IMAGES "
    "--out_folder MESHES --save_mesh`, then name its meshes as one more source: wilor=MESHES",
    ("hands", "hawor"): "HaWoR (CC BY-NC-ND 4.0, and MANO's licence) runs in its own checkout; then `python3 examples/import/hawor.py "
    "HAWOR_CHECKOUT VIDEO_FOLDER hands.jsonl`, and name hands.jsonl as one more source",
}
# A file in a model's folder that says what its files have to be, as `sha256sum` writes it.
SUMS = "SHA256SUMS"


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
    asks: bool = False
    """Whether its licence forbids what many people do, so that it runs only for who accepts it by name."""


def modules(stream=None):
    """The adapters, of all streams or of one."""
    every = (importlib.import_module(f".{name}", __name__) for name in ALL)
    return [module for module in every if stream is None or module.ABOUT.stream == stream]


def of(stream, name=None):
    """The adapter of a stream: the named one, else the first."""
    known = modules(stream)
    for module in known:
        if name in (None, module.ABOUT.name):
            return module
    if (stream, name) in ELSEWHERE:
        raise Failure(f"{stream}: {ELSEWHERE[stream, name]}")
    names = [module.ABOUT.name for module in known] + [n for s, n in ELSEWHERE if s == stream]
    raise Failure(f"{stream}: no network is known as {name}; known are {', '.join(names) or 'none'}")


def accepted(about, names, licence=None):
    """Refuses a network whose licence has to be accepted and is not; `licence`: the one of the given weights."""
    if about.name not in names:
        raise Failure(
            f"{about.stream}: {about.name} is under {licence or about.licence}: read it, and where you may use it add "
            f"--accept-licence {about.name}; its results are under it, too, and import.json says so"
        )


def files_of(folder, endings, wanted, option):
    """SHA-256 by name of a model's files in a folder. `wanted`: an ending that has to be there; `option`: what named the folder.

    Where the folder has a `SHA256SUMS`, what it says of these files has to be true.
    """
    folder = pathlib.Path(folder)
    try:
        paths = sorted(p for p in folder.iterdir() if p.suffix in endings and p.is_file())
    except OSError as error:
        raise Failure(f"{folder}: {error.strerror}: {option} wants a folder with the model's files") from error
    if not any(p.suffix == wanted for p in paths):
        raise Failure(f"{folder}: has no {wanted} file: download the model's weights into it")
    empty = [p for p in paths if p.stat().st_size == 0]
    if empty:
        raise Failure(f"{empty[0]}: is empty (0 bytes): download it again into {folder}")
    found = {p.name: digest_of(p) for p in paths}
    for name, expected in sums(folder / SUMS).items():
        if name in found and found[name] != expected:
            raise Failure(
                f"{folder / name}: is not the file that {SUMS} beside it names (SHA-256 {found[name][:12]}..., expected "
                f"{expected[:12]}...): it is another version or broken; put the right {name} into {folder}"
            )
    return found


def files_of_published(about, weights, name):
    """SHA-256 by name of a model's files, in the folder of that name among the weights, as its authors publish it."""
    if not weights:
        raise Failure(f"{about.name}: {about.weights_from}")
    return files_of(pathlib.Path(weights) / name, (".safetensors", ".json"), ".safetensors", "--weights")


def sums(path):
    """What a `SHA256SUMS` says, by file name; empty where there is none."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return {}
    pairs = [line.split(maxsplit=1) for line in lines if line.strip()]
    return {pathlib.PurePath(p[1].lstrip("*")).name: p[0].lower() for p in pairs if len(p) == 2 and len(p[0]) == 64}


def licence_of(folder, otherwise):
    """The licence that a model's card (README.md) in its folder names at its head, else `otherwise`."""
    try:
        text = (pathlib.Path(folder) / "README.md").read_text(encoding="utf-8")
    except (OSError, ValueError):
        return otherwise
    head = text.split("---", 2)[1] if text.startswith("---") and text.count("---") > 1 else ""
    named = [line.split(":", 1)[1].strip() for line in head.splitlines() if line.startswith(("license:", "licence:"))]
    return named[0][:80] if named and named[0] else otherwise


def offline():
    """Tells the libraries below that nothing is fetched: what is missing is an error now, not a wait."""
    os.environ["HF_HUB_OFFLINE"] = "1"
    os.environ["TRANSFORMERS_OFFLINE"] = "1"


def gpu_only(device, about):
    """Refuses to make poses on the CPU."""
    if device != "gpu":
        raise Failure(f"poses: {about.name} wants a GPU (--gpu); without --by poses={about.name} COLMAP makes them on the CPU")


def torch_on(device, about):
    """PyTorch, and its name of the device."""
    torch = package("torch", about)
    if device == "gpu" and not torch.cuda.is_available():
        raise Failure(f"{about.stream}: no GPU that PyTorch can use is here: leave out --gpu (slow), or install PyTorch for your GPU")
    return torch, "cuda" if device == "gpu" else "cpu"


def first_line(error):
    """What an error of a library says, as one line."""
    return (str(error).strip().splitlines() or [repr(error)])[0]


def loaded(cls, folder, **options):
    """A model of `transformers` from its folder; an error where its file lacks weights, which would be random numbers."""
    try:
        model, told = cls.from_pretrained(folder, local_files_only=True, output_loading_info=True, **options)
    except Exception as error:  # Each of the libraries below has an error of its own.
        raise Failure(f"{folder}: cannot be loaded ({first_line(error)}): download the model again") from error
    if told["missing_keys"]:
        raise Failure(f"{folder}: {len(told['missing_keys'])} of the model's weights are not in its file: it is of another version")
    return model


def from_folder(cls, folder):
    """A model, or what prepares images or words for one, from its folder."""
    try:
        return cls.from_pretrained(folder, local_files_only=True)
    except Exception as error:  # As above.
        raise Failure(f"{folder}: cannot be loaded ({first_line(error)}): download the model again") from error


@contextlib.contextmanager
def within_memory(torch):
    """What does not fit into the memory ends as `TooLarge`."""
    try:
        yield
    except torch.OutOfMemoryError as error:
        torch.cuda.empty_cache()
        raise TooLarge from error
    except RuntimeError as error:
        # What PyTorch says of the CPU's memory has no type of its own.
        if "not enough memory" in str(error) or "can't allocate memory" in str(error):
            raise TooLarge from error
        raise


def package(name, about):
    """Imports a package, or says how to get it."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        if about.package.startswith("git+") or about.extra == "lines":
            raise Failure(
                f"{about.name} needs the Python package {about.package}, which cannot be loaded ({error}): install it into a Python of its "
                f'own (`python3 -m venv DIR`, then `DIR/bin/pip install "{about.package}" opencv-python-headless`) and name that with '
                "--python DIR/bin/python"
            ) from error
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
