"""The stream of poses: a video or a folder of images to a COLMAP model that `paws import` reads."""

import hashlib
import json
import os
import pathlib
import shutil
import subprocess

from . import Failure, adapters, batches
from .cache import DIGITS, digest_of, key_of, write_whole
from .poses_io import ENDINGS

# Pictures a second: a head turns by some 10 degrees from one to the next.
FPS = 10
# Pixels of the longer side: what the features need; more costs time.
LONGEST = 1280
# Names of the two curves of HDR video: HDR10's and Dolby Vision's, and HLG.
HDR = ("smpte2084", "arib-std-b67")
# To linear light, to common primaries, highlights rolled off, to common video.
TONED = (
    "zscale=t=linear:npl=100,format=gbrpf32le,zscale=p=bt709,tonemap=tonemap=hable:desat=0,zscale=t=bt709:m=bt709:r=tv,format=yuv420p"
)
# Fewer posed images than this share of all are told, with the likely reason.
LEAST_SHARE = 0.6
# Images are blurred where their edges are this share as strong as those of the posed ones.
BLURRED = 0.5


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
        decode(source, folder, fps, ffmpeg, say)
    return folder, key


def is_hdr(video, ffmpeg):
    """Whether the brightness of a video is coded for a display of high dynamic range, as phones' 10 bits mostly are."""
    told = subprocess.run([ffmpeg, "-hide_banner", "-nostdin", "-i", str(video)], capture_output=True, text=True, errors="replace", check=False)
    lines = [line for line in told.stderr.splitlines() if "Video:" in line]
    return any(curve in line for line in lines[:1] for curve in HDR)


def toned(video, ffmpeg, say):
    """The filter that brings such a video's brightness to what networks have learnt; nothing for others.

    Without it pictures are pale and flat.
    """
    if not is_hdr(video, ffmpeg):
        return ""
    filters = subprocess.run([ffmpeg, "-hide_banner", "-filters"], capture_output=True, text=True, errors="replace", check=False).stdout
    if all(f" {name} " in filters for name in ("zscale", "tonemap")):
        say(f"{pathlib.Path(video).name}: HDR, its brightness is mapped to that of common video")
        return TONED + ","
    say(
        f"{pathlib.Path(video).name}: HDR, and this ffmpeg has no zscale and tonemap to map its brightness: pictures are pale, and less is "
        "found in them; take an ffmpeg with zimg, or switch HDR video off in the camera's settings"
    )
    return ""


def decode(video, folder, fps, ffmpeg="ffmpeg", say=print):
    """Pictures of a video at even times, turned upright as its metadata say, and `timestamps.txt`; whole or not there.

    Times count from the video's own start, also where its frames come at uneven ones.
    """
    if shutil.which(ffmpeg) is None:
        raise Failure(f"{video}: reading a video needs ffmpeg: install it (Debian, Ubuntu: apt install ffmpeg; macOS: brew install ffmpeg)")
    beside = folder.with_name(f".{folder.name}.partial-{os.getpid()}")
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir(parents=True)
    size = f"scale='min({LONGEST},iw)':'min({LONGEST},ih)':force_original_aspect_ratio=decrease"
    filters = f"fps={fps}:start_time=0,{toned(video, ffmpeg, say)}{size}"
    command = [ffmpeg, "-v", "error", "-nostdin", "-i", str(video), "-map", "0:v:0", "-vf", filters, "-q:v", "3"]
    done = subprocess.run([*command, "-start_number", "0", str(beside / "%06d.jpg")], capture_output=True, text=True, errors="replace", check=False)
    count = len(list(beside.glob("*.jpg")))
    full = "No space left" in done.stderr
    # Of a file that is cut off ffmpeg says so, and calls it a success.
    faults = done.stderr.strip().splitlines()
    if count and faults and not full:
        say(f"{video}: cannot be read whole ({faults[0][:120]}), {count / fps:.1f} s of it are taken: was the copy interrupted?")
    if count == 0 or full:
        shutil.rmtree(beside, ignore_errors=True)
        said = (done.stderr.strip().splitlines() or ["no picture came out"])[-1]
        if full:
            raise Failure(f"{folder.parent}: the disk is full: make room, or name another folder with --cache")
        raise Failure(f"{video}: is no video that ffmpeg can read, or is cut off ({said}): does it play?")
    write_whole(beside / "timestamps.txt", "".join(f"{n / fps:.6f}\n" for n in range(count)))
    os.replace(beside, folder)


