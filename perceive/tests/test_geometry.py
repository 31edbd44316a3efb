"""Where a hand is placed, on hands whose place is known."""

import numpy as np
import pytest

from paws_perceive import geometry
from paws_perceive.geometry import ANCHORS, BELOW_SKIN_M, Camera

CAMERA = Camera(500.0, 500.0, 319.5, 239.5)


def hand(palm_m=0.095, bend=0.0):
    """A flat right hand whose fingers point up the picture, bent towards the camera; the wrist at the origin."""
    across = {1: 0.045, 5: 0.025, 9: 0.0, 13: -0.02, 17: -0.04}
    out = np.zeros((21, 3))
    for first, x in across.items():
        for i in range(4):
            length = (0.95 - abs(x)) * 0.1 + 0.025 * i if first > 1 else 0.03 + 0.025 * i
            out[first + i] = [x, -length, -bend * 0.02 * i]
    return geometry.sized(out, palm_m)


def turned(points, angles):
    for axis, angle in enumerate(angles):
        step = np.zeros(3)
        step[axis] = angle
        points = points @ geometry._turn(step).T
    return points


def depth_of(joints, behind=1.5, hide=(), noise=0.0):
    """A depth image that shows skin around each joint, and a wall; `hide`: joints over which something lies 20 cm nearer."""
    depth = np.full((480, 640), behind)
    v, u = np.mgrid[0:480, 0:640]
    order = sorted(range(21), key=lambda j: -joints[j, 2])
    for joint in order:
        pixel = CAMERA.project(joints[joint : joint + 1])[0]
        near = 0.2 if joint in hide else 0.0
        depth[(u - pixel[0]) ** 2 + (v - pixel[1]) ** 2 < 12**2] = joints[joint, 2] - BELOW_SKIN_M - near
    return depth + np.random.default_rng(0).normal(0, noise, depth.shape) if noise else depth


@pytest.mark.parametrize("angles", [(0, 0, 0), (0.4, 0, 0), (0, 0.5, 1.2), (-0.5, 0.3, -2.0)])
@pytest.mark.parametrize("place", [(0, 0, 0.4), (0.2, 0.15, 0.7), (-0.25, 0.1, 0.6)])
def test_pixels_and_size_give_the_place(angles, place):
    truth = turned(hand(), angles) + place
    joints, rest = geometry.pnp(hand_as_seen(angles), CAMERA.project(truth), CAMERA)
    assert rest < 0.01
    assert np.abs(joints - truth).max() < 1e-3


def hand_as_seen(angles):
    """A network's shape: turned as the camera sees it, some 15 degrees off."""
    return turned(turned(hand(), angles), (0.2, -0.1, 0.1))


def test_a_person_of_another_size_is_put_right_by_depth():
    truth = turned(hand(0.08), (0.3, 0.2, 0.1)) + [0.1, 0.1, 0.5]
    pixels, depth = CAMERA.project(truth), depth_of(truth, noise=0.002)
    shape = turned(hand(0.095), (0.3, 0.2, 0.1))
    by_size = geometry.place(shape, pixels, CAMERA, 0.095, 0.08)
    by_depth = geometry.place(shape, pixels, CAMERA, 0.095, 0.08, depth)
    off = lambda placed: abs(np.mean(placed.joints[:, 2] - truth[:, 2]))
    assert by_size.by == "size" and off(by_size) > 0.05 and by_size.along_m > 0.03
    assert by_depth.by == "depth" and off(by_depth) < 0.01 and by_depth.along_m < 0.02


def test_depth_tells_how_a_palm_is_tilted_that_the_network_saw_the_other_way():
    truth = turned(hand(), (0.8, 0, 0)) + [0, 0, 0.6]
    shape = turned(hand(), (-0.8, 0, 0))
    placed = geometry.place(shape, CAMERA.project(truth), CAMERA, 0.095, 0.08, depth_of(truth))
    assert np.abs(placed.joints[list(ANCHORS)] - truth[list(ANCHORS)]).max() < 0.015


@pytest.mark.parametrize("hidden", [(0,), (5, 9), (17,)])
def test_what_lies_over_a_knuckle_does_not_move_the_hand(hidden):
    truth = hand() + [0, 0.05, 0.5]
    placed = geometry.place(hand(), CAMERA.project(truth), CAMERA, 0.095, 0.08, depth_of(truth, hide=hidden))
    assert np.abs(placed.joints - truth).max() < 0.012


def test_the_fingertips_depth_is_never_read():
    truth = hand(bend=1.0) + [0, 0.05, 0.5]
    depth = depth_of(truth)
    other = depth.copy()
    for joint in (4, 8, 12, 16, 20):
        u, v = CAMERA.project(truth[joint : joint + 1])[0].round().astype(int)
        other[v - 6 : v + 7, u - 6 : u + 7] = 0.3
    a, b = (geometry.place(hand(bend=1.0), CAMERA.project(truth), CAMERA, 0.095, 0.08, d) for d in (depth, other))
    assert np.array_equal(a.joints, b.joints)


def test_a_picture_of_a_hand_on_a_far_wall_is_no_hand():
    truth = hand() + [0, 0, 0.5]
    assert geometry.place(hand(), CAMERA.project(truth), CAMERA, 0.095, 0.08, np.full((480, 640), 3.0)) is None


def test_without_a_value_of_depth_the_size_tells():
    truth = hand() + [0, 0, 0.5]
    placed = geometry.place(hand(), CAMERA.project(truth), CAMERA, 0.095, 0.08, np.zeros((480, 640)))
    assert placed.by == "size" and np.abs(placed.joints - truth).max() < 1e-3


def test_a_persons_size_is_the_median_of_what_depth_tells_and_an_adults_where_it_tells_little():
    readings = [0.085 + 0.004 * np.sin(i) for i in range(40)] + [0.3, 0.01]
    palm_m, std = geometry.person_size(readings)
    assert abs(palm_m - 0.085) < 0.002 and 0.01 < std < 0.05
    assert geometry.person_size(readings[:5]) == (geometry.PALM_M, geometry.SIZE_STD)
    truth = hand(0.088) + [0, 0, 0.5]
    pixels = CAMERA.project(truth)
    told = geometry.anchor_depths(pixels, depth_of(truth), CAMERA)
    assert abs(geometry.measured_palm(pixels, told, CAMERA) - 0.088) < 0.002


def test_errors_of_depth_and_their_price():
    """Along the ray: a factor moves the hand by itself, noise hardly, smeared edges less than a hand's thickness."""
    truth = turned(hand(), (0.3, 0, 0)) + [0.05, 0.05, 0.5]
    pixels = CAMERA.project(truth)
    depth = depth_of(truth)
    smeared = sum(np.roll(depth, s, axis=1) for s in (-4, -2, 0, 2, 4)) / 5
    for image, limit in ((depth * 1.03, 0.02), (depth_of(truth, noise=0.01), 0.006), (smeared, 0.012)):
        placed = geometry.place(truth, pixels, CAMERA, 0.095, 0.08, image)
        assert abs(np.mean(placed.joints[:, 2] - truth[:, 2])) < limit


def test_a_camera_that_lies_on_its_side():
    half = np.sqrt(0.5)
    world = geometry.to_world(np.array([[1.0, 0, 0], [0, 0, 1.0]]), [10, 20, 30], [half, 0, 0, half])
    assert np.allclose(world, [[10, 21, 30], [10, 20, 31]])
