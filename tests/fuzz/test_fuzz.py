"""Thousands of inputs that are nearly right, into every decoder and reader: only documented errors, in bounded time.

`python -m tests.benchmark.fuzz` tries ten million, and looks for new ways through the code (coverage-guided).
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from tests.fuzz.files import remove
from tests.fuzz.mutation import LONGEST, mutated
from tests.fuzz.targets import TARGETS
from tests.slow import first_fast

FEW, FEWEST, MOST = 40, 60, 1500  # inputs of a target: a few in every test, else as many as its weight allows
LONGEST_S = 2.0  # of one input; what grows with the square of its length would take minutes


@pytest.fixture(autouse=True, scope="module")
def clean() -> Iterator[None]:
    """No input stays behind as a file."""
    yield
    remove()


@pytest.mark.parametrize("few", first_fast([True, False]))
@pytest.mark.parametrize("name", TARGETS)
def test_what_is_nearly_right_is_taken_or_refused(name: str, few: bool) -> None:
    target = TARGETS[name]
    taken = 0
    for data in mutated(target.seeds, 0, FEW if few else min(MOST, max(FEWEST, 20 * target.weight))):
        began = time.process_time()
        with suppress(*target.errors):
            target.take(data)
            taken += 1
        assert time.process_time() - began < LONGEST_S, data
    assert few or taken, "some are right"


def test_a_target_does_not_depend_on_those_that_were_tried_before() -> None:
    TARGETS["level-request"].take(TARGETS["level-request"].seeds[0])  # the time of the world of the twins grows
    TARGETS["gcs-request"].take(b"SVO 1 1\nMOV 1 10.0\nERR?\n")


def test_the_same_seed_gives_the_same_inputs() -> None:
    first, again, other = (list(mutated([b"hello", b"world"], seed, 200)) for seed in (1, 1, 2))
    assert first == again != other
    assert all(len(data) <= LONGEST for data in first)
