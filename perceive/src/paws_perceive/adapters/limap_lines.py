"""Line segments by a detector of LIMAP, where the package `limap` (`pylimap`) is installed."""

from . import About, package

# LIMAP's own LSD: the detector that needs no weights.
METHOD = "lsd"
MOST = 3000

ABOUT = About(
    name="limap",
    stream="lines",
    package="pylimap",
    extra="lines",
    licence="BSD-3-Clause",
    needs="grey images; a Python that has the package (--python PATH)",
    gives="ends of line segments, pixels",
    devices=("cpu",),
    secs_per_frame=0.5,
    memory_mb=1000,
    version=1,
)


def digests(weights):
    """It has no weights."""
    return {}


class View:
    """What LIMAP's detectors ask of a camera's view: its image."""

    def __init__(self, grey):
        self._grey = grey

    def read_image(self, set_gray=True):
        """The grey image."""
        return self._grey


class Network:
    """A detector."""

    def __init__(self, detector):
        self._detector = detector

    def run(self, grey):
        """Segments of a grey image, n x 2 x 2: two ends of (column, row), pixels."""
        import numpy as np  # Not needed to say what this is.

        return np.asarray(self._detector.detect(View(grey)), float)[:, :4].reshape(-1, 2, 2)


def load(device="cpu", weights=None):
    """The detector."""
    module = package("limap.line2d", ABOUT)
    return Network(module.get_detector({"method": METHOD, "skip": False}, max_num_2d_segs=MOST, do_merge_lines=False))
