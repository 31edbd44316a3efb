"""The commands as functions."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Union

import numpy as np

from ._call import AnyPath, PawsError, Progress, call, config_file
from ._rerun import rerun_log
from .recording import Recording, read_json
from .results import Checked, PathJoint, Prediction, Report, Validation
from .twins import Twin

#: Parameters: a TOML file, a mapping of its tables, or the word "paper" or "paper_s".
Config = Union[AnyPath, Mapping[str, Any], None]

#: Columns of a bare path by how many it has.
_COLUMNS = {3: "x,y,z", 4: "t,x,y,z", 7: "x,y,z,qx,qy,qz,qw", 8: "t,x,y,z,qx,qy,qz,qw"}


def twin(
    recording: AnyPath,
    out: AnyPath | None = None,
    *,
    config: Config = None,
    progress: Progress | None = None,
    rerun: AnyPath | None = None,
    **options: Any,
) -> Twin:
    """Makes a twin of a recording (a folder or a Recording), into `out` or a temporary folder. With `rerun="file.rrd"` a log for
    the rerun viewer is written, too.

    `config` is a TOML file, a mapping of its tables, or the word "paper" or "paper_s". `options` are those of `paws twin` with
    underscores: `as_is`, `fix`, `follow_links`, `keep`, `vlm_url`, `vlm_model`, ...
    """
    temporary = tempfile.TemporaryDirectory(prefix="paws_twin_") if out is None else None
    folder = Path(temporary.name) / "twin" if temporary else Path(out or "")
    with config_file(config) as file:
        said = call("twin", recording, progress=progress, out=folder, config=file, **options)
    made = Twin(folder, said.notes)
    made._temporary = temporary
    if rerun is not None:
        rerun_log(recording, made, rerun)
    return made


def infer(
    recordings: AnyPath | Sequence[AnyPath],
    *,
    config: Config = None,
    progress: Progress | None = None,
    **options: Any,
) -> list[Prediction]:
    """The joints of a recording, or of a list of them, one answer a clip, without building a twin. Options as of `paws infer`:
    `physics`, `as_is`, `fix`, ...
    """
    with tempfile.TemporaryDirectory(prefix="paws_infer_") as folder, config_file(config) as file:
        out = Path(folder) / "predictions.json"
        call("infer", *_several(recordings), progress=progress, out=out, config=file, **options)
        return [Prediction.of(row) for row in read_json(out)["predictions"]]


def infer_path(path: Any, *, config: Config = None, **options: Any) -> PathJoint:
    """The joint that a bare path shows: a file, or an array with a row a moment: x y z, with a time in front, and a
    quaternion x y z w behind where there is one (3, 4, 7 or 8 columns).
    """
    with tempfile.TemporaryDirectory(prefix="paws_infer_") as folder, config_file(config) as file:
        out = Path(folder) / "joints.json"
        call("infer", _path_file(path, Path(folder), "path"), out=out, config=file, **options)
        return PathJoint.of(read_json(out)[0])


def validate(
    model: AnyPath,
    trajectories: Any = None,
    *,
    config: Config = None,
    progress: Progress | None = None,
    **options: Any,
) -> Validation:
    """Replays recorded hands on a twin, or on anybody's URDF or MJCF, or joints found elsewhere.

    For what is not a twin of ours `trajectories` maps joints to paths (files or arrays, as for `infer_path`); one path alone
    is that of the joint which it fits. `options`: `action`, `units`, `points`, ...
    """
    if trajectories is None:
        trajectories = {}
    elif not isinstance(trajectories, Mapping):
        trajectories = {None: trajectories}
    with tempfile.TemporaryDirectory(prefix="paws_validate_") as folder, config_file(config) as file:
        words = []
        for number, (joint, path) in enumerate(trajectories.items()):
            written = _path_file(path, Path(folder), f"path_{number}")
            words.append(str(written) if joint is None else f"{joint}={written}")
        out = Path(folder) / "validation.json"
        said = call("validate", model, progress=progress, out=out, config=file, trajectory=words, **options)
        return Validation.of(read_json(out), said.notes)


def check(*files: AnyPath) -> list[Checked]:
    """The static points of "simulation-ready" of URDF, MJCF and glTF files, or of folders with such files."""
    said = call("check", *files, json=True)
    return [Checked.of(raw) for raw in json.loads(said.out)]


def evaluate(
    predictions: AnyPath | Sequence[Prediction], truth: AnyPath | Sequence[AnyPath], **options: Any
) -> Report:
    """Predictions (a twin, its folder, a predictions.json, a list of Prediction) against the truth of a recording or of a list
    of them. Options as of `paws evaluate`: `against`, `csv`, `points`, ...
    """
    with tempfile.TemporaryDirectory(prefix="paws_evaluate_") as folder:
        given: Any = predictions
        if isinstance(given, Sequence) and given and isinstance(given[0], Prediction):
            written = Path(folder) / "predictions.json"
            written.write_text(json.dumps({"predictions": [dict(p.raw) for p in given]}), encoding="utf-8")
            given = written
        out = Path(folder) / "report.json"
        said = call("evaluate", given, *_several(truth), json=out, **options)
        return Report.of(read_json(out), said.out)


def export(
    twin_or_joints: AnyPath, out: AnyPath, formats: Sequence[str] | None = None, **options: Any
) -> list[Path]:
    """Writes a twin, or joints that another program found (docs/joints-format.md), as files in `out`; answers with them.

    Formats: urdf, mjcf, gltf, gltf-physics, usd, primitives (all of these by default), arti4d, egoarti, usdnet.
    """
    chosen = ",".join(formats) if formats is not None else None
    said = call("export", twin_or_joints, out=Path(out), format=chosen, **options)
    return [Path(line) for line in said.out.splitlines() if line.strip()]


def import_recording(
    sources: AnyPath | Sequence[AnyPath],
    out: AnyPath | None = None,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> Recording:
    """Makes a recording of what a device, a data set or networks wrote (docs/import.md); `sources` is a path, a `KIND=PATH` or a
    list of them, the most important one first. Options as of `paws import`: `fps`, `rotate`, `up`, `source_fps`, ...

    What was joined, left out and is missing is in `recording.table("import.json")`.
    """
    return _recording("import", sources, out, progress, options)


def synth(out: AnyPath | None = None, *, progress: Progress | None = None, **options: Any) -> Recording:
    """Renders the recording of a synthetic kitchen with a known answer. Options as of `paws synth`: `seed`, `tier`, `width`,
    `parts`, ...
    """
    return _recording("synth", (), out, progress, options)


def _recording(
    command: str,
    sources: AnyPath | Sequence[AnyPath],
    out: AnyPath | None,
    progress: Progress | None,
    options: Mapping[str, Any],
) -> Recording:
    temporary = tempfile.TemporaryDirectory(prefix="paws_recording_") if out is None else None
    folder = Path(temporary.name) / "recording" if temporary else Path(out or "")
    call(command, *_several(sources), progress=progress, out=folder, **options)
    made = Recording(folder)
    made._temporary = temporary
    return made


def _several(paths: Any) -> list[Any]:
    return list(paths) if isinstance(paths, (list, tuple)) else [paths]


def _path_file(path: Any, folder: Path, name: str) -> Path:
    """A path's file: the one given, or the array written into `folder`."""
    if isinstance(path, (str, Path)):
        return Path(path)
    rows = np.asarray(path, dtype=float)
    columns = _COLUMNS.get(rows.shape[1]) if rows.ndim == 2 else None
    if columns is None:
        raise PawsError(f"a path of shape {rows.shape}; give n rows of x y z, t x y z, or either with qx qy qz qw behind")
    file = folder / f"{name}.csv"
    lines = [columns, *(",".join(repr(float(v)) for v in row) for row in rows)]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file
