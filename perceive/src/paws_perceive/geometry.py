"""Where a hand is, from where its joints are in the picture.

Camera axes are OpenCV's (x right, y down, z forward), lengths metres, pixels counted from pixel centres. A hand has 21 joints in
MANO's order: the wrist, then four a finger from the thumb on.
"""

import dataclasses

import numpy as np

WRIST, KNUCKLES = 0, (5, 9, 13, 17)
# Joints whose pixels show the hand itself and not what it holds; a fingertip lies over the part that it touches.
ANCHORS = (WRIST, *KNUCKLES)
# From the wrist to the middle finger's knuckle of an adult, and how far persons differ; metres.
PALM_M, PALM_LIMITS_M = 0.095, (0.075, 0.115)
# A joint lies this far below the skin that depth sees, metres: half of a hand's thickness.
BELOW_SKIN_M = 0.012
# Half of the patch whose median depth counts, metres on the hand: within the back of a hand at each knuckle.
PATCH_M = 0.008
# Wrist and knuckles are no farther from each other along the axis, metres: an adult's palm.
TOGETHER_M = 0.1
# A hand whose size and depth disagree by this factor is none. Networks take tilted palms for small ones, by up to half.
NONE_SHARE = 2.5
# How far the size of a person's hand may be off where no depth told it, as a share: hands of adults.
SIZE_STD = 0.08
# How well a network's shape of a hand gives its distance, as a share, beside its size.
SHAPE_STD = 0.06
# What a depth sensor's median at arm's length is worth, metres.
DEPTH_STD_M = 0.006


@dataclasses.dataclass(frozen=True)
class Camera:
    """A pinhole: focal lengths and principal point in pixels."""

    fx: float
    fy: float
    cx: float
    cy: float

    def project(self, points):
        """Pixels of points in front of the camera."""
        z = np.maximum(points[:, 2:3], 1e-6)
        return points[:, :2] / z * [self.fx, self.fy] + [self.cx, self.cy]


@dataclasses.dataclass(frozen=True)
class Placed:
    """A hand in the camera's frame."""

    joints: np.ndarray
    """21 x 3, metres."""
    along_m: float
    """Standard deviation along the ray, metres."""
    across_m: float
    """Standard deviation across the ray, metres."""
    by: str
    """`depth` or `size`: what told the distance."""


def palm(shape):
    """From the wrist to the middle finger's knuckle, as the palm's five lengths together tell it; the shape's unit.

    One length of a network's shape varies by a tenth and more with the hand's pose; the five together by half of that.
    """
    # Each length as a share of that from the wrist to the middle finger's knuckle.
    lengths = ((0, 5, 1.0), (0, 9, 1.0), (0, 13, 0.94), (0, 17, 0.91), (5, 17, 0.66))
    return float(np.median([np.linalg.norm(shape[a] - shape[b]) / share for a, b, share in lengths]))


def sized(shape, palm_m):
    """The shape about its wrist, its palm of a length."""
    about = shape - shape[WRIST]
    return about * (palm_m / max(palm(shape), 1e-6))


def _turn(w):
    angle = np.linalg.norm(w)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = w / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def pnp(shape, pixels, camera, told=(), rounds=25):
    """The shape turned and moved so that it projects to the pixels: 21 x 3, and the root mean square of what is left, pixels.

    `told`: (joint, distance along the axis in metres) of joints whose distance is known; one far off counts little. `None` where
    no turn explains the pixels.
    """
    rays = (pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy]
    spread = np.linalg.norm(rays[list(KNUCKLES)] - rays[WRIST], axis=1).mean()
    width = np.linalg.norm(shape[list(KNUCKLES), :2] - shape[WRIST, :2], axis=1).mean()
    if spread < 1e-9 or not np.isfinite(spread + width):
        return None
    z = float(np.median([d for _, d in told])) if len(told) else max(width / spread, 0.05)
    # A palm from afar looks the same tilted to and fro: known distances tell which, and a start near each finds it.
    tilts = (0.0, 1.0, -1.0) if len(told) else (0.0,)
    best = None
    for tilt in tilts:
        start = (_turn(np.array([tilt, 0.0, 0.0])), np.array([rays[WRIST, 0] * z, rays[WRIST, 1] * z, z]))
        found = _least_squares(shape, rays, told, start, rounds)
        if found is not None and (best is None or found[0] < best[0]):
            best = found
    if best is None:
        return None
    joints = shape @ best[1].T + best[2]
    rest = np.sqrt(np.mean(np.sum((camera.project(joints) - pixels) ** 2, axis=1)))
    return joints, float(rest)


