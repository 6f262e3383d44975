"""Processes of first order: what follows a target with a lag, and what wanders about zero with a memory."""

from __future__ import annotations

import math

from drivers.simulation.kernel import kernel


@kernel
def lagged(value: float, target: float, step_s: float, lag_s: float) -> float:
    """`value` after following a constant `target` for `step_s`."""
    return target if lag_s <= 0 else target + (value - target) * math.exp(-step_s / lag_s)


@kernel
def wandered(value: float, rms: float, time_s: float, step_s: float, normal: float) -> float:
    """An Ornstein-Uhlenbeck process, one exact step on: correlation time `time_s`, stationary `rms`."""
    kept = math.exp(-step_s / time_s)
    return kept * value + rms * math.sqrt(1 - kept * kept) * normal


def mean_variance(rms: float, time_s: float, interval_s: float, n: int) -> float:
    """Variance of the mean of `n` samples of such a process, `interval_s` apart: the exact sum."""
    if rms == 0:
        return 0.0
    rho = math.exp(-interval_s / time_s)
    pairs = n * (1 + rho) / (1 - rho) - 2 * rho * (1 - rho**n) / (1 - rho) ** 2
    return rms**2 * pairs / n**2
