"""A minimum of an Allan deviation is told where it is one, and not where chance makes the last times higher."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calibrations.noise.deviations import DeviationCurve, minimum_s, octaves
from calibrations.table import Array
from tests.calibrations.hidden_noise import fractional, white

N, RATE_HZ = 10_000, 10.0
Made = Callable[[np.random.Generator], Array]


def _turned(curve: DeviationCurve) -> DeviationCurve:
    """The longest time first."""
    turned = {name: getattr(curve, name)[::-1] for name in ("tau_s", "deviation", "low", "high", "edf")}
    return replace(curve, alpha=curve.alpha[::-1], **turned)


def told(make: Made, seeds: int) -> list[float]:
    curves = [octaves([make(np.random.default_rng(seed))], RATE_HZ) for seed in range(seeds)]
    return [at for at in map(minimum_s, curves) if at is not None]


@pytest.mark.parametrize(
    "make", [lambda r: white(r, N), lambda r: fractional(r, N), lambda r: white(r, N) + 0.5 * fractional(r, N)]
)
def test_averaging_for_longer_is_not_said_to_be_of_no_help_by_chance(make: Made) -> None:
    assert len(told(make, 40)) <= 1


def test_the_minimum_between_white_noise_and_a_walk_is_found_where_it_is() -> None:
    """At sqrt(3) times the ratio of the coefficients: 5.5 s."""
    found = told(lambda r: white(r, N) + 0.1 / np.sqrt(RATE_HZ) * np.cumsum(r.standard_normal(N)), 40)
    assert len(found) >= 38
    assert np.median(found) == pytest.approx(np.sqrt(3) * 10 / np.sqrt(10), rel=0.3)


def test_the_order_of_times_that_were_asked_for_is_no_matter() -> None:
    x = white(np.random.default_rng(1), N) + 0.1 * np.cumsum(np.random.default_rng(2).standard_normal(N))
    curve = octaves([x], RATE_HZ)
    back = _turned(curve)
    assert minimum_s(back) == minimum_s(curve) is not None


def test_shorter_times_are_no_longer_ones_in_whatever_order() -> None:
    curve = octaves([white(np.random.default_rng(1), N)], RATE_HZ)
    assert minimum_s(_turned(curve)) is None
