"""Twins: the folder that `paws twin` writes, as an object."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ._call import AnyPath, PawsError
from .recording import read_json
from .results import TwinJoint, Validation, named


class Twin:
    """A simulated kitchen. `path` is its folder; `joints` are the parts that open; `validation` are the verdicts, None where
    the twin was made without a recording.

    A twin that was made without `out` lies in a temporary folder that goes with the object.
    """

    def __init__(self, path: AnyPath, notes: tuple[str, ...] = ()):
        self.path = Path(path)
        self.notes = notes
        self.raw = read_json(self.path / "twin.json")
        self.name: str = self.raw["name"]
        self.joints = tuple(TwinJoint.of(f) for f in self.raw["furniture"])
        verdicts = self.path / "validation.json"
        self.validation = Validation.of(read_json(verdicts)) if verdicts.is_file() else None
        self._temporary: tempfile.TemporaryDirectory[str] | None = None

    def __fspath__(self) -> str:
        return str(self.path)

    def __repr__(self) -> str:
        return f"Twin({str(self.path)!r}: {len(self.joints)} joints)"

    def joint(self, id: str) -> TwinJoint:
        """A joint by its name."""
        return named(self.joints, id)

    @property
    def left_out(self) -> list[tuple[str, str]]:
        """Joints that could not be built: name and reason."""
        return [(left["id"], left["reason"]) for left in self.raw.get("left_out", ())]

    def hands(self, id: str) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """The recorded hands that belong to a joint: clip, times (n), smoothed positions (n x 3)."""
        out = []
        for joint in read_json(self.path / "trajectories.json"):
            for clip, trajectory in joint["clips"] if joint["joint"] == id else ():
                samples = trajectory["samples"]
                times = np.array([s["time_secs"] for s in samples])
                out.append((clip, times, np.array([s["smoothed"] for s in samples]).reshape(-1, 3)))
        return out

    def file(self, name: str) -> Path:
        """One of the twin's files: `scene.urdf`, `scene.xml`, `kitchen.xml`, `scene.glb`, `physics.glb`, `scene.usda`."""
        path = self.path / name
        if not path.is_file():
            raise PawsError(f"{path}: no such file or folder; paws_twin.export writes it")
        return path

    def mujoco(self) -> Any:
        """The scene as a MuJoCo model (`mujoco.MjModel`), with floor, light, handle sites, keyframes `closed` and `open`."""
        return needed("mujoco").MjModel.from_xml_path(str(self.file("scene.xml")))

    def mjspec(self) -> Any:
        """The kitchen without floor and light as a `mujoco.MjSpec`, to attach to a scene of one's own:
        `scene.attach(twin.mjspec(), prefix="kitchen/", frame=scene.worldbody.add_frame())`.
        """
        return needed("mujoco").MjSpec.from_file(str(self.file("kitchen.xml")))


def needed(module: str, extra: str | None = None) -> Any:
    """An optional module, or the way to get it."""
    import importlib

    try:
        return importlib.import_module(module)
    except ImportError as error:
        extra = extra or module
        raise PawsError(f"{module} is not installed: pip install 'paws-twin[{extra}]' ({error})") from error
