"""The stream of depth, and of normals where the network gives them.

Of a folder of images: a folder that `paws import` reads as it reads MoGe's. Of a recording: its `depth/` and `normals/`.
"""

import json
import math
import pathlib
import shutil

from . import Failure, adapters, batches, exr
from .cache import DIGITS, digest_of, key_of, write_whole
from .poses_io import ENDINGS
from .recording import Recording, add_origin, chosen

# A normal's component n is 128 + 127 n in a recording; in MoGe's files 255 (n / 2 + 1 / 2), cut off, y and z with their signs changed.
ZERO, STEP = 128, 127
# Millimetres that a recording's depth holds at the most.
MOST_MM = 65535
# The longer side of a sensor's depth that a network refines, pixels: that of an iPhone's LiDAR.
PROMPT_PX = 256


def module_of(model):
    """The adapter that runs the model of a folder."""
    known = adapters.modules("depth")
    return next((module for module in known if module.fits(model)), known[0])


class Kept:
    """What was computed, by image. Each is kept by itself: one that is added or changed costs itself."""

    def __init__(self, cache, module, kind, weights, redo, options=None):
        about = module.ABOUT
        facts = {"adapter": about.name, "version": about.version, "kind": kind, "weights": weights}
        base = key_of({**facts, "options": options} if options else facts)
        self.folder = pathlib.Path(cache) / f"depth-{base[:DIGITS]}"
        if redo:
            shutil.rmtree(self.folder, ignore_errors=True)

    def has(self, stem, stamp):
        """Whether the depth of an image is there, and of what the image is now."""
        mark = self.folder / stem / "image.sha256"
        try:
            return mark.read_text(encoding="utf-8") == stamp
        except (OSError, ValueError):
            return False

    def keep(self, stem, stamp, depth, normals, cv2):
        """Writes depth (metres, 0: none) and normals (or `None`) of an image."""
        place = self.folder / stem
        write_whole(place / "depth.exr", exr.encoded(depth))
        (place / "normal.png").unlink(missing_ok=True)
        if normals is not None:
            write_whole(place / "normal.png", png(mogelike(normals), cv2))
        # Written last: without it the depth counts as not there.
        write_whole(place / "image.sha256", stamp)

    def depth(self, stem):
        """Metres by pixel, or `None`."""
        try:
            return exr.decoded((self.folder / stem / "depth.exr").read_bytes())
        except OSError:
            return None


def png(image, cv2):
    """The bytes of a PNG of an image whose colours are in RGB order."""
    done, data = cv2.imencode(".png", image[:, :, ::-1] if image.ndim == 3 else image)
    if not done:
        raise Failure("depth: a picture cannot be written as PNG")
    return data.tobytes()


def mogelike(normals):
    """Normals as MoGe's files have them."""
    import numpy as np

    there = np.linalg.norm(normals, axis=2, keepdims=True) > 0.5
    values = np.trunc(255 * (normals * [1, -1, -1] / 2 + 0.5))
    return np.where(there, values, ZERO - 1).astype(np.uint8)


def as_recorded(values):
    """Normals of MoGe's files as a recording has them; what is grey has none."""
    import numpy as np

    normals = (values.astype(np.float64) - (ZERO - 1)) / 127.5 * [1, -1, -1]
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    return np.where(length > 0.5, np.round(ZERO + STEP * normals / np.maximum(length, 1e-9)), 0).astype(np.uint8)


def prompt(path, cv2):
    """A sensor's depth for a network: millimetres, small, its holes filled with the nearest value. `None` where it has none."""
    import numpy as np

    read = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if read is None or read.ndim != 2 or not (read > 0).any():
        return None
    shrink = max(read.shape) / PROMPT_PX
    if shrink > 1:
        size = [max(int(round(n / shrink)), 1) for n in read.shape]
        read = cv2.resize(read, (size[1], size[0]), interpolation=cv2.INTER_NEAREST)
    hole = read == 0
    if hole.all():
        return None
    if hole.any():
        _, labels = cv2.distanceTransformWithLabels(hole.astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL)
        values = np.zeros(labels.max() + 1, read.dtype)
        values[labels[~hole]] = read[~hole]
        read = values[labels]
    return read.astype(np.float32)


