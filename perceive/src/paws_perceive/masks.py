"""The stream of masks: a class for each pixel of a recording's frames.

Furniture by two networks where their weights are given; hands by their joints, which needs no network.
"""

import json
import pathlib
import shutil

from . import Failure, adapters, batches
from .cache import DIGITS, digest_of, key_of, write_whole
from .depth import png
from .geometry import in_camera
from .recording import Recording, add_labels, add_origin, chosen, read_hands

HAND = 255
# What moves, and is no furniture: the own body, other people, animals.
MOVING = ("person", "hand", "arm", "dog", "cat")
# Half of a hand's width at the knuckles, metres: from the middle of the outer joints to beyond the skin, and what joints are off.
HALF_WIDTH_M = 0.03
# Nearer joints are behind the camera or in it, metres.
NEAREST_M = 0.05
BY_JOINTS = "hand-joints"


def hand_mask(joints, frame, camera, shape, cv2):
    """Where a hand is in an image of a shape: the hull of its joints (21 x 3, world, metres), wider by half of a hand's width."""
    import numpy as np

    local = in_camera(np.asarray(joints, float), frame["position"], frame["rotation_wxyz"])
    out = np.zeros(shape, np.uint8)
    seen = local[local[:, 2] > NEAREST_M]
    if len(seen) < 3:
        return out.astype(bool)
    half = HALF_WIDTH_M * camera.fx / float(np.median(seen[:, 2]))
    # Far outside of the image drawing overflows.
    reach = 4 * max(shape)
    pixels = np.clip(np.round(camera.project(seen)), -reach, reach).astype(np.int32)
    hull = cv2.convexHull(pixels.reshape(-1, 1, 2))
    cv2.fillConvexPoly(out, hull, 1)
    # A round brush along the hull's border is what widening by a disc gives.
    cv2.polylines(out, [hull], True, 1, max(int(round(2 * half)), 1))
    return out.astype(bool)


def composed(found, classes, shape):
    """One class a pixel: the surest on top, what moves over all."""
    import numpy as np

    out = np.zeros(shape, np.uint8)
    for word, _, mask in sorted(found, key=lambda f: (f[0] in MOVING, f[1])):
        out[mask] = HAND if word in MOVING else classes[word]
    return out


def classes_of(words):
    """The number of each word, from 1 in their order; of more than fit in a mask the first ones."""
    unique = dict.fromkeys(word.strip().lower() for word in words if word.strip())
    return {word: number for number, word in enumerate([w for w in unique if w not in MOVING][: HAND - 1], 1)}


class Furniture:
    """The networks' masks, kept by image."""

    def __init__(self, cache, device, weights, words, redo):
        self.module, self.device, self.weights = adapters.of("masks"), device, weights
        about = self.module.ABOUT
        self.classes = classes_of(words)
        if not self.classes:
            raise Failure("masks: no words are given that name furniture (--words)")
        self.digests = self.module.digests(weights)
        options = {"words": list(self.classes), "score": self.module.BOX_SCORE}
        facts = {"adapter": about.name, "version": about.version, "weights": self.digests, "options": options}
        self.folder = pathlib.Path(cache) / f"masks-{key_of(facts)[:DIGITS]}"
        if redo:
            shutil.rmtree(self.folder, ignore_errors=True)
        self._network = None

    def of(self, path, image, cv2):
        """Classes of an RGB image that lies at a path, kept or computed."""
        kept = self.folder / f"{digest_of(path)}.png"
        read = cv2.imread(str(kept), cv2.IMREAD_UNCHANGED) if kept.is_file() else None
        if read is not None and read.shape == image.shape[:2]:
            return read
        self._network = self._network or self.module.load(self.device, self.weights)
        try:
            found = self._network.run(image, [*self.classes, *MOVING])
        except batches.TooLarge as error:
            raise Failure(batches.smaller("masks", image.shape[1], image.shape[0])) from error
        out = composed(found, self.classes, image.shape[:2])
        write_whole(kept, png(out, cv2))
        return out

    def made(self):
        """What `import.json` says of it."""
        about = self.module.ABOUT
        return {"adapter": about.name, "licence": about.licence, "weights": self.digests, "gives": about.gives}


def run(folder, cache, device="cpu", weights=None, redo=False, say=print, progress=lambda what, done, count: None, frames=None, words=()):
    """Writes masks of a recording's frames (all, or those whose numbers are given) into it. Returns how many show anything."""
    recording = Recording(folder)
    hands = read_hands(folder)
    cv2 = adapters.package("cv2", adapters.of("hands").ABOUT)
    furniture = None
    if adapters.of("masks").has(weights):
        furniture = Furniture(cache, device, weights, words, redo)
    elif not hands:
        raise Failure(
            f"{folder}: has no hands with all joints, of which masks of hands are made, and furniture needs the two networks: "
            f"{adapters.of('masks').ABOUT.weights_from}"
        )
    wanted = [frame for frame in chosen(recording, frames) if recording.image_path(frame)]
    shown, broken, used = 0, [], set()
    for number, frame in enumerate(wanted):
        path = recording.image_path(frame)
        image = cv2.imread(str(path))
        if image is None:
            broken.append(path.name)
            continue
        before = None if furniture else pathlib.Path(folder) / "masks" / f"{frame['frame']:06d}.png"
        below = furniture.of(path, image[:, :, ::-1].copy(), cv2) if furniture else there(before, image.shape[:2], cv2)
        mask = with_hands(below, hands.get(frame["frame"], []), frame, recording.camera, cv2)
        shown += bool(mask.any())
        used.update(int(v) for v in set(mask.ravel().tolist()))
        write_whole(pathlib.Path(folder) / "masks" / f"{frame['frame']:06d}.png", png(mask, cv2))
        progress("masks", number + 1, len(wanted))
    if broken:
        say(f"masks: {len(broken)} images cannot be read: {', '.join(broken[:3])}")
    if furniture:
        add_labels(folder, {n: word for word, n in furniture.classes.items() if n in used})
    made = furniture.made() if furniture else {"adapter": BY_JOINTS, "licence": "none: made of the hands", "weights": {}, "gives": "255: a hand"}
    add_origin(folder, {"stream": "masks", **made, "frames": len(wanted) - len(broken)})
    say(f"masks: {shown} of {len(wanted)} frames show {'furniture or hands' if furniture else 'hands'}")
    return shown


def there(path, shape, cv2):
    """The classes of a mask that a recording has, nothing where it has none."""
    import numpy as np

    read = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if path.is_file() else None
    return read if read is not None and read.shape == shape else np.zeros(shape, np.uint8)


def with_hands(below, hands, frame, camera, cv2):
    """Classes of an image with the frame's hands over them."""
    out = below.copy()
    for joints in hands:
        out[hand_mask(joints, frame, camera, out.shape, cv2)] = HAND
    return out
