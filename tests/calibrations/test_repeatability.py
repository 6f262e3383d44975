"""Tumbles, the spread between them, and temperature coefficients, on numbers that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.analyses.stability import repeatability
from calibrations.analyses.tumble import Tumble, bias_coefficients, estimate_tumbles, scale_coefficients
from calibrations.errors import DataError
from calibrations.table import Table
from procedures.tumbles import tumble

WHITE_V = 50e-6


def table(paths: list[str], random: np.random.Generator | None = None, last: int | None = None) -> Table:
    """Tumbles with bias 2.5 V, 1.02 V/g, hysteresis of 3 mV and a cross-axis term of 20 mV/g."""
    poses = [pose for path in paths for pose in tumble(path)][:last]
    beta = np.radians([pose.beta_deg for pose in poses])
    side = np.array([pose.direction for pose in poses])
    noise = random.standard_normal(len(poses)) if random is not None else np.zeros(len(poses))
    volts = 2.5 + 1.02 * np.cos(beta) + 0.02 * np.sin(beta) + 3e-3 * side * np.sin(beta) + WHITE_V * noise
    columns = {
        "alpha_deg": np.full(len(poses), 90.0),
        "beta_deg": np.degrees(beta),
        "vx_v": volts,
        "vx_std_v": np.full(len(poses), WHITE_V * np.sqrt(100)),
        "n": np.full(len(poses), 100.0),
        "t_s": np.arange(float(len(poses))),
    }
    return Table.from_columns("poses", columns, {}, "tumbles", {"path": tuple(p.path for p in poses)})


def test_a_tumble_gives_bias_and_scale_whatever_hysteresis() -> None:
    (one,) = estimate_tumbles(table(["as-is 1"]), "x")
    assert (one.bias_v, one.scale_v_per_g) == pytest.approx((2.5, 1.02), abs=1e-12)


def test_its_standard_errors_are_true() -> None:
    random = np.random.default_rng(2)
    done = estimate_tumbles(table([f"as-is {k}" for k in range(400)], random), "x")
    assert np.std([t.bias_v for t in done]) == pytest.approx(done[0].bias_std_v, rel=0.1)
    assert np.std([t.scale_v_per_g / 1.02 for t in done]) == pytest.approx(done[0].scale_std, rel=0.1)


def test_an_incomplete_tumble_is_refused(golden) -> None:
    with golden.refused(DataError):
        estimate_tumbles(table(["as-is 1"], last=2), "x")
    with golden.refused(DataError):
        estimate_tumbles(table(["reference"]), "x")


def test_the_spread_between_is_freed_from_noise_on_the_mean() -> None:
    """2000 times six repetitions: 3 between them, noise of 2 on each."""
    random = np.random.default_rng(1)
    values = 3 * random.standard_normal((2000, 6)) + 2 * random.standard_normal((2000, 6))
    found = np.array([repeatability(row, [2.0] * 6) for row in values])
    assert np.mean(found[:, 0] ** 2) == pytest.approx(9.0, rel=0.1)
    within = np.abs(found[:, 0] - 3) < 2 * found[:, 1]
    assert 0.8 < within.mean() < 1.0


def test_noise_alone_is_no_spread_but_its_bound_is_told() -> None:
    value, std = repeatability([1.0, 1.1, 0.9], [0.5] * 3)
    assert value == 0
    assert std == pytest.approx(0.5)  # of the noise: that the values agree better is chance
    with pytest.raises(DataError, match="at least two repetitions"):
        repeatability([1.0], [0.1])


def test_the_standard_error_is_never_zero() -> None:
    assert repeatability([1.0, 1.0, 1.0], [0.5] * 3) == (0.0, pytest.approx(0.5))
    assert repeatability([1.0, 1.0, 1.0], [0.0] * 3) == (0.0, None)
    value, std = repeatability([1.0, 1.1, 0.9], [0.0] * 3)
    assert value == pytest.approx(0.1)
    assert std == pytest.approx(np.sqrt(0.02) - 0.1)


def steps(cycles: int, drift_v: float = 0.0, curve: float = 0.0) -> list[Tumble]:
    """1 mV/K, hysteresis 0.4 mV, 100 ppm/K."""
    made = []
    for k in range(1, cycles + 1):
        for way, c in (("up", 35), ("up", 50), ("up", 65), ("down", 50), ("down", 35)):
            t_s = float(len(made))
            side = {"up": 2e-4, "down": -2e-4}[way]
            bias_v = 2.5 + 1e-3 * c + side + drift_v * t_s + curve * (c - 50) ** 2
            made.append(Tumble(f"{way} {c} cycle {k}", t_s, float(c), bias_v, 1 + 1e-4 * (c - 47), 1e-6, 1e-6))
    return made


def test_temperature_coefficients_are_exact_without_noise() -> None:
    bias, scale = bias_coefficients(steps(1)), scale_coefficients(steps(1))
    assert (bias.slope[0], bias.hysteresis[0]) == pytest.approx((1e-3, 4e-4), abs=1e-9)
    assert scale.slope[0] == pytest.approx(1e-4, rel=1e-6)
    assert scale.hysteresis[0] == pytest.approx(0, abs=1e-12)


def test_two_cycles_tell_drift_from_hysteresis() -> None:
    assert bias_coefficients(steps(2, drift_v=1e-4)).hysteresis[0] == pytest.approx(4e-4, abs=1e-9)
    assert bias_coefficients(steps(1, drift_v=1e-4)).hysteresis[0] != pytest.approx(4e-4, abs=1e-4)


def test_what_a_straight_line_leaves_widens_the_standard_errors() -> None:
    assert bias_coefficients(steps(1, curve=1e-6)).slope[1] > 10 * bias_coefficients(steps(1)).slope[1]


def of_noise(std: float, count: int = 10) -> list[Tumble]:
    """The steps of two cycles, with 1 uV of scatter and the standard errors `std`."""
    random = np.random.default_rng(4)
    return [
        replace(step, bias_v=step.bias_v + 1e-6 * random.standard_normal(), bias_std_v=std, scale_std=std)
        for step in steps(2)[:count]
    ]


def test_without_known_noise_the_residual_gives_the_standard_errors() -> None:
    slope, hysteresis = bias_coefficients(of_noise(0.0)).slope, bias_coefficients(of_noise(0.0)).hysteresis
    known = bias_coefficients(of_noise(1e-6))
    assert (slope[0], hysteresis[0]) == pytest.approx((1e-3, 4e-4), abs=5e-6)
    assert (slope[1], hysteresis[1]) == pytest.approx((known.slope[1], known.hysteresis[1]), rel=1.0)
    assert slope[1] < 1e-7
    assert scale_coefficients(of_noise(0.0)).slope[1] < 1e-6


def test_a_tumble_of_unknown_noise_counts_like_the_others() -> None:
    one, *others = of_noise(1e-6)
    mixed = bias_coefficients([replace(one, bias_std_v=0.0), *others])
    assert mixed == bias_coefficients(of_noise(1e-6))


def test_no_scatter_and_no_known_noise_give_no_standard_error() -> None:
    three = [step for step in of_noise(0.0, 5) if step.temperature_c != 50]
    assert bias_coefficients(three).slope[0] == pytest.approx(1e-3, rel=0.01)
    assert np.isnan(bias_coefficients(three).slope[1])


def test_one_temperature_has_no_slope(golden) -> None:
    with golden.refused(DataError):
        bias_coefficients([step for step in steps(1) if step.temperature_c == 35])
