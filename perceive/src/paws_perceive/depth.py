"""The stream of depth: images to a folder that `paws import` reads as it reads MoGe's."""

import json
import os
import pathlib
import shutil

from . import Failure, adapters, exr
from .cache import DIGITS, digest_of, key_of, write_whole
from .poses import ENDINGS


def run(images, out, cache, model, device="cpu", redo=False, say=print, progress=lambda what, done, count: None):
    """Depth of every image of a folder; what was found is written to the file `out` as JSON. Returns how many."""
    module = adapters.of("depth")
    about = module.ABOUT
    kind, weights = module.about_model(model)
    paths = sorted(p for p in pathlib.Path(images).iterdir() if p.suffix.lower() in ENDINGS)
    if not paths:
        raise Failure(f"{images}: holds no JPEG or PNG images")
    # Each image is kept by itself: one that is added or changed costs itself.
    base = key_of({"adapter": about.name, "version": about.version, "kind": kind, "weights": weights})
    folder = pathlib.Path(cache) / f"depth-{base[:DIGITS]}"
    if redo:
        shutil.rmtree(folder, ignore_errors=True)
    cv2 = adapters.package("cv2", about)
    network, broken = None, []
    for number, path in enumerate(paths):
        place = folder / path.stem
        stamp = digest_of(path)
        mark = place / "image.sha256"
        if not (mark.is_file() and mark.read_text(encoding="utf-8") == stamp):
            read = cv2.imread(str(path))
            if read is None:
                broken.append(path.name)
                continue
            network = network or module.load(device, model)
            values = network.run(read[:, :, ::-1].copy())
            place.mkdir(parents=True, exist_ok=True)
            beside = place / f".depth.partial-{os.getpid()}"
            beside.write_bytes(exr.encoded(values))
            os.replace(beside, place / "depth.exr")
            # Written last: without it the depth counts as not there.
            write_whole(mark, stamp)
        progress("depth", number + 1, len(paths))
    # Images that are not of these cost nothing but a word of the importer.
    if broken:
        say(f"depth: {len(broken)} images cannot be read: {', '.join(broken[:3])}")
    made = {"stream": "depth", "adapter": about.name, "licence": about.licence, "weights": weights, "gives": about.gives, "kind": kind}
    write_whole(out, json.dumps({"depth": str(folder), "made": made}) + "\n")
    say(f"depth: {len(paths) - len(broken)} of {len(paths)} images by {kind}")
    return len(paths) - len(broken)
