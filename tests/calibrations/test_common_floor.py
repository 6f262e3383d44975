"""Where nothing but what a model leaves tells the noise, the models of one search are counted in one floor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.discovery.results import Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.loop import dataset, diagnose, discover
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic

BENDING = (
    "bias", "scale-factor", "cross-axis-bias", "cubic-nonlinearity", "odd-quadratic-nonlinearity", "z-axis-bias",
    "z-axis-scale",
)  # fmt: skip
OFFSET_UT = np.array([12.0, -7.0, 20.0])


def upper(n: int, least: float, seed: int) -> Array:
    """Directions (n, 3) whose z is above `least`."""
    u = np.random.default_rng(seed).standard_normal((8 * n, 3))
    u /= np.linalg.norm(u, axis=1)[:, None]
    return u[u[:, 2] > least][:n]


def magnetometer(seed: int = 3) -> Table:
    """A hemisphere of directions, a magnet beside the sensor, and noise of 0.2 % that no column tells."""
    m = 48.0 * upper(100, 0.0, seed) + OFFSET_UT + 0.1 * np.random.default_rng(seed).standard_normal((100, 3))
    return Table.from_columns(
        "positions", dict(zip(("mx", "my", "mz"), m.T, strict=True)), {"unit": "uT"}, "hemisphere"
    )


def accelerometer(seed: int) -> Table:
    """Hardly more than a hemisphere, scale factors that differ, and noise of 5 mm/s2 that no column tells."""
    noise = 5e-3 * np.random.default_rng(seed).standard_normal((63, 3))
    a = 9.81 * (upper(63, -0.1, seed) * [1.02, 0.99, 1.01] + [0.1, -0.08, 0.15]) + noise
    return Table.from_columns("positions", dict(zip(("ax", "ay", "az"), a.T, strict=True)), {"unit": "m/s2"}, "upper")


def falls(found: Discovery) -> None:
    """The error falls to its floor, step by step."""
    errors = [found.start.pooled_excess, *(step.after.pooled_excess for step in found.steps)]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 5
    assert errors[-1] == pytest.approx(1.0, abs=0.1)


def test_a_magnet_is_found_though_no_column_tells_the_noise() -> None:
    found = discover(magnetometer(), read_model("field"))
    assert found.causes == ("hard-iron",)
    falls(found)
    offset = [e.value for e in found.end.model.terms[1].estimates]
    np.testing.assert_allclose(offset, OFFSET_UT, atol=0.5)
    said = diagnose(magnetometer(), read_model("field"))
    assert said.verdict == "effect-missing"
    assert said.held_out_before == pytest.approx(found.steps[0].held_out_before, rel=0.05)
    assert said.candidates[0].held_out_after < 0.2 * said.held_out_before
    falls(dataset(magnetometer()).add(catalogue()["hard-iron"], read_model("field"), catalogue()))


@pytest.mark.slow
def test_no_effect_is_added_that_makes_a_magnitude_of_anything() -> None:
    found = discover(accelerometer(1), read_model("common-scale"), {name: catalogue()[name] for name in BENDING})
    assert (found.causes, found.refinements) == (("scale-factor",), ())
    falls(found)
    scales = next(term.estimates for term in found.end.model.terms if term.name == "scale-factor")
    np.testing.assert_allclose([e.value / 9.81 for e in scales], [1.02, 0.99, 1.01], atol=0.01)


def mixed_poses(of_time: Array) -> Table:
    """104 poses in random order whose scale factor follows `of_time`; no column tells the noise of 50 uV."""
    columns = synthetic.turns((90, 30, 150, 60), step_deg=30.0)
    mixed = np.random.default_rng(5).permutation(len(columns["t_s"]))
    columns |= {name: columns[name][mixed] for name in ("alpha_deg", "beta_deg", "direction")}
    x, y, _ = synthetic.components(columns)
    told = synthetic.poses(columns, 2.5 + x * (1 + of_time), 2.5 + y * (1 + of_time))
    return replace(told, columns={name: column for name, column in told.columns.items() if name != "n"})


def test_a_scale_factor_that_warms_up_is_found_in_mixed_poses_of_unknown_noise() -> None:
    """The sign of what it adds changes from pose to pose, as that of noise does."""
    found = discover(mixed_poses(4e-3 * np.exp(-np.arange(104) / 15.0)), read_model("linear"))
    assert found.causes == ("warm-up-scale",)
    assert found.start.pooled_excess > 8
    assert found.end.pooled_excess < 1.2


def test_mixed_poses_of_unknown_noise_and_a_linear_sensor_miss_nothing() -> None:
    found = discover(mixed_poses(np.zeros(104)), read_model("linear"))
    assert found.causes == ()
    assert found.verdict == "adequate"


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 9, 17])
def test_a_scale_factor_that_follows_the_supply_is_found_in_few_poses_of_unknown_noise(seed: int) -> None:
    """It is a line over the supply, and no ratiometric output: only the free form of the cause describes it."""
    rng = np.random.default_rng(seed)
    z, beta = rng.uniform(-1, 1, 60), rng.uniform(0, 2 * np.pi, 60)
    supply_v = 5 + 0.1 * rng.standard_normal(60)
    load = np.sqrt(1 - z**2) * np.array([np.cos(beta), np.sin(beta)]) * (1 + 0.02 * (supply_v - 5))
    vx, vy = 2.5 + load + synthetic.NOISE_V * rng.standard_normal((60, 2)).T
    angles = {"alpha_deg": np.degrees(np.arccos(z)), "beta_deg": np.degrees(beta), "t_s": 20.0 * np.arange(60)}
    table = Table.from_columns("poses", {**angles, "vx_v": vx, "vy_v": vy, "supply_v": supply_v}, source="made")
    found = discover(table, read_model("linear"))
    assert found.causes == ("supply-sensitivity",)
    assert found.start.pooled_excess > 10
    assert found.end.pooled_excess < 1.2
