"""Which hand is which."""

import numpy as np
import pytest

from paws_perceive import hands, tracks


def seen(u, right, v=400.0, size=60.0, forearm=0.0):
    """A hand at a place of a picture 640 pixels wide, its wrist below its fingers and so much to the right."""
    pixels = np.tile([u, v], (21, 1)) + np.column_stack([np.zeros(21), np.linspace(size / 2, -size / 2, 21)])
    pixels[0, 0] += forearm * size
    return {"right": right, "score": 0.9, "pixels": pixels.tolist(), "shape": np.zeros((21, 3)).tolist(), "seen": 2}


def sides(frames, step=0.1):
    times = [step * i for i in range(len(frames))]
    return tracks.sides(frames, tracks.track(frames, times, 640))


def test_pictures_that_are_wrong_are_outvoted():
    frames = [[seen(420 + 3 * i, 0.1 if i % 3 == 0 else 0.9)] for i in range(12)]
    assert sides(frames) == [["right"]] * 12


def test_two_hands_stay_apart_when_they_meet():
    left = [seen(200 + 8 * i, 0.2) for i in range(12)]
    right = [seen(440 - 8 * i, 0.8) for i in range(12)]
    assert sides([[r, l] for l, r in zip(left, right)]) == [["right", "left"]] * 12


def test_two_hands_that_both_look_right_are_a_left_and_a_right_one():
    frames = [[seen(150, 0.6), seen(500, 0.95)] for _ in range(8)]
    assert sides(frames) == [["left", "right"]] * 8


def test_a_third_hand_is_nobodys():
    frames = [[seen(150, 0.1), seen(500, 0.9), seen(320, 0.55)] for _ in range(6)]
    assert all(sorted(s for s in frame if s) == ["left", "right"] for frame in sides(frames))


def test_a_hand_that_is_hidden_for_a_moment_is_the_same_and_one_that_comes_back_later_need_not_be():
    frames = [[seen(400, 0.9)]] * 5 + [[]] * 3 + [[seen(410, 0.3)]] * 2
    assert len(tracks.track(frames, [0.1 * i for i in range(10)], 640)) == 1
    assert len(tracks.track(frames, [1.0 * i for i in range(10)], 640)) > 1


@pytest.mark.parametrize("forearm, side", [(0.8, "right"), (-0.8, "left")])
def test_the_forearm_decides_where_the_network_does_not(forearm, side):
    assert sides([[seen(320, 0.5, forearm=forearm)]] * 3) == [[side]] * 3


def test_missed_frames_are_looked_at_again_where_the_hand_must_be():
    frames = [[seen(300 + 10 * i, 0.9)] if i not in (4, 5) else [] for i in range(10)]
    times = [0.1 * i for i in range(10)]
    wanted = tracks.gaps(frames, times, tracks.track(frames, times, 640))
    assert [i for i, w in enumerate(wanted) if w] == [4, 5]
    assert abs(wanted[4][0][0] - 340) < 6
    assert not any(tracks.gaps([[], []], [0.0, 0.1], []))


def test_views_cover_the_place_where_own_hands_come_in():
    for width, height in ((640, 480), (960, 540), (480, 640), (256, 256)):
        whole, *crops = hands.views(width, height)
        assert whole[2] == max(width, height)
        image = np.ones((height, width, 3), np.uint8)
        assert hands.cut(image, whole).sum() == image.sum()
        covered = np.zeros((height, width), bool)
        for left, top, side in crops:
            covered[top : top + side, left : left + side] = True
        assert covered[height - 10].mean() > 0.74 and covered[:, width // 2].mean() > 0.74


def test_one_hand_in_several_views_is_one_hand():
    found = hands.merged([seen(300, 0.9), seen(304, 0.7), seen(500, 0.2)])
    assert [d["seen"] for d in found] == [2, 1]
    assert abs(found[0]["right"] - 0.8) < 1e-9
    assert len(hands.joined(found, [seen(302, 0.9), seen(100, 0.1)])) == 3
