"""Which hand is which over time.

A network tells left from right in each picture alone, and is wrong in some. A hand that stays is one hand: its pictures vote.
"""

import dataclasses

import numpy as np

# A hand moves at the most this many of its own lengths in the picture from one seen frame to the next, and the frames it may hide.
REACH, HIDDEN = 3.0, 4
# What one picture's word on the side is worth at the most: networks are sure of what is wrong, too.
LEAST_DOUBT = 0.15


@dataclasses.dataclass
class Track:
    """One hand: (frame, number of the detection in the frame) in order."""

    members: list
    odds: float = 0.0
    """Log odds that it is a right hand."""

    @property
    def side(self):
        return "right" if self.odds >= 0 else "left"


def size(detection):
    """A hand's size in the picture, pixels."""
    pixels = np.asarray(detection["pixels"])
    return float(np.linalg.norm(pixels.max(axis=0) - pixels.min(axis=0)))


def middle(detection):
    """The middle of wrist and knuckles, pixels."""
    return np.asarray(detection["pixels"])[[0, 5, 9, 13, 17]].mean(axis=0)


def track(frames):
    """Tracks over the detections of each frame; each detection belongs to exactly one."""
    live, done = [], []
    for number, detections in enumerate(frames):
        for old in [t for t in live if number - t.members[-1][0] > HIDDEN]:
            live.remove(old)
            done.append(old)
        pairs = []
        for t in live:
            at, which = t.members[-1]
            last = frames[at][which]
            for i, d in enumerate(detections):
                away = float(np.linalg.norm(middle(d) - middle(last))) / max(size(last), size(d), 1.0)
                # The side counts as a little distance: two hands that meet keep theirs.
                doubt = 0.3 * abs(float(d["right"]) - 1 / (1 + np.exp(-np.clip(t.odds, -20, 20))))
                if away <= REACH / 3 * min(number - at, 3):
                    pairs.append((away + doubt, live.index(t), i))
        taken_tracks, taken = set(), set()
        for _, t, i in sorted(pairs):
            if t not in taken_tracks and i not in taken:
                taken_tracks.add(t)
                taken.add(i)
                live[t].members.append((number, i))
                live[t].odds += _odds(detections[i])
        for i, d in enumerate(detections):
            if i not in taken:
                live.append(Track([(number, i)], _odds(d)))
    return sorted(done + live, key=lambda t: t.members[0])


def _odds(detection):
    right = min(max(float(detection["right"]), LEAST_DOUBT), 1 - LEAST_DOUBT)
    return float(np.log(right / (1 - right)))


def sides(frames, tracks=None):
    """`left`, `right` or `None` (a hand too many) for each detection of each frame: at the most one of each in a frame."""
    tracks = track(frames) if tracks is None else tracks
    out = [[None] * len(detections) for detections in frames]
    at = [{} for _ in frames]
    # The surest first; who meets a surer one of its own side on most of its frames is the other hand.
    for t in sorted(tracks, key=lambda t: (-abs(t.odds), t.members[0])):
        wanted, other = t.side, "left" if t.side == "right" else "right"
        free = {s: sum(s not in at[frame] for frame, _ in t.members) for s in (wanted, other)}
        side = other if 2 * free[wanted] < len(t.members) and free[other] > free[wanted] else wanted
        for frame, i in t.members:
            if side not in at[frame]:
                at[frame][side] = i
                out[frame][i] = side
    return out


def gaps(frames, tracks):
    """For each frame the squares (u, v, half; pixels) where a hand was seen shortly before or after and is not seen now."""
    wanted = [[] for _ in frames]
    for t in tracks:
        seen = dict(t.members)
        first, last = t.members[0][0], t.members[-1][0]
        for number in range(max(first - 2, 0), min(last + 2, len(frames) - 1) + 1):
            if number in seen:
                continue
            near = sorted(seen, key=lambda f: abs(f - number))[:2]
            spots = [(frames[f][seen[f]], 1 / abs(f - number)) for f in near]
            total = sum(w for _, w in spots)
            u, v = sum(middle(d) * w for d, w in spots) / total
            wanted[number].append((float(u), float(v), 1.3 * max(size(d) for d, _ in spots)))
    return wanted
