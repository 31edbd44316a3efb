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
