"""Folders of an object store, for programs that run `paws` on many machines: a recording fetched to this machine, a twin delivered.

    with storage.local("s3://bucket/recordings/kitchen") as folder:
        twin = paws_twin.twin(folder)
        storage.deliver(twin, "s3://bucket/twins/kitchen")

A path without a protocol is a folder of this machine. For others pip install 'paws-twin[storage]' and what fsspec asks for
(s3fs, gcsfs, adlfs).
"""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ._call import AnyPath, PawsError
from .twins import needed

#: The file that is delivered last: a folder that has it is whole.
LAST = "twin.json"


@contextlib.contextmanager
def local(folder: AnyPath) -> Iterator[Path]:
    """A folder on this machine: the one that is named, or a copy of a URL's that goes with the context."""
    if not _is_url(folder):
        yield Path(folder)
        return
    files, root = _store(folder)
    with tempfile.TemporaryDirectory(prefix="paws_fetched_") as temporary:
        # The name stays: it is the recording's.
        here = Path(temporary) / root.rsplit("/", 1)[-1]
        here.mkdir()
        found = [one for one in sorted(files.find(root)) if not one.endswith("/")]
        if not found:
            raise PawsError(f"{folder}: no such folder, or nothing is in it")
        targets = [here / one[len(root) :].lstrip("/") for one in found]
        for parent in {target.parent for target in targets}:
            parent.mkdir(parents=True, exist_ok=True)
        files.get(found, [str(target) for target in targets])
        yield here


def deliver(folder: AnyPath, target: AnyPath) -> None:
    """Copies a folder to a path or URL, `twin.json` last: where it is, all is."""
    home = Path(folder)
    found = sorted((one for one in home.rglob("*") if one.is_file()), key=lambda one: (one == home / LAST, one))
    names = [one.relative_to(home).as_posix() for one in found]
    if not _is_url(target):
        for source, name in zip(found, names):
            here = Path(target) / name
            here.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, here)
        return
    files, root = _store(target)
    for source, name in zip(found, names):
        to = f"{root}/{name}"
        # Most object stores have no folders, and nothing to make.
        files.makedirs(to.rsplit("/", 1)[0], exist_ok=True)
        files.put_file(str(source), to)


def is_delivered(target: AnyPath) -> bool:
    """Whether a twin was delivered to a path or URL, whole."""
    if not _is_url(target):
        return (Path(target) / LAST).is_file()
    files, root = _store(target)
    return bool(files.exists(f"{root}/{LAST}"))


def _is_url(path: AnyPath) -> bool:
    return "://" in os.fspath(path)


def _store(url: AnyPath) -> tuple[Any, str]:
    """A store and the path in it."""
    fsspec = needed("fsspec", "storage")
    try:
        files, root = fsspec.core.url_to_fs(os.fspath(url))
    except (ImportError, ValueError) as error:
        raise PawsError(f"{os.fspath(url)}: {error}") from error
    return files, root.rstrip("/")
