"""The stream of poses: a video or a folder of images to a COLMAP model that `paws import` reads."""

import hashlib
import json
import os
import pathlib
import shutil
import subprocess

from . import Failure, adapters
from .cache import DIGITS, digest_of, key_of, write_whole

ENDINGS = (".jpg", ".jpeg", ".png")
# Pictures a second: a head turns by some 10 degrees from one to the next.
FPS = 10
# Pixels of the longer side: what the features need; more costs time.
LONGEST = 1280


def images_of(source, cache, fps=FPS, redo=False, say=print, ffmpeg="ffmpeg"):
    """A folder of numbered images and their hash: the source itself, or the pictures of a video, decoded once."""
    source = pathlib.Path(source)
    if source.is_dir():
        names = sorted(p for p in source.iterdir() if p.suffix.lower() in ENDINGS)
        if not names:
            raise Failure(f"{source}: holds no JPEG or PNG images")
        return source, hashlib.sha256("".join(p.name + digest_of(p) for p in names).encode()).hexdigest()
    try:
        if source.stat().st_size == 0:
            raise Failure(f"{source}: is empty (0 bytes): was the copy interrupted?")
    except OSError as error:
        raise Failure(f"{source}: {error.strerror}") from error
    key = key_of({"video": digest_of(source), "fps": fps, "longest": LONGEST})
    folder = pathlib.Path(cache) / f"images-{key[:DIGITS]}"
    if redo:
        shutil.rmtree(folder, ignore_errors=True)
    if not folder.is_dir():
        say(f"taking {fps} pictures a second out of {source.name} ...")
        decode(source, folder, fps, ffmpeg)
    return folder, key


def decode(video, folder, fps, ffmpeg="ffmpeg"):
    """Pictures of a video at even times, turned upright as its metadata say, and `timestamps.txt`; whole or not there."""
    if shutil.which(ffmpeg) is None:
        raise Failure(f"{video}: reading a video needs ffmpeg: install it (Debian, Ubuntu: apt install ffmpeg; macOS: brew install ffmpeg)")
    beside = folder.with_name(f".{folder.name}.partial-{os.getpid()}")
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir(parents=True)
    size = f"scale='min({LONGEST},iw)':'min({LONGEST},ih)':force_original_aspect_ratio=decrease"
    command = [ffmpeg, "-v", "error", "-nostdin", "-i", str(video), "-map", "0:v:0", "-vf", f"fps={fps},{size}", "-q:v", "3"]
    done = subprocess.run([*command, "-start_number", "0", str(beside / "%06d.jpg")], capture_output=True, text=True, check=False)
    count = len(list(beside.glob("*.jpg")))
    if count == 0:
        shutil.rmtree(beside, ignore_errors=True)
        said = (done.stderr.strip().splitlines() or ["no picture came out"])[-1]
        if "No space left" in done.stderr:
            raise Failure(f"{folder.parent}: the disk is full: make room, or name another folder with --cache")
        raise Failure(f"{video}: is no video that ffmpeg can read, or is cut off ({said}): does it play?")
    write_whole(beside / "timestamps.txt", "".join(f"{n / fps:.6f}\n" for n in range(count)))
    os.replace(beside, folder)


def run(source, out, cache, device="cpu", redo=False, fps=FPS, say=print, ffmpeg="ffmpeg"):
    """Writes what was found of a source to the file `out` as JSON: the folders of images and of the largest model."""
    module = adapters.of("poses")
    about = module.ABOUT
    images, digest = images_of(source, cache, fps, redo, say, ffmpeg)
    facts = {"adapter": about.name, "version": about.version, "options": {"overlap": module.OVERLAP}, "images": digest}
    folder = pathlib.Path(cache) / f"poses-{key_of(facts)[:DIGITS]}"
    if redo:
        shutil.rmtree(folder, ignore_errors=True)
    done = folder / "done.json"
    total = sum(p.suffix.lower() in ENDINGS for p in images.iterdir())
    if not done.is_file():
        network = module.load(device)
        say(f"poses of {total} images by COLMAP, about {total * about.secs_per_frame / 60:.0f} minutes on one core ...")
        folder.mkdir(parents=True, exist_ok=True)
        counts = network.run(images, folder)
        write_whole(folder / "facts.json", json.dumps(facts, indent=1, sort_keys=True) + "\n")
        write_whole(done, json.dumps(counts) + "\n")
    counts = json.loads(done.read_text(encoding="utf-8"))
    others = f"; pieces that do not hang together with it and are left out: {', '.join(map(str, counts[1:]))} images" if counts[1:] else ""
    say(f"poses: {counts[0]} of {total} images{others}")
    made = {
        "stream": "poses",
        "adapter": about.name,
        "licence": about.licence,
        "weights": {},
        "gives": about.gives,
        "images": total,
        "models": counts,
    }
    write_whole(out, json.dumps({"images": str(images), "model": str(folder / "0"), "made": made}) + "\n")
    return counts[0]