def run(source, out, cache, device="cpu", redo=False, fps=FPS, say=print, ffmpeg="ffmpeg", by=None, weights=None, accepted=()):
    """Writes what was found of a source to the file `out` as JSON: the folders of images and of the largest model."""
    module = adapters.of("poses", by)
    about = module.ABOUT
    digests = module.digests(weights) if hasattr(module, "digests") else {}
    licence = module.licence(weights) if hasattr(module, "licence") else about.licence
    if about.asks and "NC" in licence:
        adapters.accepted(about, accepted, licence)
    images, digest = images_of(source, cache, fps, redo, say, ffmpeg)
    facts = {"adapter": about.name, "version": about.version, "options": module.OPTIONS, "images": digest}
    if digests:
        facts["weights"] = digests
    folder = pathlib.Path(cache) / f"poses-{key_of(facts)[:DIGITS]}"
    if redo:
        shutil.rmtree(folder, ignore_errors=True)
    done = folder / "done.json"
    total = sum(p.suffix.lower() in ENDINGS for p in images.iterdir())
    if not done.is_file():
        network = module.load(device, weights)
        say(f"poses of {total} images by {about.name}, about {total * about.secs_per_frame / 60:.0f} minutes on one core ...")
        folder.mkdir(parents=True, exist_ok=True)
        try:
            counts = network.run(images, folder)
        except batches.TooLarge as error:
            raise Failure(
                f"poses: the GPU's memory does not hold {total} images at once: take fewer (--fps {max(fps / 2, 0.5):g}), or leave out --by "
                "poses, which takes COLMAP on the CPU"
            ) from error
        write_whole(folder / "facts.json", json.dumps(facts, indent=1, sort_keys=True) + "\n")
        write_whole(done, json.dumps(counts) + "\n")
    counts = json.loads(done.read_text(encoding="utf-8"))
    others = f"; pieces that do not hang together with it and are left out: {', '.join(map(str, counts[1:]))} images" if counts[1:] else ""
    say(f"poses: {counts[0]} of {total} images{others}")
    if counts[0] < LEAST_SHARE * total:
        say(why_few(images, folder / "0"))
    made = {
        "stream": "poses",
        "adapter": about.name,
        "licence": licence,
        "weights": digests,
        "gives": about.gives,
        "images": total,
        "models": counts,
    }
    found = {"images": str(images), "model": str(folder / "0"), "format": module.FORMAT, "made": made}
    write_whole(out, json.dumps(found) + "\n")
    return counts[0]


def sharpness(path, cv2):
    """How strong an image's edges are: the variance of its second derivative. `None` where it cannot be read."""
    grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    return None if grey is None else float(cv2.Laplacian(grey, cv2.CV_64F).var())


def why_few(images, model, most=200):
    """Why so few images have a pose, and what to do: they are blurred, or have too little in common."""
    out = "poses: most images have none: neighbouring images have too little in common (bare walls, a camera that only turns, cuts)"
    way = "; film walls and furniture with texture, step aside while you look around, or give poses of another source (a phone with ARKit)"
    try:
        cv2 = adapters.package("cv2", adapters.of("poses").ABOUT)
        posed = {line.split()[9] for line in (model / "images.txt").read_text(encoding="utf-8").splitlines() if len(line.split()) > 9}
    except (Failure, OSError, ValueError):
        return out + way
    paths = sorted(p for p in pathlib.Path(images).iterdir() if p.suffix.lower() in ENDINGS)
    paths = paths[:: max(len(paths) // most, 1)]
    found = [(p.name in posed, sharpness(p, cv2)) for p in paths]
    middle = lambda those: sorted(those)[len(those) // 2] if those else None
    sharp, rest = (middle([s for is_posed, s in found if s is not None and is_posed == which]) for which in (True, False))
    if sharp and rest is not None and rest < BLURRED * sharp:
        return (
            f"poses: most images have none, and those are blurred (their edges are {rest / sharp:.1f} times as strong as the others'): turn "
            "the head more slowly, put more light on, or set a shorter exposure; images from a source with poses of its own need no edges"
        )
    return out + way
