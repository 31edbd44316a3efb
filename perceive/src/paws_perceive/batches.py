"""Many items at once, as many as the memory holds."""

from . import Failure

# Images that a network sees at once. On a CPU more of them are no faster.
AT_ONCE = {"cpu": 1, "gpu": 8}
# Widths that are named to people are multiples of this, pixels.
ROUND = 32


class TooLarge(Exception):
    """The memory does not hold what a network was given."""


def each(items, at_once, run, too_large, say=print):
    """Yields the items with what `run(list of items)` gives for each, in order.

    A group that does not fit is halved, and later groups stay as small; where one item alone does not fit, `too_large(item)` says
    what to do.
    """
    items = iter(items)
    waiting = []
    while True:
        while len(waiting) < at_once:
            item = next(items, None)
            if item is None:
                break
            waiting.append(item)
        if not waiting:
            return
        group = waiting[:at_once]
        try:
            results = run(group)
        except TooLarge as error:
            if len(group) == 1:
                raise Failure(too_large(group[0])) from error
            at_once = len(group) // 2
            say(f"the memory does not hold {len(group)} at once: going on with {at_once}")
            continue
        waiting = waiting[len(group) :]
        yield from zip(group, results)


def smaller(stream, width, height):
    """What to do where one image of a size does not fit: the sentence names a size with half of its pixels."""
    less = max(int(width / 2**0.5) // ROUND * ROUND, ROUND)
    return (
        f"{stream}: the memory does not hold one image of {width} x {height}: make them smaller (--width {less}), take a smaller model, "
        "or leave out --gpu; what is finished stays in the cache"
    )
