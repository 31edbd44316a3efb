"""The `paws` command of the wheel: `python -m paws_twin`."""

from __future__ import annotations

import signal
import sys

from ._call import worker


def with_worker(words: list[str]) -> list[str]:
    """A command line in which `paws batch` is told what to start for each recording."""
    if words[:1] == ["batch"] and not any(word.startswith("--worker") for word in words):
        return ["batch", *(f"--worker={word}" for word in worker()), *words[1:]]
    return words


def main() -> int:
    from . import _native

    # Nothing of Python runs from here on: Ctrl-C ends the process as it ends the program.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.main(["paws", *with_worker(sys.argv[1:])])


if __name__ == "__main__":
    sys.exit(main())
