"""One module per simulator. Each says what the simulator made of a file; what that means is in `definition.py`."""

import contextlib
import os
import sys
import tempfile


class Said:
    """What was printed."""

    text = ""


@contextlib.contextmanager
def captured():
    """Keeps what is printed meanwhile, also by native code."""
    said = Said()
    sys.stdout.flush()
    sys.stderr.flush()
    with tempfile.TemporaryFile() as sink:
        kept = [(fd, os.dup(fd)) for fd in (1, 2)]
        for fd, _ in kept:
            os.dup2(sink.fileno(), fd)
        try:
            yield said
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for fd, copy in kept:
                os.dup2(copy, fd)
                os.close(copy)
            sink.seek(0)
            said.text = sink.read().decode(errors="replace")
