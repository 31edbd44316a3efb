"""The stream of hands: pictures to joints in the world."""

import hashlib

import numpy as np

from . import Failure, adapters, batches, tracks
from .cache import Stream, digest_of
from .geometry import anchor_depths, measured_palm, person_size, place, to_world
from .recording import Recording, add_hands, add_origin

# Side of a crop as a share of the image's shorter side: a hand at arm's length is large enough in it for the detector.
CROP = 0.75
# Two detections are one hand where their middles are closer than this share of its size.
SAME = 0.35
# Hands that one picture alone shows are no hands, unless the network is as sure as this and more than one view shows it.
ALONE = 0.8
# A hand in more frames than this share, whose place in the picture varies by less than this share of the picture's width, rests, or is
# no hand but a thing that looks like one.
ALWAYS, STILL = 0.9, 0.05


def views(width, height):
    """Squares (left, top, side) that are looked at: the whole, and three that cover the part where the own hands come in."""
    side = max(int(round(CROP * min(width, height))), 1)
    whole = (min(width - height, 0) // 2, min(height - width, 0) // 2, max(width, height))
    if width >= height:
        crops = [(int(round((width - side) * f)), height - side, side) for f in (0.0, 0.5, 1.0)]
    else:
        crops = [((width - side) // 2, int(round((height - side) * f)), side) for f in (0.0, 0.5, 1.0)]
    return [whole, *crops]


def cut(image, square):
    """A square of the image, black where it leaves it."""
    left, top, side = square
    rows, columns = image.shape[:2]
    out = np.zeros((side, side, 3), np.uint8)
    u, v = max(left, 0), max(top, 0)
    piece = image[v : min(top + side, rows), u : min(left + side, columns)]
    out[v - top : v - top + piece.shape[0], u - left : u - left + piece.shape[1]] = piece
    return out


def merged(detections):
    """One detection a hand: those of several views are averaged, `seen` counts them."""
    out, left = [], sorted(detections, key=lambda d: -d["score"])
    while left:
        first = left[0]
        near = [
            d for d in left if np.linalg.norm(tracks.middle(d) - tracks.middle(first)) < SAME * max(tracks.size(first), tracks.size(d))
        ]
        left = [d for d in left if all(d is not n for n in near)]
        mean = lambda key: np.mean([np.asarray(d[key]) for d in near], axis=0)
        out.append(
            {
                "right": float(mean("right")),
                "score": float(first["score"]),
                "pixels": np.round(np.median([np.asarray(d["pixels"]) for d in near], axis=0), 2).tolist(),
                "shape": np.round(np.median([np.asarray(d["shape"]) for d in near], axis=0), 5).tolist(),
                "seen": len(near),
            }
        )
    return out


def detect(network, image, squares):
    """Hands of an image, looked at through squares."""
    found = []
    for left, top, side in squares:
        for d in network.run(cut(image, (left, top, side))):
            found.append({**d, "pixels": d["pixels"] + [left, top]})
    return merged(found)


def joined(first, again):
    """Detections of a frame, and those of a second look that are of other hands."""
    new = [
        d
        for d in again
        if all(np.linalg.norm(tracks.middle(d) - tracks.middle(f)) > SAME * max(tracks.size(d), tracks.size(f)) for f in first)
    ]
    return first + new


def lifted(recording, frames, read_depth):
    """Hands in the world by frame, and the length of the person's palm with its relative standard deviation.

    `frames`: detections by frame of the recording; `read_depth(frame)`: metres a pixel, or `None`.
    """
    camera = recording.camera
    palms, has_depth = [], []
    for frame, detections in zip(recording.frames, frames):
        depth = read_depth(frame) if detections else None
        has_depth.append(depth is not None)
        for d in detections if depth is not None else []:
            pixels = np.asarray(d["pixels"])
            palms.append(measured_palm(pixels, anchor_depths(pixels, depth, camera), camera))
    palm_m, palm_std = person_size([p for p in palms if p is not None])
    kept, placed = [], []
    for frame, detections, has in zip(recording.frames, frames, has_depth):
        depth = read_depth(frame) if has else None
        pairs = [(d, place(np.asarray(d["shape"]), np.asarray(d["pixels"]), camera, palm_m, palm_std, depth)) for d in detections]
        pairs = [(d, p) for d, p in pairs if p is not None]
        kept.append([d for d, _ in pairs])
        placed.append([p for _, p in pairs])
    width = 2 * camera.cx + 1
    followed = [t for t in tracks.track(kept, [f["time"] for f in recording.frames], width) if not _is_doubtful(t, kept, placed)]
    out = []
    for number, (frame, names) in enumerate(zip(recording.frames, tracks.sides(kept, followed))):
        hands = []
        for i, side in enumerate(names):
            if side is None:
                continue
            p, d = placed[number][i], kept[number][i]
            world = to_world(p.joints, frame["position"], frame["rotation_wxyz"])
            hands.append(
                {
                    "side": side,
                    "score": round(float(d["score"]), 3),
                    "joints_world": np.round(world, 5).tolist(),
                    "std_along_ray_m": round(p.along_m, 4),
                    "std_across_ray_m": round(p.across_m, 4),
                    "distance_by": p.by,
                }
            )
        if hands:
            out.append({"frame": frame["frame"], "hands": sorted(hands, key=lambda h: h["side"])})
    return out, palm_m, palm_std


def _is_doubtful(track, kept, placed):
    """Whether one picture alone shows a hand, and nothing else speaks for it."""
    number, i = track.members[0]
    one = len(track.members) == 1 and placed[number][i].by != "depth"
    return one and (kept[number][i]["score"] < ALONE or kept[number][i]["seen"] < 2)


def still(frames, width):
    """Whether a hand is in nearly every frame and hardly moves in the picture. `frames`: detections by frame."""
    seen = [detections for detections in frames if detections]
    if not frames or len(seen) < ALWAYS * len(frames) or len(frames) < 10:
        return False
    # The one of several that is nearest to where hands are in most frames.
    usual = np.median([tracks.middle(d) for detections in seen for d in detections], axis=0)
    nearest = [min((float(np.linalg.norm(tracks.middle(d) - usual)) for d in detections)) for detections in seen]
    return float(np.quantile(nearest, 0.9)) < STILL * width


def warn(say, found, width, broken):
    """Says which images cannot be read, and that what looks like a hand may be none. `broken`: their paths, `None` without an image."""
    if broken:
        names = ", ".join(str(p) for p in broken[:3] if p)
        say(f"{len(broken)} images cannot be read, and show no hand therefore" + (f": {names}" if names else ""))
    if still(found, width):
        say(
            "hands: one is in nearly every frame and hardly moves in the picture: a hand that rests, or a thing that looks like one; where "
            "hands open nothing, no interaction is found: look at a frame or two, and crop or cover what is no hand at work"
        )


def written(folder, about, digests, hands, numbers, say):
    """Notes in the recording where its hands come from, and says how many they are. `numbers`: of frames, and the palm's mean and spread."""
    count, palm_m, palm_std = numbers
    by_depth = sum(h["distance_by"] == "depth" for f in hands for h in f["hands"])
    total = sum(len(f["hands"]) for f in hands)
    add_origin(
        folder,
        {
            "stream": "hands",
            "adapter": about.name,
            "licence": about.licence,
            "weights": digests,
            "gives": "21 joints, world frame, metres",
            "frames_with_hands": len(hands),
            "hands": total,
            "distance_by_depth": by_depth,
            "palm_m": round(palm_m, 4),
            "palm_relative_std": round(palm_std, 4),
        },
    )
    say(
        f"hands: {total} in {len(hands)} of {count} frames; distance from depth in {by_depth}, from the hand's size in "
        f"{total - by_depth}; palm {100 * palm_m:.1f} cm to {100 * palm_std:.0f} %"
    )


def run(
    folder,
    cache,
    device="cpu",
    weights=None,
    redo=False,
    say=print,
    progress=lambda what, done, count: None,
    by=None,
    accepted=(),
):
    """Finds the hands of a recording and writes `hands.json` into it. Returns how many frames have one."""
    recording = Recording(folder)
    paths = [recording.image_path(frame) for frame in recording.frames]
    if not any(paths):
        raise Failure(f"{recording.folder}: has no colour image that `cameras.json` lists; hands are found in images")
    module = adapters.of("hands", by)
    about = module.ABOUT
    if about.asks:
        adapters.accepted(about, accepted)
    digests = module.digests(weights) if hasattr(module, "digests") else about.weights
    network = None

    def loaded():
        nonlocal network
        if network is None:
            network = module.load(device, weights)
        return network

    cv2 = adapters.package("cv2", about)
    # Broken weights are told before anything is computed, and whether or not the cache has it all.
    loaded()

    def detected(picture, squares):
        try:
            return detect(loaded(), picture, squares)
        except batches.TooLarge as error:
            raise Failure(batches.smaller("hands", picture.shape[1], picture.shape[0])) from error

    def image(number):
        read = cv2.imread(str(paths[number])) if paths[number] else None
        return None if read is None else read[:, :, ::-1]

    upstream = hashlib.sha256("".join(digest_of(p) if p else "-" for p in paths).encode()).hexdigest()
    facts = {
        "adapter": about.name,
        "version": about.version,
        "weights": digests,
        "options": {"crop": CROP, "same": SAME},
        "images": upstream,
    }
    first = Stream(cache, "hands", facts)
    if redo:
        first.forget()
    broken = set()

    def look(number):
        picture = image(number)
        if picture is None:
            broken.add(number)
            return []
        return detected(picture, views(picture.shape[1], picture.shape[0]))

    count = len(paths)
    found = first.run(count, look, lambda done, all_: progress("hands", done, all_))
    times = [frame["time"] for frame in recording.frames]
    wanted = tracks.gaps(found, times, tracks.track(found, times, 2 * recording.camera.cx + 1))
    second = Stream(cache, "hands-again", {**facts, "upstream": first.key})
    if redo:
        second.forget()

    def look_again(number):
        picture = image(number) if wanted[number] else None
        if picture is None:
            return []
        squares = [(int(u - h), int(v - h), max(int(2 * h), 32)) for u, v, h in wanted[number]]
        return detected(picture, squares)

    again = second.run(count, look_again, lambda done, all_: progress("hands missed", done, all_))
    found = [joined(a, b) for a, b in zip(found, again)]

    def read_depth(frame):
        path = recording.depth_path(frame)
        read = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path else None
        return None if read is None or read.ndim != 2 else read.astype(np.float64) / 1000

    hands, palm_m, palm_std = lifted(recording, found, read_depth)
    width = 2 * recording.camera.cx + 1
    warn(say, found, width, [paths[n] for n in sorted(broken)])
    add_hands(folder, hands)
    written(folder, about, digests, hands, (count, palm_m, palm_std), say)
    return len(hands)
