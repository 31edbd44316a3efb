"""Results as plain objects: numbers and numpy arrays of the JSON that `paws` writes, which each keeps as `raw`.

Metres, radians, newtons, seconds; the world frame of the recording, +Z up; positive motion opens.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

Raw = Mapping[str, Any]


def _array(value: Any) -> np.ndarray | None:
    return None if value is None else np.asarray(value, dtype=float)


@dataclass(frozen=True, eq=False)
class Box:
    """A box: middle, half sizes, and its axes in the world as the columns of `rotation`."""

    center: np.ndarray
    half: np.ndarray
    rotation: np.ndarray

    @classmethod
    def of(cls, raw: Raw) -> Box:
        return cls(*(np.asarray(raw[key], dtype=float) for key in ("center", "half", "R")))


@dataclass(frozen=True, eq=False)
class Prediction:
    """The answer for one clip; `kind` is None where there is none, and `reason` says why."""

    recording: str
    clip: str
    kind: str | None
    axis: np.ndarray | None
    origin: np.ndarray | None
    range: float | None
    range_std: float | None
    confidence: float | None
    joint_confidence: float | None
    joint: str | None
    part_box: Box | None
    reason: str | None
    refuted: tuple[str, ...]
    raw: Raw = field(repr=False)

    @classmethod
    def of(cls, raw: Raw) -> Prediction:
        box = raw.get("part_box")
        return cls(
            recording=raw["recording"],
            clip=raw["clip"],
            kind=raw.get("type"),
            axis=_array(raw.get("axis")),
            origin=_array(raw.get("origin")),
            range=raw.get("range"),
            range_std=raw.get("range_std"),
            confidence=raw.get("confidence"),
            joint_confidence=raw.get("joint_confidence"),
            joint=raw.get("joint"),
            part_box=Box.of(box) if box else None,
            reason=raw.get("reason"),
            refuted=tuple(str(r) for r in raw.get("refuted", ())),
            raw=raw,
        )


@dataclass(frozen=True, eq=False)
class PathJoint:
    """The joint of a bare path; `kind` is None where there is none, and `reason` says why."""

    kind: str | None
    axis: np.ndarray | None
    origin: np.ndarray | None
    range: float | None
    residual_m: float | None
    ambiguous: bool
    reason: str
    raw: Raw = field(repr=False)

    @classmethod
    def of(cls, raw: Raw) -> PathJoint:
        found = raw["outcome"].get("found")
        if found is None:
            return cls(None, None, None, None, None, False, str(raw["outcome"].get("abstained", "")), raw)
        joint = found["joint"]
        return cls(
            kind=joint["kind"],
            axis=_array(joint["axis"]),
            origin=_array(joint["origin"]),
            range=found.get("range"),
            residual_m=found.get("residual_m"),
            ambiguous=bool(found.get("ambiguous", False)),
            reason=str(found.get("reason", "")),
            raw=raw,
        )


@dataclass(frozen=True, eq=False)
class Replay:
    """The replay of one clip: the recorded hand and the part's handle, a row a moment."""

    clip: str
    action: str
    observed_range: float
    rms_m: float
    max_m: float
    peak_force_n: float
    hand: np.ndarray
    handle: np.ndarray
    raw: Raw = field(repr=False)

    @classmethod
    def of(cls, raw: Raw) -> Replay:
        replay = raw["replay"]
        return cls(
            clip=raw["clip"],
            action=raw["action"],
            observed_range=raw["observed_range"],
            rms_m=replay["rms_m"],
            max_m=replay["max_m"],
            peak_force_n=replay["peak_force_n"],
            hand=np.asarray(replay["hand"], dtype=float).reshape(-1, 3),
            handle=np.asarray(replay["handle"], dtype=float).reshape(-1, 3),
            raw=raw,
        )


@dataclass(frozen=True, eq=False)
class JointVerdict:
    """What physics says of a joint: `verdict` is "pass", "fail" or "undetermined".

    `margin_nats` is the logarithm of how much likelier the joint is than its best rival; None where nothing was compared.
    """

    id: str
    verdict: str
    reason: str
    rms_m: float
    peak_force_n: float
    margin_nats: float | None
    clips: tuple[Replay, ...]
    raw: Raw = field(repr=False)

    @classmethod
    def of(cls, raw: Raw) -> JointVerdict:
        return cls(
            id=raw["id"],
            verdict=raw["verdict"],
            reason=raw["reason"],
            rms_m=raw["rms_m"],
            peak_force_n=raw["peak_force_n"],
            margin_nats=raw.get("margin_nats"),
            clips=tuple(Replay.of(c) for c in raw["clips"]),
            raw=raw,
        )