def _least_squares(shape, rays, told, start, rounds):
    """Levenberg and Marquardt's steps from a start: (cost, turn, move), or `None`."""
    # Fingers bend, and networks place them worse than the palm.
    weights = np.full(len(shape), 0.5)
    weights[list(ANCHORS)] = 1.0
    known = np.array([j for j, _ in told], dtype=int)
    distances = np.array([d for _, d in told])

    def error_at(turn, move):
        at = shape @ turn.T + move
        if np.any(at[:, 2] < 0.02):
            return None
        seen = ((at[:, :2] / at[:, 2:] - rays) * weights[:, None]).reshape(-1)
        off = (at[known, 2] - distances) / distances if len(known) else np.zeros(0)
        # Huber's weights: beyond this share of the distance a reading is one of something else.
        trust = np.sqrt(np.minimum(1.0, 0.04 / np.maximum(np.abs(off), 1e-9)))
        return at, np.concatenate([seen, off * trust]), trust

    turn, move = start
    now = error_at(turn, move)
    if now is None:
        return None
    damping, cost = 1e-3, float(now[1] @ now[1])
    for _ in range(rounds):
        at, error, trust = now
        points = at - move
        inverse = 1 / at[:, 2]
        by_point = np.zeros((len(shape), 2, 3))
        by_point[:, 0, 0] = by_point[:, 1, 1] = inverse
        by_point[:, :, 2] = -at[:, :2] * inverse[:, None] ** 2
        cross = np.zeros((len(shape), 3, 3))
        cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = points[:, 2], -points[:, 1], points[:, 0]
        cross -= cross.transpose(0, 2, 1).copy()
        jacobian = (np.concatenate([by_point @ cross, by_point], axis=2) * weights[:, None, None]).reshape(-1, 6)
        if len(known):
            rows = np.zeros((len(known), 6))
            rows[:, :3] = cross[known, 2]
            rows[:, 5] = 1
            jacobian = np.concatenate([jacobian, rows * (trust / distances)[:, None]])
        normal = jacobian.T @ jacobian
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), -jacobian.T @ error)
        next_turn, next_move = _turn(step[:3]) @ turn, move + step[3:]
        tried = error_at(next_turn, next_move)
        if tried is None or float(tried[1] @ tried[1]) >= cost:
            damping *= 10
            if damping > 1e8:
                break
            continue
        turn, move, now, damping = next_turn, next_move, tried, damping * 0.3
        cost = float(now[1] @ now[1])
        if np.linalg.norm(step) < 1e-7:
            break
    return cost, turn, move


def patch_depth(depth, pixel, half):
    """The median depth around a pixel, metres; `None` where less than a quarter of the patch has a value."""
    u, v = int(round(pixel[0])), int(round(pixel[1]))
    rows, columns = depth.shape
    if not (0 <= u < columns and 0 <= v < rows):
        return None
    patch = depth[max(v - half, 0) : v + half + 1, max(u - half, 0) : u + half + 1]
    values = patch[patch > 0]
    return float(np.median(values)) if 4 * len(values) >= patch.size else None


