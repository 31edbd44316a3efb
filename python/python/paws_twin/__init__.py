"""From an egocentric recording of opened doors and drawers to a kitchen that simulates.

    import paws_twin
    twin = paws_twin.twin("recording")            # a folder, or paws_twin.Recording.from_arrays(...)
    for joint in twin.validation.joints:
        print(joint.id, joint.verdict, joint.reason)
    model = twin.mujoco()                          # pip install 'paws-twin[mujoco]'

Every function runs the command of its name; what the command says on an error is the text of `PawsError`. Metres, radians,
seconds, newtons; poses are world from camera; +Z is up; positive motion opens. See docs/python.md.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._call import PawsError, Progress
    from ._commands import check, evaluate, export, import_recording, infer, infer_path, synth, twin, validate
    from ._rerun import rerun_log
    from .recording import Hand, Recording
    from .results import (
        Box,
        Checked,
        CheckPoint,
        JointVerdict,
        PathJoint,
        Prediction,
        Replay,
        Report,
        TwinJoint,
        Validation,
    )
    from .twins import Twin

__all__ = [
    "Box",
    "CheckPoint",
    "Checked",
    "Hand",
    "JointVerdict",
    "PathJoint",
    "PawsError",
    "Prediction",
    "Progress",
    "Recording",
    "Replay",
    "Report",
    "Twin",
    "TwinJoint",
    "Validation",
    "check",
    "evaluate",
    "export",
    "import_recording",
    "infer",
    "infer_path",
    "rerun_log",
    "synth",
    "twin",
    "validate",
]

# Imported when they are asked for: the command `paws` lives in this package, too, and does not wait for numpy.
_HOME = {
    **dict.fromkeys(("PawsError", "Progress"), "_call"),
    **dict.fromkeys(("Hand", "Recording"), "recording"),
    **dict.fromkeys(("check", "evaluate", "export", "import_recording", "infer", "infer_path"), "_commands"),
    **dict.fromkeys(("synth", "twin", "validate"), "_commands"),
    "rerun_log": "_rerun",
    "Twin": "twins",
}


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = getattr(import_module(f".{_HOME.get(name, 'results')}", __name__), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
