"""Samples of digital sensors as they arrive: lost, doubled, restarts, and the sensor's clock."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.digital.reception import Batch, Reception, Tally, TimeBase

WRAP = 2**32
DAY = 864_000_000
LINES = TimeBase(1e-6, (WRAP,))


def batch(times: Sequence[float] | None, missing: Sequence[int] | None = None, n: int = 0) -> Batch:
    n = len(times or missing or range(n))
    return Batch(
        np.arange(float(n)).reshape(n, 1),
        None if times is None else np.array(times, dtype=float),
        None if missing is None else np.array(missing),
    )


def received(*batches: Batch, base: TimeBase = LINES, rate_hz: float = 100.0, **keys: Any) -> Reception:
    reception = Reception(base, rate_hz, **keys)
    for k, one in enumerate(batches):
        reception.take(one, k / rate_hz)
    return reception


def test_a_sensor_that_begins_anew_is_noticed_between_records_and_inside_one() -> None:
    tally = Tally(LINES, "lines")
    for start_s, host_s in ((100.0, 1000.0), (110.0, 1010.0), (0.5, 1020.0)):
        reception = Reception(LINES, 100.0)
        for k in range(10):
            reception.take(batch([round(1e6 * (start_s + k / 100))]), host_s + k / 100)
        tally.add(reception, 0)
    assert tally.restarts == 1
    assert received(batch([5e6, 5.01e6, 0.0])).back


@pytest.mark.parametrize("wrap", [WRAP, DAY])
def test_the_wrap_of_the_time_is_no_loss_and_no_restart(wrap: int) -> None:
    base = TimeBase(1e-6, (DAY, WRAP))
    reception = received(*(batch([(wrap - 25_000 + k * 10_000) % wrap]) for k in range(6)), base=base)
    assert (reception.lost, reception.doubled, reception.back) == (0, 0, False)
    first, last = reception.moments
    assert last.sensor_s - first.sensor_s == pytest.approx(last.host_s - first.host_s, abs=1e-9)


@pytest.mark.parametrize("wrap", [WRAP, DAY])
def test_the_gain_of_the_clock_is_right_over_a_wrap_between_records(wrap: int) -> None:
    tally, base = Tally(TimeBase(1e-4, (DAY, WRAP)), "messages"), TimeBase(1e-4, (DAY, WRAP))
    for start in (wrap - 50_000, wrap + 50_000):
        reception = Reception(base, 100.0)
        for k in range(10):
            reception.take(batch([(start + 100 * k) % wrap]), 1e-4 * (start + 100 * k) * (1 - 50e-6))
        tally.add(reception, 0)
    assert tally.restarts == 0
    assert tally.gain == pytest.approx(50e-6, rel=1e-3)


def test_numbers_of_messages_tell_lost_and_repeated_samples() -> None:
    reception = received(batch(None, [0, 0, 3, -1, 0]), batch(None, [2, -1]), numbered=True)
    assert (reception.lost, reception.doubled, reception.count) == (5, 2, 5)
    assert reception.pull(5)[:, 0].tolist() == [0, 1, 2, 4, 0]


def test_a_time_of_milliseconds_counts_a_gap_only_where_a_number_is_missing() -> None:
    base = TimeBase(1e-3, ())
    jitter = received(batch([0, 1, 3, 3, 4], [0] * 5), base=base, rate_hz=1000.0)
    assert (jitter.lost, jitter.doubled) == (0, 0)  # the third is late by a count
    gap = received(batch([0, 1, 5], [0, 0, 2]), base=base, rate_hz=1000.0)
    assert gap.lost == 2
    other = received(batch([0, 10, 20], [0, 2, 0]), base=base, rate_hz=100.0)
    assert other.lost == 0  # messages of another kind were lost


def test_the_rate_is_that_of_the_host_whatever_arrives_together() -> None:
    reception = Reception(TimeBase(1e-6), 100.0)
    for at_s, n in ((0.0, 1), (0.2, 20), (0.4, 20), (1.0, 60)):
        reception.take(batch(None, None, n), at_s)
    assert reception.measured_rate_hz == pytest.approx(100.0)
    assert reception.moments == []


@given(
    st.lists(st.integers(0, 3), min_size=2, max_size=60),
    st.lists(st.integers(1, 5), max_size=20),
    st.integers(0, 2**33),
)
def test_samples_are_counted_alike_however_they_are_cut(steps: list[int], cuts: list[int], start: int) -> None:
    times = (start + 10_000 * np.cumsum(steps)) % WRAP
    whole, parts, at = received(batch(times.tolist())), Reception(LINES, 100.0), 0
    for n in [*cuts, len(times)]:
        if piece := times[at : at + n].tolist():
            parts.take(batch(piece), 0.0)
        at += n
    assert (parts.count, parts.lost, parts.doubled, parts.back) == (whole.count, whole.lost, whole.doubled, whole.back)
    assert whole.lost == sum(step - 1 for step in steps[1:] if step > 1)
    assert whole.doubled == steps[1:].count(0)
    assert not whole.back
    assert parts._sensor == whole._sensor
