"""Which hand is which over time.

A network tells left from right in each picture alone, and is wrong in some. A hand that stays is one hand: its pictures vote.
"""

import dataclasses

import numpy as np

# A hand moves by at the most this many of its own lengths a second in the picture, and this many in all while it is not seen for
# so long, seconds.
SPEED, REACH, HIDDEN_SECS = 10.0, 3.0, 0.6
# What one picture's word on the side is worth at the most: networks are sure of what is wrong, too.
LEAST_DOUBT = 0.15
# Log odds of what the own body says: a forearm that comes from the right end to end of the picture, a hand at its right border.
FOREARM, PLACE = 1.0, 1.0


@dataclasses.dataclass
class Track:
    """One hand: (frame, number of the detection in the frame) in order."""

    members: list
    odds: float = 0.0
    """Log odds that it is a right hand."""

    @property
    def side(self):
        """What its pictures say on the whole."""
        return "right" if self.odds >= 0 else "left"


def size(detection):
    """A hand's size in the picture, pixels."""
    pixels = np.asarray(detection["pixels"])
    return float(np.linalg.norm(pixels.max(axis=0) - pixels.min(axis=0)))


def middle(detection):
    """The middle of wrist and knuckles, pixels."""
    return np.asarray(detection["pixels"])[[0, 5, 9, 13, 17]].mean(axis=0)


def track(frames, times, width):
    """Tracks over the detections of each frame, seconds, in a picture of a width; each detection belongs to exactly one."""
    live, done = [], []
    for number, (detections, now) in enumerate(zip(frames, times)):
        for old in [t for t in live if now - times[t.members[-1][0]] > HIDDEN_SECS]:
            live.remove(old)
            done.append(old)
        pairs = []
        for which_track, t in enumerate(live):
            at, which = t.members[-1]
            last = frames[at][which]
            for i, d in enumerate(detections):
                away = float(np.linalg.norm(middle(d) - middle(last))) / max(size(last), size(d), 1.0)
                # The side counts as a little distance: two hands that meet keep theirs.
                doubt = 0.3 * abs(_right(odds(d, width)) - _right(t.odds))
                if away <= min(max(SPEED * (now - times[at]), 1.0), REACH):
                    pairs.append((away + doubt, which_track, i))
        taken_tracks, taken = set(), set()
        for _, t, i in sorted(pairs):
            if t not in taken_tracks and i not in taken:
                taken_tracks.add(t)
                taken.add(i)
                live[t].members.append((number, i))
                live[t].odds += odds(detections[i], width)
        for i, d in enumerate(detections):
            if i not in taken:
                live.append(Track([(number, i)], odds(d, width)))
    return sorted(done + live, key=lambda t: t.members[0])


def _right(log_odds):
    return 1 / (1 + float(np.exp(-np.clip(log_odds, -20, 20))))


def odds(detection, width):
    """Log odds of a right hand: the network's word, where the forearm comes from and on which side of the picture it is."""
    right = min(max(float(detection["right"]), LEAST_DOUBT), 1 - LEAST_DOUBT)
    pixels = np.asarray(detection["pixels"])
    forearm = pixels[0] - pixels[[5, 9, 13, 17]].mean(axis=0)
    from_right = float(forearm[0] / max(np.linalg.norm(forearm), 1e-9))
    place = float(np.clip(2 * pixels[0, 0] / width - 1, -1, 1))
    return float(np.log(right / (1 - right))) + FOREARM * from_right + PLACE * place


def sides(frames, tracks):
    """`left`, `right` or `None` (a hand too many) for each detection of each frame: at the most one of each in a frame."""
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


def gaps(frames, times, tracks):
    """For each frame the squares (u, v, half; pixels) where a hand was seen shortly before or after and is not seen now."""
    wanted = [[] for _ in frames]
    for t in tracks:
        seen = dict(t.members)
        first, last = t.members[0][0], t.members[-1][0]
        for number in range(max(first - 2, 0), min(last + 2, len(frames) - 1) + 1):
            if number in seen:
                continue
            sides_of = [max((f for f in seen if f < number), default=None), min((f for f in seen if f > number), default=None)]
            near = [f for f in sides_of if f is not None and abs(times[f] - times[number]) <= HIDDEN_SECS]
            if not near:
                continue
            spots = [(frames[f][seen[f]], 1 / abs(f - number)) for f in near]
            total = sum(w for _, w in spots)
            u, v = sum(middle(d) * w for d, w in spots) / total
            wanted[number].append((float(u), float(v), 1.3 * max(size(d) for d, _ in spots)))
    return wanted
