"""What would run. Needs the standard library alone."""

import json
import os
import pathlib

from . import Failure, adapters

VIDEOS = (".mp4", ".mov", ".m4v", ".mkv", ".avi", ".webm")
# What nothing here makes, and what does.
ELSEWHERE = {
    "depth": "a metric depth network on the same images, then its folder as one more source: `moge infer -i IMAGES -o DEPTH --maps`, "
    "moge=DEPTH (MoGe-2: MIT, wants a GPU); or a metric model's folder: --depth-model DIR",
    "clips": "subtitles of what was said, or a table start,end,narration, as one more source",
}


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
            "clips": has("clips.json"),
        }
    if folder.is_dir():
        count = sum(p.suffix.lower() in (".jpg", ".jpeg", ".png") for p in folder.iterdir())
    elif folder.suffix.lower() in VIDEOS and folder.is_file():
        count = None
    else:
        raise Failure(f"{folder}: is neither a recording, a folder of images nor a video; `paws perceive --plan` reads more")
    return {"images": count, "frames": count, "poses": False, "depth": False, "hands": False, "clips": False}


def plan(facts, device="cpu", redo=(), depth_model=None):
    """Rows for people: the stream, what is done about it, on what, how long, how much memory, under which licence."""
    rows = []
    for stream in ("poses", "depth", "hands", "clips"):
        there = facts.get(stream) and stream not in redo
        if there:
            rows.append((stream, "is there", "", "", "", ""))
        elif stream in ELSEWHERE and not (stream == "depth" and depth_model):
            rows.append((stream, "missing", "", "", "", ""))
        elif facts.get("images") == 0:
            rows.append((stream, "needs images", "", "", "", ""))
        else:
            about = adapters.of(stream).ABOUT
            on = device if device in about.devices else about.devices[0]
            count = facts.get("frames")
            time = "unknown" if count is None else duration(count * about.secs_per_frame)
            rows.append((stream, about.name, on, time, f"{about.memory_mb / 1000:.1f} GB", about.licence))
    return rows


def duration(secs):
    """A time for people; estimates are no better than this."""
    if secs < 90:
        return f"{max(secs, 1):.0f} s"
    return f"{secs / 60:.0f} min" if secs < 5400 else f"{secs / 3600:.1f} h"


def text(facts, device="cpu", redo=(), depth_model=None):
    """The plan as a table and the sentences below it."""
    head = ("stream", "by", "on", "time, one core", "memory", "licence")
    rows = [head, *plan(facts, device, redo, depth_model)]
    widths = [max(len(r[i]) for r in rows) for i in range(len(head))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip() for row in rows]
    used = [adapters.of(r[0]).ABOUT for r in rows[1:] if r[5]]
    for about in used:
        lines.append(f"{about.stream}: {about.gives}")
        if about.weights_from:
            lines.append(f"{about.stream}: weights: {about.weights_from}")
    if used:
        lines.append(f"packages, fetched on the first run where uv is there: {', '.join(a.package for a in used)}")
    if device == "gpu" and used and not any("gpu" in a.devices for a in used):
        lines.append("nothing of this uses a GPU: it runs on the CPU")
    for stream, how in ELSEWHERE.items():
        if not facts.get(stream) and not (stream == "depth" and depth_model):
            lines.append(f"{stream}: missing, and not made here: {how}")
    if not facts.get("depth") and not depth_model and any(a.stream == "hands" for a in used):
        lines.append("hands: without depth their distance comes from an adult's size, to about a tenth")
    lines.append("nothing was run")
    return os.linesep.join(lines) + os.linesep
