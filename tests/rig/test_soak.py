"""A continuous record: every sample of the converter through the sockets into the record and back, at speed."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from rig.record import Record
from tests.benchmark.generation import SCANS, SOAK, by_numpy
from tests.benchmark.soak import SETTINGS, soak


def kept(record: Record, duration_s: float, block_s: float) -> list[Any]:
    return [each.samples for each in record.kept(soak(record, duration_s, block_s))]


def test_the_record_has_no_gap_and_is_the_same_whatever_the_blocks_are() -> None:
    with Record() as record:
        minutes, seconds = kept(record, 300.0, 60.0), kept(record, 300.0, 7.0)
    assert [len(block.volts) for block in minutes] == [60_000] * 5
    volts = [np.concatenate([block.volts for block in blocks]) for blocks in (minutes, seconds)]
    assert volts[0].shape == (300_000, len(SETTINGS.channels))
    assert np.array_equal(*volts)
    for before, after in pairwise(seconds):
        assert after.start_s == pytest.approx(before.start_s + len(before.volts) / before.rate_hz, abs=1e-9)


def test_the_state_that_every_block_is_kept_with_is_small() -> None:
    with Record() as record:
        run = soak(record, 1.0)
        state = record.state(run)
    assert state is not None
    assert len(str(state)) < 8000


def test_twenty_minutes_take_less_than_twice_what_numpy_needs_for_the_samples_alone() -> None:
    """Processor time, not wall time: other load on the machine meets both. The usual ratio is 1."""
    with Record() as record:
        soak(record, 10.0)
        whole = processor_s(lambda: soak(record, 1200.0))
    make = by_numpy(SOAK)
    plain = processor_s(lambda: [make() for _ in range(1_200_000 // SCANS)])
    assert whole < 2 * plain


def processor_s(call: Callable[[], Any]) -> float:
    began = time.process_time()
    call()
    return time.process_time() - began
