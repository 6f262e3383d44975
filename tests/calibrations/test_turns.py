"""Turns of a gyroscope between rests: the rows, and a fit without noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from calibrations.analyses.hand_turns import fit_turns
from calibrations.errors import DataError, TooFewRows
from calibrations.fitting.problem_kinds import make_problem
from calibrations.geometry.triad import gravity_directions
from calibrations.geometry.turns import Turns, make_turns
from calibrations.model.file import read_model
from calibrations.table import Table

RATE_HZ, REST_S, TURN_S = 100.0, 1.0, 2.0
BIAS = np.array([0.3, -0.2, 0.1])
GAINS = np.diag([1.02, 0.97, -1.01])  # z is mounted the other way
LEANS_DEG = {"xy": 0.5, "xz": -0.3, "yx": 0.2, "yz": 0.4, "zx": -0.6, "zy": 0.1}


def sensing_axes() -> np.ndarray:
    axes = np.zeros((3, 3))
    for name, lean_deg in LEANS_DEG.items():
        axes["xyz".index(name[0]), "xyz".index(name[1])] = np.sin(np.radians(lean_deg))
    np.fill_diagonal(axes, np.sqrt(1 - np.sum(axes**2, axis=1)))
    return axes


def samples(turns: int = 12, scale: float = 1.0, noise: float = 0.0) -> dict[str, np.ndarray]:
    """Rests, and turns of varying rate about varying axes; outputs of the gyroscope are `scale` per deg/s."""
    rng = np.random.default_rng(4)
    up, parts = np.array([0.0, 0.0, 1.0]), []
    rest, moving = int(REST_S * RATE_HZ), int(TURN_S * RATE_HZ)
    share = np.sin(np.pi * (np.arange(moving) + 0.5) / moving) ** 2
    for k in range(turns):
        axis = np.cross(up, rng.standard_normal(3)) + 0.2 * rng.standard_normal(3)
        rates = np.outer(share, 90 * axis / np.linalg.norm(axis))
        rates += np.outer(np.sin(3 * np.pi * np.arange(moving) / moving), rng.standard_normal(3) * 5)
        ups = [up]
        for step in np.radians(rates) / RATE_HZ:
            ups.append(Rotation.from_rotvec(-step).apply(ups[-1]))
        rates = np.vstack([np.zeros((rest, 3)), rates, np.zeros((rest, 3))])
        force = np.vstack([np.tile(up, (rest, 1)), ups[1:], np.tile(ups[-1], (rest, 1))])
        resting = np.concatenate([np.ones(rest), np.zeros(moving), np.ones(rest)])
        up = ups[-1]
        gyro = scale * (BIAS + rates @ (GAINS @ sensing_axes()).T)
        parts.append(np.column_stack([np.full(len(gyro), k), resting, gyro, force]))
    rows = np.vstack(parts)
    rows[:, 2:] += noise * rng.standard_normal(rows[:, 2:].shape) * np.repeat([scale, 1e-2], 3)
    names = ("turn", "resting", "gx", "gy", "gz", "ax", "ay", "az")
    return {"t_s": np.arange(len(rows)) / RATE_HZ, **dict(zip(names, rows.T, strict=True))}


def table(columns: dict[str, np.ndarray], unit: str = "deg/s") -> Table:
    return Table.from_columns("turns", columns, {"sample_rate_hz": RATE_HZ, "unit": unit}, "a test")


@pytest.mark.parametrize(("scale", "unit"), [(1.0, "deg/s"), (np.pi / 180, "rad/s"), (131.0, "count"), (6e-3, "V")])
def test_a_fit_finds_bias_scale_and_angles_in_any_unit(scale: float, unit: str) -> None:
    fitted = fit_turns(table(samples(scale=scale, noise=0.02), unit))
    for k, axis in enumerate("xyz"):
        assert fitted.params[f"gyro-bias.{axis}"].value == pytest.approx(scale * BIAS[k], abs=5e-3 * scale)
        assert fitted.params[f"gyro-scale-factor.{axis}"].value == pytest.approx(scale * GAINS[k, k], rel=2e-3)
    for name, lean_deg in LEANS_DEG.items():
        sign = np.sign(GAINS["xyz".index(name[0]), "xyz".index(name[0])])
        assert sign * fitted.params[f"gyro-misalignment.{name}"].value == pytest.approx(sign * lean_deg, abs=0.05)


def test_without_error_nothing_is_left() -> None:
    turns = make_turns(table(samples()))
    rates = np.column_stack([turns.samples.column(f"g{axis}") for axis in "xyz"]) - BIAS
    true = np.linalg.solve(GAINS @ sensing_axes(), rates.T).T
    assert np.abs(turns.residual(true)).max() < 1e-3
    wrong = turns.residual(1.01 * true)[0]
    assert wrong == pytest.approx(0.01 * np.sum(turns.along[:, 0] * _mean_rates(turns), axis=1), rel=0.3, abs=0.05)


def _mean_rates(turns: Turns) -> np.ndarray:
    axes = np.column_stack([turns.column(f"axis_{axis}") for axis in "xyz"])
    return np.asarray(axes * turns.column("rate_deg_s")[:, None])


def test_the_derivatives_are_those_of_the_residual() -> None:
    problem = make_problem(read_model("gyroscope"), table(samples(noise=0.02)))
    theta = fit_turns(table(samples(noise=0.02))).theta[:6]
    jacobian = problem.jacobian(theta)
    for k, step in enumerate([1e-3] * 3 + [1e-4] * 3):
        sides = (problem.residual(theta + sign * step * np.eye(6)[k]) for sign in (1, -1))
        upper, lower = sides
        assert jacobian[:, :, k] == pytest.approx((upper - lower) / (2 * step), rel=0.1, abs=0.1)


def test_a_subset_of_turns_is_fitted_alike() -> None:
    turns = make_turns(table(samples()))
    some = turns.rows(np.arange(12) % 2 == 0)
    rates = np.column_stack([turns.samples.column(f"g{axis}") for axis in "xyz"])
    assert some.n == 6
    assert some.residual(rates) == pytest.approx(turns.residual(rates)[:, ::2])


def test_turns_without_a_rest_or_too_few_are_refused(golden) -> None:
    columns = samples(4)
    with golden.refused(TooFewRows):
        make_turns(table(columns))
    columns = samples()
    columns["resting"][-100:] = 0.0
    with golden.refused(DataError):
        make_turns(table(columns))


def test_a_gyroscope_that_does_not_change_is_refused(golden) -> None:
    columns = samples()
    columns |= {name: np.zeros(len(columns["t_s"])) for name in ("gx", "gy", "gz")}
    with golden.refused(DataError):
        make_turns(table(columns))


def test_directions_of_gravity_are_free_of_zero_gain_and_angles() -> None:
    rng = np.random.default_rng(2)
    ups = rng.standard_normal((14, 3))
    ups /= np.linalg.norm(ups, axis=1, keepdims=True)
    matrix = np.array([[0.8, 0.0, 0.0], [0.02, 0.82, 0.0], [-0.01, 0.015, 0.79]])
    assert gravity_directions(np.array([1.6, 1.7, 1.65]) + ups @ matrix.T) == pytest.approx(ups, abs=1e-6)
