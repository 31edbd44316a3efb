"""Recordings: folders (docs/recording-format.md), also made of numpy arrays."""

from __future__ import annotations

import csv
import json
import struct
import tempfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ._call import AnyPath, PawsError

#: Rows of 21 hand joints in MANO/OpenPose order that are the tips of thumb, index and middle finger.
TIPS = (4, 8, 12)


@dataclass(frozen=True, eq=False)
class Hand:
    """A hand in one frame, in metres of the world.

    `joints` are 21 points in MANO/OpenPose order, or the three tips of thumb, index and middle finger. `contact` is whether it
    holds something; None where nobody said.
    """

    frame: int
    side: str
    joints: np.ndarray
    contact: bool | None = None
    score: float = 1.0

    def tips(self) -> np.ndarray:
        points = np.asarray(self.joints, dtype=float)
        if points.shape == (21, 3):
            return points[list(TIPS)]
        if points.shape == (3, 3):
            return points
        raise PawsError(f"hand of frame {self.frame}: joints of shape {points.shape}; give 21 x 3, or the 3 x 3 tips")


class Recording:
    """A recording in a folder; `path` is the folder. Its tables are read when they are asked for, its images by the commands."""

    def __init__(self, path: AnyPath):
        self.path = Path(path)
        self._temporary: tempfile.TemporaryDirectory[str] | None = None

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"Recording({str(self.path)!r})"

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.path.resolve().name

    def table(self, name: str) -> Any:
        """A JSON table of the folder, as it is: `cameras.json`, `clips.json`, ..."""
        return read_json(self.path / name)

    @property
    def clips(self) -> list[dict[str, Any]]:
        """The narrated segments."""
        return self.table("clips.json")["clips"]

    @property
    def times(self) -> np.ndarray:
        """The frames' times in seconds."""
        return np.array([f["timestamp"] for f in self.table("cameras.json")["frames"]])

    @property
    def poses(self) -> np.ndarray:
        """World from camera (OpenCV axes) of each frame, n x 4 x 4."""
        frames = self.table("cameras.json")["frames"]
        poses = np.tile(np.eye(4), (len(frames), 1, 1))
        for pose, frame in zip(poses, frames):
            pose[:3, :3] = rotation(frame["rotation_wxyz"])
            pose[:3, 3] = frame["position"]
        return poses

    @property
    def intrinsics(self) -> np.ndarray:
        """The 3 x 3 matrix of the camera; integer pixels are pixel centres."""
        c = self.table("cameras.json")
        return np.array([[c["fx"], 0, c["cx"]], [0, c["fy"], c["cy"]], [0, 0, 1.0]])

    def hand_points(self) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        """Of each frame with hands: its number, their points (k x 3, world), and which points are of a hand that holds something.
        All joints where the recording has them, else the tips of thumb, index and middle finger.
        """
        if (self.path / "hands.json").is_file():
            for frame in self.table("hands.json")["frames"]:
                points = [joint for hand in frame["hands"] for joint in hand["joints_world"]]
                held = [bool(hand.get("contact")) for hand in frame["hands"] for _ in hand["joints_world"]]
                if points:
                    yield frame["frame"], np.array(points), np.array(held)
            return
        with open(self.path / "fingertips.csv", newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                tips = [[float(row[f"{tip}_{axis}"]) for axis in "xyz"] for tip in ("thumb", "index", "middle")]
                yield int(row["frame"]), np.array(tips), np.full(3, row["contact"].lower() in ("1", "true"))

    @classmethod
    def from_arrays(
        cls,
        *,
        intrinsics: Any,
        size: tuple[int, int],
        poses: Any,
        times: Any,
        clips: Sequence[Mapping[str, Any]],
        hands: Iterable[Hand],
        depth: Sequence[Any] | None = None,
        rgb: Sequence[Any] | None = None,
        normals: Sequence[Any] | None = None,
        masks: Sequence[Any] | None = None,
        labels: Mapping[int, str] | None = None,
        points: Any = None,
        out: AnyPath | None = None,
    ) -> Recording:
        """Writes a recording's folder of arrays: into `out`, or into a temporary folder that goes with the object.

        `intrinsics` is 3 x 3, `size` is (width, height), `poses` are n x 4 x 4, world from camera in OpenCV axes, `times` n
        seconds. A clip is `{"start_frame", "end_frame", "narration"}` and may have `clip`, `verb`, `noun`. Of each frame, as an
        array or as any sequence of arrays (None where a frame has none): `depth` in metres along the camera's z (0, NaN: none),
        `rgb` in bytes, `normals` as unit vectors of the camera towards it (0: none), `masks` of classes (255: a hand) that
        `labels` names. `points` (m x 3, world) stand in for depth where a frame has none.
        """
        intrinsics, poses, times = (np.asarray(a, dtype=float) for a in (intrinsics, poses, times))
        if intrinsics.shape != (3, 3):
            raise PawsError(f"intrinsics of shape {intrinsics.shape}; give a 3 x 3 matrix")
        if poses.ndim != 3 or poses.shape[1:] != (4, 4) or times.shape != (len(poses),):
            raise PawsError(f"poses of shape {poses.shape} and times of shape {times.shape}; give n x 4 x 4 and n")
        streams = {"depth": depth, "frames": rgb, "normals": normals, "masks": masks}
        for name, frames in streams.items():
            if frames is not None and len(frames) != len(poses):
                raise PawsError(f"{name}: {len(frames)} images for {len(poses)} poses; give None where a frame has none")
        temporary = tempfile.TemporaryDirectory(prefix="paws_recording_") if out is None else None
        folder = Path(temporary.name) / "recording" if temporary else Path(out or "")
        if folder.exists() and any(folder.iterdir()):
            raise PawsError(f"{folder}: exists and is not empty; choose another out")
        folder.mkdir(parents=True, exist_ok=True)
        with_image = set()
        for name, frames in streams.items():
            for number, image in enumerate(frames if frames is not None else ()):
                if image is not None:
                    pixels = _PIXELS[name](np.asarray(image))
                    _check_size(f"{name} of frame {number}", pixels, size)
                    write_png(folder / name / f"{number:06}.png", pixels)
                    with_image.add((name, number))
        _write_tables(folder, intrinsics, size, poses, times, clips, hands, with_image)
        if labels is not None:
            write_json(folder / "labels.json", {str(k): v for k, v in labels.items()})
        if points is not None:
            write_ply(folder / "reconstruction.ply", points)
        recording = cls(folder)
        recording._temporary = temporary
        return recording


def _write_tables(
    folder: Path,
    intrinsics: np.ndarray,
    size: tuple[int, int],
    poses: np.ndarray,
    times: np.ndarray,
    clips: Sequence[Mapping[str, Any]],
    hands: Iterable[Hand],
    with_image: set[tuple[str, int]],
) -> None:
    frames = []
    for number, (pose, time) in enumerate(zip(poses, times)):
        frame = {"frame": number, "timestamp": float(time), "position": pose[:3, 3].tolist()}
        frame["rotation_wxyz"] = quaternion(pose[:3, :3])
        if ("frames", number) in with_image:
            frame["file"] = f"frames/{number:06}.png"
        frames.append(frame)
    camera = {"width": int(size[0]), "height": int(size[1]), "fx": intrinsics[0, 0], "fy": intrinsics[1, 1]}
    camera |= {"cx": intrinsics[0, 2], "cy": intrinsics[1, 2]}
    write_json(folder / "cameras.json", {**camera, "frames": frames})
    named = [{"clip": f"clip_{i:03}", "narration": "", "verb": "", "noun": "", **clip} for i, clip in enumerate(clips)]
    write_json(folder / "clips.json", {"clips": named})
    names = [f"{tip}_{axis}" for tip in ("thumb", "index", "middle") for axis in "xyz"]
    with open(folder / "fingertips.csv", "w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["frame", "timestamp", "side", "contact", "score", *names])
        for hand in sorted(hands, key=lambda h: h.frame):
            if not 0 <= hand.frame < len(times):
                raise PawsError(f"hand of frame {hand.frame}: there are {len(times)} frames")
            contact = "" if hand.contact is None else int(hand.contact)
            tips = [float(x) for x in hand.tips().ravel()]
            table.writerow([int(hand.frame), float(times[hand.frame]), hand.side, contact, hand.score, *tips])


def _millimetres(depth: np.ndarray) -> np.ndarray:
    metres = np.nan_to_num(depth.astype(float), nan=0.0, posinf=0.0, neginf=0.0)
    return np.clip(np.rint(1000.0 * metres), 0, 65535).astype(np.uint16)


def _normal_bytes(normals: np.ndarray) -> np.ndarray:
    values = normals.astype(float)
    bytes_ = np.clip(np.rint(127.0 * values + 128.0), 1, 255).astype(np.uint8)
    bytes_[~(np.abs(values).sum(axis=-1) > 0)] = 0
    return bytes_


_PIXELS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "depth": _millimetres,
    "frames": lambda a: a.astype(np.uint8),
    "normals": _normal_bytes,
    "masks": lambda a: a.astype(np.uint8),
}


def _check_size(what: str, pixels: np.ndarray, size: tuple[int, int]) -> None:
    if pixels.shape[:2] != (size[1], size[0]):
        raise PawsError(f"{what}: {pixels.shape[1]} x {pixels.shape[0]} pixels, the camera has {size[0]} x {size[1]}")


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Writes grey (h x w, 8 or 16 bit) or colour (h x w x 3, 8 bit) pixels."""
    colours = {(2, 1): 0, (2, 2): 0, (3, 1): 2}
    colour = colours.get((pixels.ndim, pixels.dtype.itemsize))
    if colour is None or (pixels.ndim == 3 and pixels.shape[2] != 3):
        raise PawsError(f"{path.name}: pixels of shape {pixels.shape} are neither grey nor red, green and blue")
    height, width = pixels.shape[:2]
    rows = np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder(">"))).view(np.uint8).reshape(height, -1)
    # A zero before each row: not filtered.
    data = np.hstack([np.zeros((height, 1), np.uint8), rows]).tobytes()
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        head = struct.pack(">IIBBBBB", width, height, 8 * pixels.dtype.itemsize, colour, 0, 0, 0)
        for kind, chunk in ((b"IHDR", head), (b"IDAT", zlib.compress(data, 1)), (b"IEND", b"")):
            file.write(struct.pack(">I", len(chunk)) + kind + chunk + struct.pack(">I", zlib.crc32(kind + chunk)))


def write_ply(path: Path, points: Any) -> None:
    """Writes m x 3 points."""
    points = np.asarray(points, dtype="<f4")
    if points.ndim != 2 or points.shape[1] != 3:
        raise PawsError(f"points of shape {points.shape}; give m x 3")
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    lines += [f"property float {axis}" for axis in "xyz"] + ["end_header", ""]
    path.write_bytes("\n".join(lines).encode() + points.tobytes())


def read_json(path: Path) -> Any:
    """A JSON file; PawsError where it is missing or no JSON."""
    try:
        with open(path, encoding="utf-8") as file:
            return json.load(file)
    except FileNotFoundError:
        raise PawsError(f"{path}: no such file or folder") from None
    except ValueError as error:
        raise PawsError(f"{path}: {error}") from None


def write_json(path: Path, value: object) -> None:
    path.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")


def rotation(wxyz: Any) -> np.ndarray:
    """The matrix of a quaternion w x y z."""
    w, x, y, z = np.asarray(wxyz, dtype=float) / np.linalg.norm(wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion(matrix: np.ndarray) -> list[float]:
    """The quaternion w x y z of a rotation matrix, w not negative."""
    m = np.asarray(matrix, dtype=float)
    if not np.allclose(m @ m.T, np.eye(3), atol=1e-3) or np.linalg.det(m) < 0:
        raise PawsError("a pose's 3 x 3 part is no rotation; give world from camera, right-handed, without scale")
    # The largest eigenvector of Bar-Itzhack's matrix: good for every angle, and for matrices that are slightly off.
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
            [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    x, y, z, w = np.linalg.eigh(k)[1][:, -1]
    sign = -1.0 if w < 0 else 1.0
    return [float(sign * v) for v in (w, x, y, z)]
