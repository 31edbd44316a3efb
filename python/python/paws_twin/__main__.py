"""The `paws` command of the wheel: `python -m paws_twin`."""

import os
import signal
import sys


def main() -> int:
    from . import _native

    # Nothing of Python runs from here on: Ctrl-C ends the process as it ends the program.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    program = os.path.abspath(sys.argv[0])
    if os.access(program, os.X_OK) and not program.endswith(".py"):
        # What `paws batch` starts for each recording: of this process it would be Python.
        os.environ.setdefault("PAWS_PROGRAM", program)
    return _native.main(["paws", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