@dataclass(frozen=True, eq=False)
class Validation:
    """A verdict on each joint; `notes` is what the command said beside it."""

    joints: tuple[JointVerdict, ...]
    notes: tuple[str, ...]
    raw: Raw = field(repr=False)

    @classmethod
    def of(cls, raw: Raw, notes: tuple[str, ...] = ()) -> Validation:
        return cls(tuple(JointVerdict.of(j) for j in raw["joints"]), notes, raw)

    def joint(self, id: str) -> JointVerdict:
        """The verdict on a joint, by its name."""
        return named(self.joints, id)

    @property
    def passed(self) -> bool:
        """Whether there is a joint, and all pass."""
        return bool(self.joints) and all(j.verdict == "pass" for j in self.joints)


@dataclass(frozen=True, eq=False)
class TwinJoint:
    """A part that opens, and how. `upper` is how far it opens, `observed` how far the recording has seen it."""

    id: str
    label: str
    kind: str
    axis: np.ndarray
    origin: np.ndarray
    upper: float
    observed: float | None
    probability: float | None
    damping: float
    friction: float
    handle: np.ndarray
    bounds: Box
    raw: Raw = field(repr=False)

    @classmethod
    def of(cls, furniture: Raw) -> TwinJoint:
        part = furniture["part"]
        joint = part["joint"]
        phi = joint["articulation"]
        return cls(
            id=part["id"],
            label=part["label"],
            kind=phi["kind"],
            axis=np.asarray(phi["axis"], dtype=float),
            origin=np.asarray(phi["origin"], dtype=float),
            upper=joint["upper"],
            observed=joint.get("observed"),
            probability=joint.get("probability"),
            damping=joint["damping"],
            friction=joint["friction"],
            handle=np.asarray(part["handle"], dtype=float),
            bounds=Box.of(part["bounds"]),
            raw=furniture,
        )


@dataclass(frozen=True)
class CheckPoint:
    """One point of "simulation-ready": `verdict` is "pass", "fail", "not_judged" or "not_applicable"."""

    id: int
    title: str
    verdict: str
    faults: tuple[str, ...]
    told: tuple[str, ...]


@dataclass(frozen=True)
class Checked:
    """A file's points; `error` says why it could not be read."""

    file: str
    error: str | None
    points: tuple[CheckPoint, ...]
    notes: tuple[str, ...]

    @classmethod
    def of(cls, raw: Raw) -> Checked:
        points = tuple(
            CheckPoint(p["id"], p["title"], p["verdict"], tuple(p["faults"]), tuple(p["told"])) for p in raw["points"]
        )
        return cls(raw["file"], raw.get("error"), points, tuple(raw["notes"]))

    @property
    def ready(self) -> bool:
        """Whether the file was read and no point fails or could not be judged."""
        return self.error is None and all(p.verdict in ("pass", "not_applicable") for p in self.points)

    @property
    def faults(self) -> tuple[str, ...]:
        """All that is wrong."""
        return tuple(fault for point in self.points for fault in point.faults)


@dataclass(frozen=True, eq=False)
class Report:
    """Predictions against a truth. `rules[name]` holds the shares `m`, `ma` and `mao` of all clips; `table` is for people."""

    clips: int
    answered: int
    rules: Mapping[str, Mapping[str, float]]
    table: str
    raw: Raw = field(repr=False)

    @classmethod
    def of(cls, raw: Raw, table: str) -> Report:
        return cls(raw["clips"], raw["answered"], {r["rule"]: r["micro"] for r in raw["rules"]}, table, raw)


def named(items: tuple[Any, ...], id: str) -> Any:
    """The one of that id."""
    for item in items:
        if item.id == id:
            return item
    raise KeyError(f"{id}: there is no such joint; there are {', '.join(i.id for i in items) or 'none'}")
