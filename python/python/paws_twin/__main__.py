"""The `paws` command of the wheel: `python -m paws_twin`."""

import os
import signal
import sys
import sysconfig
from pathlib import Path


def say_program() -> None:
    """Tells `paws batch` what to start for each recording: of this process the program is Python."""
    name = "paws.exe" if sys.platform == "win32" else "paws"
    for folder in (sysconfig.get_path("scripts"), Path(sys.executable).parent):
        program = Path(folder) / name
        if program.is_file():
            os.environ.setdefault("PAWS_PROGRAM", str(program))
            return


def main() -> int:
    from . import _native

    # Nothing of Python runs from here on: Ctrl-C ends the process as it ends the program.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    say_program()
    return _native.main(["paws", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