class Work:
    """One model at work on images."""

    def __init__(self, module, model, device, kept, say, progress):
        self.module, self.model, self.device, self.kept = module, model, device, kept
        self.say, self.progress = say, progress
        self.cv2 = adapters.package("cv2", module.ABOUT)
        self.broken, self._network = [], None

    def network(self):
        """The network, loaded when it is first needed."""
        self._network = self._network or self.module.load(self.device, self.model)
        return self._network

    def all(self, items, fov_deg=None):
        """Computes what is not kept of items (stem, path of the image, path of a sensor's depth or `None`)."""
        items = list(items)
        done = 0

        def pending():
            nonlocal done
            for stem, path, sensor in items:
                stamp = digest_of(path) + (digest_of(sensor) if sensor else "")
                if self.kept.has(stem, stamp):
                    done += 1
                    continue
                image = self.cv2.imread(str(path))
                told = prompt(sensor, self.cv2) if sensor else None
                if image is None or (sensor and told is None):
                    self.broken.append(path.name)
                    continue
                yield stem, stamp, image[:, :, ::-1].copy(), told

        def run(group):
            network = self.network()
            # A network takes images of one shape at a time.
            alike = len({item[2].shape for item in group}) == 1
            groups = [group] if alike else [[item] for item in group]
            out = []
            for some in groups:
                prompts = [item[3] for item in some] if some[0][3] is not None else None
                out += network.run([item[2] for item in some], prompts=prompts, fov_deg=fov_deg)
            return out

        def too_large(item):
            return batches.smaller("depth", item[2].shape[1], item[2].shape[0])

        for item, (depth, normals) in batches.each(pending(), batches.AT_ONCE[self.device], run, too_large, self.say):
            self.kept.keep(item[0], item[1], depth, normals, self.cv2)
            done += 1
            self.progress("depth", done, len(items))
        # Images that are none of these cost nothing but a word.
        if self.broken:
            self.say(f"depth: {len(self.broken)} images cannot be read: {', '.join(self.broken[:3])}")


def spread(items, most):
    """At most so many of a list, evenly; all where nobody says."""
    if most is None or len(items) <= most:
        return items
    return [items[i * len(items) // most] for i in range(most)]


def made_by(module, model, kind, weights):
    """What `import.json` says of it."""
    about, licence = module.ABOUT, module.licence(model)
    return {"stream": "depth", "adapter": about.name, "licence": licence, "weights": weights, "gives": about.gives, "kind": kind}


def run(images, out, cache, model, device="cpu", redo=False, say=print, progress=lambda what, done, count: None, most=None):
    """Depth of the images of a folder, of `most` of them at the most; what was found is written to the file `out` as JSON.

    Returns how many have it.
    """
    module = module_of(model)
    kind, weights = module.about_model(model)
    paths = spread(sorted(p for p in pathlib.Path(images).iterdir() if p.suffix.lower() in ENDINGS), most)
    if not paths:
        raise Failure(f"{images}: holds no JPEG or PNG images")
    if kind == getattr(module, "PROMPTED", None):
        raise Failure(f"depth: a {kind} model refines the depth of a phone's LiDAR: give it a recording that has depth")
    kept = Kept(cache, module, kind, weights, redo)
    work = Work(module, model, device, kept, say, progress)
    work.all((path.stem, path, None) for path in paths)
    made = made_by(module, model, kind, weights)
    write_whole(out, json.dumps({"depth": str(kept.folder), "made": made}) + "\n")
    say(f"depth: {len(paths) - len(work.broken)} of {len(paths)} images by {kind}")
    return len(paths) - len(work.broken)


def run_recording(folder, cache, model, device="cpu", redo=False, say=print, progress=lambda what, done, count: None, frames=None):
    """Depth of a recording's frames (all, or those whose numbers are given), into the recording. Returns how many have it now."""
    module = module_of(model)
    kind, weights = module.about_model(model)
    recording = Recording(folder)
    prompted = kind == getattr(module, "PROMPTED", None)
    items = []
    for frame in chosen(recording, frames):
        image, sensor = recording.image_path(frame), recording.depth_path(frame)
        # What is there stays, unless it is what is refined or was asked to be made anew.
        if image and (sensor if prompted else (redo or not sensor)):
            items.append((f"{frame['frame']:06d}", image, sensor if prompted else None))
    if prompted and not items:
        raise Failure(f"{folder}: has no depth, and a {kind} model refines that of a phone's LiDAR: take another model")
    camera = recording.camera
    width = recording.width
    fov_deg = round(math.degrees(2 * math.atan(0.5 * width / camera.fx)), 3) if width else None
    kept = Kept(cache, module, kind, weights, redo, {"fov_deg": fov_deg})
    work = Work(module, model, device, kept, say, progress)
    work.all(items, fov_deg)
    count, normals = written(folder, kept, [stem for stem, _, _ in items], work.cv2)
    made = {**made_by(module, model, kind, weights), "frames": count, "normals": normals}
    add_origin(folder, made)
    say(f"depth: {count} of {len(items)} frames by {kind}" + (f", normals of {normals}" if normals else ""))
    return count


def written(folder, kept, stems, cv2):
    """Puts kept depth and normals into a recording; of how many frames each."""
    import numpy as np

    count = normals = 0
    for stem in stems:
        depth = kept.depth(stem)
        if depth is None:
            continue
        count += 1
        mm = np.where(np.isfinite(depth) & (depth > 0), np.round(1000 * depth.astype(np.float64)), 0)
        # What is farther than the file can say is not said.
        write_whole(pathlib.Path(folder) / "depth" / f"{stem}.png", png(np.where(mm <= MOST_MM, mm, 0).astype(np.uint16), cv2))
        path = kept.folder / stem / "normal.png"
        read = cv2.imread(str(path)) if path.is_file() else None
        if read is not None:
            normals += 1
            write_whole(pathlib.Path(folder) / "normals" / f"{stem}.png", png(as_recorded(read[:, :, ::-1]), cv2))
    return count, normals
