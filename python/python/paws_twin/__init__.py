"""From an egocentric recording of opened doors and drawers to a kitchen that simulates.

    import paws_twin
    twin = paws_twin.twin("recording")            # a folder, or paws_twin.Recording.from_arrays(...)
    for joint in twin.validation.joints:
        print(joint.id, joint.verdict, joint.reason)
    model = twin.mujoco()                          # pip install 'paws-twin[mujoco]'

Every function runs the command of its name; what the command says on an error is the text of `PawsError`. Metres, radians,
seconds, newtons; poses are world from camera; +Z is up; positive motion opens. See docs/python.md.
"""

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
