"""What would run. Needs the standard library alone."""

from __future__ import annotations

import dataclasses
import json
import os
import pathlib

from . import Failure, adapters

VIDEOS = (".mp4", ".mov", ".m4v", ".mkv", ".avi", ".webm")
# What nothing here makes, and what does.
ELSEWHERE = {
    "depth": "a metric depth network's own result on the same images as one more source: `moge infer -i IMAGES -o DEPTH --maps`, moge=DEPTH "
    "(MoGe-2: MIT, wants a GPU); or a metric model's folder: --depth-model DIR",
    "clips": "subtitles of what was said, or a table start,end,narration, as one more source; without them `paws twin` finds "
    "interactions by the hands, and asks a language model their names where one is given (--vlm-url)",
}
# Streams that are made only where somebody asks for them.
ASKED_FOR = ("masks", "lines")
# Where depth is made, the share of a recording's frames that `paws twin` looks at, as recordings here have it.
DEPTH_SHARE = 0.4
# A GPU takes this share of one core's time, for networks that use it.
GPU_SHARE = 0.05


@dataclasses.dataclass(frozen=True)
class Wishes:
    """What the user asked for."""

    device: str = "cpu"
    redo: tuple = ()
    depth_model: str | None = None
    weights: str | None = None
    make: tuple = ()
    by: tuple = ()
    """STREAM=NETWORK."""

    def network(self, stream):
        """The named network of a stream, or `None`."""
        return next((one.split("=", 1)[1] for one in self.by if one.startswith(f"{stream}=")), None)


def facts_of(folder):
    """What a recording, a folder of images or a video holds, as `paws perceive` tells it of anything else."""
    folder = pathlib.Path(folder)
    if (folder / "cameras.json").is_file():
        try:
            count = len(json.loads((folder / "cameras.json").read_text(encoding="utf-8"))["frames"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise Failure(f"{folder / 'cameras.json'}: {error}") from error
        has = lambda *names: any((folder / n).exists() for n in names)
        return {
            "images": count if (folder / "frames").is_dir() else 0,
            "frames": count,
            "poses": True,
            "depth": has("depth", "reconstruction.ply", "reconstruction.obj"),
            "hands": has("hands.json", "fingertips.csv"),
            "masks": has("masks"),
            "lines": has("segments"),
            "clips": has("clips.json"),
        }
    if folder.is_dir():
        count = sum(p.suffix.lower() in (".jpg", ".jpeg", ".png") for p in folder.iterdir())
    elif folder.suffix.lower() in VIDEOS and folder.is_file():
        if folder.stat().st_size == 0:
            raise Failure(f"{folder}: is empty (0 bytes): was the copy interrupted?")
        count = None
    else:
        raise Failure(f"{folder}: is neither a recording, a folder of images nor a video; `paws perceive --plan` reads more")
    return {"images": count, "frames": count, "poses": False, "depth": False, "hands": False, "clips": False}


def adapter_of(stream, wishes):
    """Who would make a stream; `None` for masks of hands, which need no network."""
    if stream == "depth" and wishes.depth_model:
        known = adapters.modules("depth")
        return next((m for m in known if m.fits(wishes.depth_model)), known[0]).ABOUT
    if stream == "masks" and not adapters.of("masks").has(wishes.weights):
        return None
    return adapters.of(stream, wishes.network(stream)).ABOUT


def row(stream, facts, wishes):
    """One row for people: the stream, what is done about it, on what, how long, how much memory, under which licence."""
    made_here = stream != "clips" and not (stream == "depth" and not wishes.depth_model)
    if facts.get(stream) and stream not in wishes.redo and stream not in wishes.make:
        return (stream, "is there", "", "", "", "")
    if not made_here:
        return (stream, "missing", "", "", "", "")
    if facts.get("images") == 0:
        return (stream, "needs images", "", "", "", "")
    about = adapter_of(stream, wishes)
    if about is None:
        return (stream, "hands' joints", "cpu", "", "", "")
    on = wishes.device if wishes.device in about.devices else about.devices[0]
    count = facts.get("frames")
    if stream in ("depth", "masks", "lines") and count is not None:
        count = max(int(DEPTH_SHARE * count), 1)
    each = about.secs_per_frame * (GPU_SHARE if on == "gpu" and "cpu" in about.devices else 1)
    time = "unknown" if count is None else duration(count * each)
    return (stream, about.name, on, time, f"{about.memory_mb / 1000:.1f} GB", about.licence)


def plan(facts, device="cpu", redo=(), depth_model=None, wishes=None):
    """The rows of all streams that are there, missing or asked for."""
    wishes = wishes or Wishes(device, tuple(redo), depth_model)
    wanted = [*wishes.make, *wishes.redo]
    streams = [s for s in ("poses", "depth", "hands", "masks", "lines", "clips") if s not in ASKED_FOR or facts.get(s) or s in wanted]
    return [row(stream, facts, wishes) for stream in streams]


def duration(secs):
    """A time for people; estimates are no better than this."""
    if secs < 90:
        return f"{max(secs, 1):.0f} s"
    return f"{secs / 60:.0f} min" if secs < 5400 else f"{secs / 3600:.1f} h"


def text(facts, device="cpu", redo=(), depth_model=None):
    """The plan as a table and the sentences below it. `device`: its name, or all the `Wishes`."""
    wishes = device if isinstance(device, Wishes) else Wishes(device, tuple(redo), depth_model)
    head = ("stream", "by", "on", "time", "memory", "licence")
    rows = [head, *plan(facts, wishes=wishes)]
    widths = [max(len(r[i]) for r in rows) for i in range(len(head))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(r, widths)).rstrip() for r in rows]
    used = [adapter_of(r[0], wishes) for r in rows[1:] if r[5]]
    for about in used:
        lines.append(f"{about.stream}: {about.gives}")
        if about.weights_from:
            lines.append(f"{about.stream}: weights: {about.weights_from}")
        if about.asks:
            lines.append(f"{about.stream}: its licence has to be accepted: --accept-licence {about.name}")
    if used:
        lines.append(f"packages, fetched on the first run where uv is there: {', '.join(a.package for a in used)}")
    if wishes.device == "gpu" and used and not any("gpu" in a.devices for a in used):
        lines.append("nothing of this uses a GPU: it runs on the CPU")
    for r in rows[1:]:
        if r[0] in ELSEWHERE and r[1] == "missing":
            lines.append(f"{r[0]}: missing, and not made here: {ELSEWHERE[r[0]]}")
        if r[1] == "hands' joints":
            lines.append("masks: of hands alone, by their joints; of furniture, too: " + adapters.of("masks").ABOUT.weights_from)
    if any(r[0] in ("depth", "masks", "lines") and r[5] for r in rows[1:]):
        lines.append("depth, masks and lines: of the frames that `paws twin` looks at (`paws frames`), taken to be two of five here")
    if not facts.get("depth") and not wishes.depth_model and any(a.stream == "hands" for a in used):
        lines.append("hands: without depth their distance comes from an adult's size, to about a tenth")
    lines.append("nothing was run")
    return os.linesep.join(lines) + os.linesep
