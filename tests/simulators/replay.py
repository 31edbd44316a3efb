"""What a recorded hand does with a part: the law of `paws validate`, once more, for any simulator.

The hand is a spring and a damper between where it was recorded and the grip on the part: critical on the part's mass,
slack for the first centimetre and no stronger than a person. All of it is in the twin's own files: `trajectories.json`
(the hands), `config.toml` (stiffness, slack, force, time step) and `validation.json` (the grip, and rapier's answer).
"""

import json
import math
import tomllib
from dataclasses import dataclass

import numpy as np

# Two engines agree on the tracking error to a share of it, or to a length where it is small: rapier works in single
# precision, and MuJoCo's friction, stops and contacts are soft.
AGREE_SHARE = 0.05
AGREE_M = 5e-4
# Coefficient of friction between solids in rapier's world.
RUBBING = 0.2


@dataclass(frozen=True)
class Law:
    """Values of `[validation]`."""

    step_secs: float
    hand_stiffness_n_per_m: float
    hand_force_max_n: float
    grip_slack_m: float

    def force(self, distance, velocity, damping):
        """Of the hand, N, for its distance from the grip (m) and the difference of their velocities (m/s)."""
        far = np.linalg.norm(distance)
        taut = 1 - self.grip_slack_m / far if far > self.grip_slack_m else 0.0
        pull = distance * taut * self.hand_stiffness_n_per_m + velocity * damping
        strength = np.linalg.norm(pull)
        return pull * self.hand_force_max_n / strength if strength > self.hand_force_max_n else pull


@dataclass(frozen=True)
class Clip:
    """A recorded hand on a part, and rapier's answer."""

    part: object
    name: str
    times: np.ndarray
    path: np.ndarray
    grip: np.ndarray
    rapier_rms_m: float
    # Solids of the part and others that touch when closed: between those nothing is felt.
    apart: list


def law(twin):
    """The law that the twin was validated with."""
    with open(twin.folder / "config.toml", "rb") as file:
        values = tomllib.load(file)["validation"]
    return Law(**{name: values[name] for name in Law.__dataclass_fields__})


def clips(twin):
    """All clips of a twin; none where it is not of a recording."""
    if not (twin.folder / "validation.json").exists() or not (twin.folder / "trajectories.json").exists():
        return []
    read = lambda name: json.loads((twin.folder / name).read_text(encoding="utf-8"))
    hands = {(h["joint"], name): t["samples"] for h in read("trajectories.json") for name, t in h["clips"]}
    parts = {p.name: p for p in twin.parts}
    found = []
    for joint in read("validation.json")["joints"]:
        for clip in joint["clips"]:
            samples, replay = hands[joint["id"], clip["clip"]], clip["replay"]
            times = np.array([s["time_secs"] for s in samples])
            path = np.array([s["smoothed"] for s in samples])
            grip, apart = np.array(replay["grip"]), replay["closed_overlaps"]
            part = parts[joint["id"]]
            found.append(Clip(part, clip["clip"], times - times[0], path, grip, replay["rms_m"], apart))
    return found


def opening(part, grip, point):
    """How far a part is open whose grip is at a point."""
    if not part.turns:
        return float((point - grip) @ part.axis)
    across = lambda p: (p - part.origin) - part.axis * (part.axis @ (p - part.origin))
    a, b = across(grip), across(point)
    return math.atan2(part.axis @ np.cross(a, b), a @ b)


def track(engine, clip, law):
    """Root mean square distance of hand and grip on the way there, metres. The engine's step is the law's."""
    part, dt, end = clip.part, law.step_secs, clip.times[-1]
    damping = 2 * math.sqrt(law.hand_stiffness_n_per_m * max(part.body.mass, 0.1))
    # After its last sample the hand stays.
    hand = lambda t: np.array([np.interp(t, clip.times, x) for x in clip.path.T])
    engine.put({part.name: min(max(opening(part, clip.grip, clip.path[0]), 0.0), part.upper)})
    steps, squares = max(1, math.ceil(end / dt)), 0.0
    for i in range(steps):
        q, speed = engine.state(part.name)
        at = part.at(clip.grip, q)
        velocity = speed * (part.cross @ (at - part.origin) if part.turns else part.axis)
        now, then = hand(i * dt), hand((i + 1) * dt)
        engine.step((part, law.force(now - at, (then - now) / dt - velocity, damping), at))
        squares += float(np.sum((then - part.at(clip.grip, engine.state(part.name)[0])) ** 2))
    return math.sqrt(squares / steps)
