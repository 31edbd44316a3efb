"""The stream of line segments: a detector's own, into a recording's `segments/`."""

import io
import pathlib

from . import Failure, adapters, batches
from .cache import Stream, digest_of, write_whole
from .recording import Recording, add_origin, chosen


def run(
    folder, cache, device="cpu", weights=None, redo=False, say=print, progress=lambda what, done, count: None, frames=None, by=None
):
    """Finds segments in a recording's frames (all, or those whose numbers are given). Returns how many frames have any."""
    import numpy as np

    module = adapters.of("lines", by)
    about = module.ABOUT
    recording = Recording(folder)
    wanted = [frame for frame in chosen(recording, frames) if recording.image_path(frame)]
    if not wanted:
        raise Failure(f"{folder}: has no colour image that `cameras.json` lists; lines are found in images")
    paths = [recording.image_path(frame) for frame in wanted]
    cv2 = adapters.package("cv2", about)
    network = None
    images = [digest_of(path) for path in paths]
    facts = {"adapter": about.name, "version": about.version, "weights": module.digests(weights), "images": images}
    kept = Stream(cache, "lines", facts)
    if redo:
        kept.forget()
    broken = set()

    def look(number):
        nonlocal network
        grey = cv2.imread(str(paths[number]), cv2.IMREAD_GRAYSCALE)
        if grey is None:
            broken.add(number)
            return []
        network = network or module.load(device, weights)
        try:
            found = np.asarray(network.run(grey), float).reshape(-1, 2, 2)
        except batches.TooLarge as error:
            raise Failure(batches.smaller("lines", grey.shape[1], grey.shape[0])) from error
        return np.round(found, 3).tolist()

    found = kept.run(len(paths), look, lambda done, count: progress("lines", done, count))
    some = 0
    for frame, lines in zip(wanted, found):
        some += bool(lines)
        # As DeepLSD's exporter: row before column.
        rows_first = np.asarray(lines, np.float32).reshape(-1, 2, 2)[:, :, ::-1]
        held = io.BytesIO()
        np.savez(held, lines=np.ascontiguousarray(rows_first))
        write_whole(pathlib.Path(folder) / "segments" / f"{frame['frame']:06d}.npz", held.getvalue())
    if broken:
        say(f"lines: {len(broken)} images cannot be read: {', '.join(paths[n].name for n in sorted(broken)[:3])}")
    add_origin(
        folder,
        {
            "stream": "segments",
            "adapter": about.name,
            "licence": about.licence,
            "weights": facts["weights"],
            "gives": about.gives,
            "frames": len(wanted),
        },
    )
    say(f"lines: {sum(len(lines) for lines in found)} segments in {some} of {len(wanted)} frames by {about.name}")
    return some
