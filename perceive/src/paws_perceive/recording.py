"""A recording's folder: what is read of it, and what is added to it."""

import json
import pathlib

from . import Failure
from .cache import write_whole
from .geometry import Camera


def read_json(path):
    """A JSON file, or what is wrong with it."""
    try:
        return json.loads(pathlib.Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        raise Failure(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise Failure(f"{path}: is no JSON ({error})") from error


class Recording:
    """Cameras and images of a recording."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        path = self.folder / "cameras.json"
        cameras = read_json(path)
        try:
            self.camera = Camera(*(float(cameras[k]) for k in ("fx", "fy", "cx", "cy")))
            # Pixels; 0 where nobody says it.
            self.width = int(cameras.get("width", 0))
            self.frames = [
                {
                    "frame": int(f["frame"]),
                    "file": f.get("file"),
                    "time": float(f["timestamp"]),
                    "position": [float(v) for v in f["position"]],
                    "rotation_wxyz": [float(v) for v in f["rotation_wxyz"]],
                }
                for f in cameras["frames"]
            ]
        except (KeyError, TypeError, ValueError) as error:
            raise Failure(f"{path}: {error!r}: is no list of cameras as docs/recording-format.md has it") from error

    def image_path(self, frame):
        """The colour image of a frame, or `None`. Files outside of the folder are not read."""
        name = frame["file"] or f"frames/{frame['frame']:06d}.jpg"
        path = self.folder / name
        inside = path.resolve().is_relative_to(self.folder.resolve())
        return path if inside and path.is_file() else None

    def depth_path(self, frame):
        """The depth image of a frame, or `None`."""
        path = self.folder / "depth" / f"{frame['frame']:06d}.png"
        return path if path.is_file() else None


def chosen(recording, numbers=None):
    """The frames of a recording whose numbers are given; all where none are."""
    if numbers is None:
        return recording.frames
    wanted = set(numbers)
    return [frame for frame in recording.frames if frame["frame"] in wanted]


def numbers_of(path):
    """Numbers of frames from a JSON file: a list of them, or what `paws frames --json` prints."""
    held = read_json(path)
    held = held.get("frames") if isinstance(held, dict) else held
    numbers = [f.get("frame") if isinstance(f, dict) else f for f in held] if isinstance(held, list) else [None]
    if not all(isinstance(n, int) and not isinstance(n, bool) for n in numbers):
        raise Failure(f"{path}: is no list of frames: `paws frames RECORDING --json` writes one")
    return numbers


def read_hands(folder):
    """Hands by number of the frame: for each its 21 joints, world, metres. Empty where there are none, or tips alone."""
    path = pathlib.Path(folder) / "hands.json"
    if not path.is_file():
        return {}
    try:
        frames = read_json(path)["frames"]
        return {int(f["frame"]): [h["joints_world"] for h in f["hands"] if len(h["joints_world"]) == 21] for f in frames}
    except (KeyError, TypeError, ValueError) as error:
        raise Failure(f"{path}: {error!r}: is no list of hands as docs/recording-format.md has it") from error


def add_hands(folder, frames):
    """Writes `hands.json`."""
    text = json.dumps(
        {
            "joint_order": "wrist; thumb CMC MCP IP tip; index MCP PIP DIP tip; middle ...; ring ...; little ... (21)",
            "tips": {"thumb": 4, "index": 8, "middle": 12},
            "frame": "world (same as cameras.json), metres",
            "frames": frames,
        }
    )
    write_whole(pathlib.Path(folder) / "hands.json", text + "\n")


def add_labels(folder, labels):
    """Writes `labels.json`: class number to name. Without classes there is none."""
    path = pathlib.Path(folder) / "labels.json"
    if labels:
        write_whole(path, json.dumps({str(number): labels[number] for number in sorted(labels)}, indent=2) + "\n")
    else:
        path.unlink(missing_ok=True)


def add_origin(folder, made):
    """Adds to `import.json` what a stream was made by: adapter, licence, weights, options."""
    path = pathlib.Path(folder) / "import.json"
    known = read_json(path) if path.is_file() else {}
    others = [m for m in known.get("perceived", []) if m.get("stream") != made["stream"]]
    known["perceived"] = sorted([*others, made], key=lambda m: m["stream"])
    # It is missing no longer.
    if isinstance(known.get("missing"), list):
        known["missing"] = [m for m in known["missing"] if m.get("what") != made["stream"]]
    write_whole(path, json.dumps(known, indent=2) + "\n")
