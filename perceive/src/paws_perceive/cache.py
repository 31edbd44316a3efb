"""What was computed, kept by what it was computed from.

A stream is a folder `STREAM-KEY`; the key is a hash of the adapter, its weights, its options and what it read. Items are
written in parts, each under another name first and then renamed, so that a run that is killed leaves whole parts only.
"""

import contextlib
import errno
import hashlib
import json
import os
import pathlib
import shutil

from . import Failure

# Digits of a key in a folder's name: enough that two never meet, few enough to read.
DIGITS = 16


def digest_of(path):
    """SHA-256 of a file's bytes, as hexadecimal digits."""
    total = hashlib.sha256()
    try:
        with open(path, "rb") as file:
            while block := file.read(1 << 20):
                total.update(block)
    except OSError as error:
        raise Failure(f"{path}: {error.strerror}") from error
    return total.hexdigest()


def key_of(facts):
    """A key of plain data: equal data give equal keys."""
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def write_whole(path, text):
    """Writes a file, of text or of bytes, that is the old one or the new one, never half of it."""
    path = pathlib.Path(path)
    beside = path.with_name(f".{path.name}.partial-{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(beside, "wb") as file:
            file.write(text.encode() if isinstance(text, str) else text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, path)
    except OSError as error:
        with contextlib.suppress(OSError):
            beside.unlink(missing_ok=True)
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise Failure(
                f"{path}: the disk is full; what is finished stays in the cache: make room, or name another folder with "
                "--cache, and run the same command again"
            ) from error
        raise Failure(f"{path}: {error.strerror}") from error


class Stream:
    """The items of one stream, by number, in parts of `per_part` items."""

    def __init__(self, cache, name, facts, per_part=16):
        self.facts = facts
        self.key = key_of(facts)
        self.folder = pathlib.Path(cache) / f"{name}-{self.key[:DIGITS]}"
        self.per_part = per_part

    def forget(self):
        """Removes what is kept."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def part(self, first):
        """The items from `first` on that are kept, or `None`. A part that cannot be read counts as not there."""
        try:
            items = json.loads(self._path(first).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return items if isinstance(items, list) else None

    def run(self, count, compute, progress=lambda done, count: None):
        """All items: those that are kept, and `compute(number)` for the others."""
        facts = self.folder / "facts.json"
        if not facts.exists():
            write_whole(facts, json.dumps(self.facts, indent=1, sort_keys=True) + "\n")
        items = []
        for first in range(0, count, self.per_part):
            last = min(first + self.per_part, count)
            kept = self.part(first)
            if kept is None or len(kept) != last - first:
                kept = [compute(number) for number in range(first, last)]
                write_whole(self._path(first), json.dumps(kept))
            items += kept
            progress(last, count)
        return items

    def _path(self, first):
        return self.folder / f"{first:06d}.json"
