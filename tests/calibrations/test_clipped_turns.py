"""Turns in which an output of a gyroscope reached the end of its range are noticed, and no model is fitted to them."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.analyses.hand_turns import fit_turns
from calibrations.discovery.input_doubts import doubts
from calibrations.errors import TooFewRows
from calibrations.geometry.clipped_turns import find_clipped_output, find_clipped_turns
from calibrations.geometry.turns import make_turns
from calibrations.table import Table
from tests.calibrations.test_turns import BIAS, GAINS, samples, table


def clipped(turns: tuple[int, ...], limit_deg_s: float = 60.0) -> Table:
    """Turns with noise; in some the outputs end at a limit."""
    columns = samples(noise=0.02)
    chosen = np.isin(columns["turn"], turns)
    for name in ("gx", "gy", "gz"):
        columns[name] = np.where(chosen, np.clip(columns[name], -limit_deg_s, limit_deg_s), columns[name])
    return table(columns)


def test_a_clipped_turn_is_named_and_not_used() -> None:
    data = clipped((3,))
    assert list(find_clipped_turns(data)) == [3]
    turns = make_turns(data)
    assert turns.numbers is not None
    assert list(turns.numbers) == [k for k in range(12) if k != 3]
    (doubt,) = [text for text in doubts(data) if "end of its range" in text]
    assert f"in turn 3 ({find_clipped_turns(data)[3]})" in doubt
    fitted = fit_turns(data)
    for k, axis in enumerate("xyz"):
        assert fitted.params[f"gyro-bias.{axis}"].value == pytest.approx(BIAS[k], abs=5e-3)
        assert fitted.params[f"gyro-scale-factor.{axis}"].value == pytest.approx(GAINS[k, k], rel=2e-3)


def test_turns_without_a_limit_raise_no_doubt() -> None:
    data = clipped(())
    assert find_clipped_turns(data) == {}
    assert not any("end of its range" in text for text in doubts(data))
    assert make_turns(data).n == 12


def test_too_few_turns_are_refused_with_the_number_of_clipped_ones(golden) -> None:
    data = clipped(tuple(range(12)), limit_deg_s=20.0)
    with golden.refused(TooFewRows):
        make_turns(data)


@pytest.mark.parametrize("rate_hz", [100.0, 1000.0])
@pytest.mark.parametrize("step", [1e-4, 0.06, 0.5])
@pytest.mark.parametrize("noise", [0.0, 0.05])
@pytest.mark.parametrize("peak_deg_s", [30.0, 90.0, 250.0])
def test_the_end_of_the_range_differs_from_the_peak_of_a_turn_in_coarse_steps(
    rate_hz: float, step: float, noise: float, peak_deg_s: float
) -> None:
    rng, n = np.random.default_rng(2), round(2 * rate_hz)

    def output(rates: np.ndarray) -> np.ndarray:
        return np.round((rates + noise * rng.standard_normal(rates.shape)) / step) * step

    rest, share = output(np.zeros((n, 3))), np.sin(np.pi * np.arange(n) / n) ** 2
    turn = output(np.outer(share, [peak_deg_s, 0.3, -0.5 * peak_deg_s]))
    assert find_clipped_output(turn, rest) is None
    limit = 0.4 * peak_deg_s
    assert find_clipped_output(np.clip(turn, -np.inf, limit), rest) == 0
    assert find_clipped_output(np.clip(turn, -limit, np.inf), rest) == 2
