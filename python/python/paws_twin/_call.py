"""Commands, called in this process through the native module, or in a child process."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

try:
    from . import _native
except ImportError:  # An editable copy without the wheel; PAWS_COMMAND says what to run instead.
    _native = None  # type: ignore[assignment]

#: A file or a folder: its path, or a Recording or Twin.
AnyPath = Union[str, "os.PathLike[str]"]

#: Called with a step's name, how much of it is done, and of how much.
Progress = Callable[[str, int, int], object]


class PawsError(Exception):
    """What `paws` says on an error: the file, the place, and the way out."""


@dataclass(frozen=True)
class Said:
    """What a command left: its exit code (0 done, 1 the answer is no or not whole), output and notes."""

    code: int
    out: str
    notes: tuple[str, ...]


def call(command: str, *args: object, progress: Progress | None = None, **options: object) -> Said:
    """Runs one command. `options` are its options with underscores: `as_is=True` is `--as-is`, a list repeats an option.

    The environment variable PAWS_COMMAND names a `paws` program to run in a child process instead; progress is not told then.
    """
    words = [command, *flags(options), *(["--", *map(text, args)] if args else [])]
    program = os.environ.get("PAWS_COMMAND")
    if program:
        code, out, notes, error = _in_child([program, *words])
    elif _native is not None:
        code, out, notes, error = _native.call(words, progress)
    else:
        raise PawsError("paws_twin._native is missing: pip install ./python, or set PAWS_COMMAND to the paws program")
    if error is not None:
        raise PawsError(error)
    return Said(code, out, tuple(line for line in notes.splitlines() if line.strip()))


def worker() -> list[str]:
    """The command that starts `paws` as a program of its own, a word each: `paws batch` starts it for each recording. Of a
    process that runs commands in itself the program is Python, or whatever holds it.
    """
    if not sys.executable:
        raise PawsError('this program does not say what its Python is: give worker=["paws"], the words that start paws')
    # Without -P a file of the current folder could take the place of a module.
    safe = ["-P"] if sys.version_info >= (3, 11) else []
    return [sys.executable, *safe, "-m", "paws_twin"]


def _in_child(words: list[str]) -> tuple[int, str, str, str | None]:
    try:
        done = subprocess.run(words, capture_output=True, text=True, errors="replace")
    except OSError as error:
        raise PawsError(f"PAWS_COMMAND={words[0]}: {error.strerror}") from error
    if done.returncode in (0, 1):
        return done.returncode, done.stdout, done.stderr, None
    notes, _, why = ("\n" + done.stderr).rpartition("\nerror: ")
    return 2, done.stdout, notes, why.strip() or f"{words[0]} ended with {done.returncode}"


def flags(options: Mapping[str, object]) -> list[str]:
    """Options as words of a command line; what is None or False is left out."""
    words = []
    for name, value in options.items():
        option = "--" + name.replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            words.append(option)
        elif isinstance(value, (list, tuple)):
            words.extend(f"{option}={text(one)}" for one in value)
        else:
            words.append(f"{option}={text(value)}")
    return words


def text(value: object) -> str:
    """A path, a number or a word as the command line has it."""
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


@contextlib.contextmanager
def config_file(config: object) -> Iterator[Any]:
    """`--config`'s value: a path or word as it is, a mapping as a TOML file that lives as long as the context."""
    if not isinstance(config, Mapping):
        yield config
        return
    with tempfile.TemporaryDirectory(prefix="paws_config_") as folder:
        path = Path(folder) / "config.toml"
        path.write_text(toml(config), encoding="utf-8")
        yield path


def toml(config: Mapping[str, object]) -> str:
    """`{"seed": 3, "validation": {"feedback": False}}` as TOML."""
    plain = {k: v for k, v in config.items() if not isinstance(v, Mapping)}
    lines = [f"{key} = {_toml_value(key, value)}" for key, value in plain.items()]
    for name, table in config.items():
        if isinstance(table, Mapping):
            lines.append(f"[{name}]")
            lines += [f"{key} = {_toml_value(key, value)}" for key, value in table.items()]
    return "\n".join(lines) + "\n"


def _toml_value(key: str, value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        # Python writes 1e-05, inf and nan as TOML does.
        return repr(value)
    if isinstance(value, str):
        quoted = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{quoted}"'
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml_value(key, one) for one in value) + "]"
    raise PawsError(f"config: {key}: {value!r} is no number, word, truth value or list of them")
