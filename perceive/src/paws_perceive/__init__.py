"""Streams that a recording lacks, made by open networks. Started by `paws perceive`, usable alone."""

__version__ = "0.1.0"


class Failure(Exception):
    """What a person has to know: the file, the place, the way out. Ends the run with exit code 2."""