def anchor_depths(pixels, depth, camera):
    """Distances of wrist and knuckles by the depth under them: (joint, metres along the axis), below the skin.

    One hand's are within a palm's length of each other; what reads something in front of the hand or behind it is left out. Empty
    where fewer than two are left.
    """
    found = []
    for joint in ANCHORS:
        seen = patch_depth(depth, pixels[joint], 1)
        if seen is not None:
            half = max(1, int(round(PATCH_M * camera.fx / max(seen, 0.05))))
            found.append((joint, patch_depth(depth, pixels[joint], half) or seen))
    groups = [[f for f in found if near <= f[1] <= near + TOGETHER_M] for _, near in found]
    # The largest; of two such the nearer one, as the hand is in front of what it opens.
    best = max(groups, key=lambda g: (len(g), -g[0][1] if g else 0.0), default=[])
    return [(joint, z + BELOW_SKIN_M) for joint, z in best] if len(best) >= 2 else []


def measured_palm(pixels, told, camera):
    """The length of the palm, metres, where depth tells of wrist and knuckles alike; `None` elsewhere."""
    if len(told) < len(ANCHORS):
        return None
    points = np.zeros((21, 3))
    for joint, z in told:
        u, v = pixels[joint]
        points[joint] = [(u - camera.cx) / camera.fx * z, (v - camera.cy) / camera.fy * z, z]
    return palm(points)


def person_size(palms):
    """The length of one person's palm, metres, and its relative standard deviation, from readings of it.

    A handful of readings is none: then the adult's size and the spread of adults.
    """
    lowest, highest = PALM_LIMITS_M
    inside = np.array([p for p in palms if lowest <= p <= highest])
    if len(inside) < 8:
        return PALM_M, SIZE_STD
    middle = float(np.median(inside))
    off = 1.4826 * float(np.median(np.abs(inside - middle)))
    # Readings of one hand have errors in common: no surer than this.
    return middle, max(off / middle / np.sqrt(len(inside)), 0.03)


def place(shape, pixels, camera, palm_m, palm_std, depth=None):
    """A hand in the camera's frame, or `None` where there is none of this size.

    Wrist and knuckles are where depth has them, the fingers follow by the shape of the person's size; where depth tells nothing
    the size tells the distance, too.
    """
    held = sized(shape, palm_m)
    told = anchor_depths(pixels, depth, camera) if depth is not None else []
    alone = pnp(held, pixels, camera)
    solved = pnp(held, pixels, camera, told) if told else alone
    if alone is None or solved is None:
        return None
    joints, rest = solved
    z = float(np.mean(joints[list(ANCHORS), 2]))
    if not told:
        return Placed(joints, z * float(np.hypot(palm_std, SHAPE_STD)), max(rest, 1.0) * z / camera.fx, "size")
    share = z / float(np.mean(alone[0][list(ANCHORS), 2]))
    if not 1 / NONE_SHARE <= share <= NONE_SHARE:
        return None
    off = np.array([joints[j, 2] - d for j, d in told])
    along = float(np.hypot(DEPTH_STD_M, np.sqrt(np.mean(off**2))))
    # The pixels were seen, the shape was guessed: each joint on its pixel's ray, as far as the shape has it.
    rays = np.column_stack([(pixels - [camera.cx, camera.cy]) / [camera.fx, camera.fy], np.ones(len(pixels))])
    return Placed(rays * joints[:, 2:], along, max(0.5 * rest, 1.0) * z / camera.fx, "depth")


def turn_of(rotation_wxyz):
    """The 3 x 3 rotation of a quaternion."""
    w, x, y, z = np.array(rotation_wxyz) / np.linalg.norm(rotation_wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def to_world(points, position, rotation_wxyz):
    """Points of the camera in the world."""
    return points @ turn_of(rotation_wxyz).T + position


def in_camera(points, position, rotation_wxyz):
    """Points of the world in the camera."""
    return (points - position) @ turn_of(rotation_wxyz)
