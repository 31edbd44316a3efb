"""Groups that the memory does not hold are halved, and one that is too large is told."""

import pytest

from paws_perceive import Failure, batches
from paws_perceive.batches import TooLarge


def test_groups_are_halved_until_they_fit_and_stay_small():
    asked, said = [], []

    def run(group):
        asked.append(len(group))
        if len(group) > 3:
            raise TooLarge
        return [10 * n for n in group]

    found = list(batches.each(iter(range(10)), 8, run, str, said.append))
    assert found == [(n, 10 * n) for n in range(10)]
    assert asked == [8, 4, 2, 2, 2, 2, 2] and len(said) == 2 and "going on with 4" in said[0]


def test_one_that_does_not_fit_is_told_with_the_size_to_use():
    def run(group):
        raise TooLarge

    with pytest.raises(Failure, match=r"1280 x 960: make them smaller \(--width 896\).*cache") as failure:
        list(batches.each([1], 4, run, lambda item: batches.smaller("depth", 1280, 960), str))
    assert isinstance(failure.value.__cause__, TooLarge)


def test_nothing_asks_nothing():
    assert list(batches.each([], 4, None, str)) == []
