"""Both models and the displacement sensor: the paper's numbers on a rig whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calibrations.analyses.motion import MotionResult, acceleration, evaluate_motion
from calibrations.compensation.forward import steps_of
from calibrations.effects.catalogue import catalogue
from calibrations.errors import DataError, ModelError
from calibrations.fitting.fit import fit
from calibrations.model import Estimate, Model, Term
from calibrations.model.chain import respond, sensed, static_force
from calibrations.model.file import read_model
from calibrations.presentation.chart import Line
from calibrations.presentation.charts.motion import evaluation
from calibrations.presentation.static import png
from calibrations.table import STANDARD_GRAVITY, Array, Table
from tests.calibrations import shaken, synthetic

KAPPA = np.array([[0.0, 0.010, 0.0512], [0.012, 0.0, 0.030]])  # x reads 30.6 mg too much at the paper's attitude
NOISE_V = 155e-6  # density behind which 15 Hz leave the paper's 3.1 mV p-p
EXPECTED = 1e3 * shaken.GRAVITY * 0.0306  # mm/s^2


@cache
def models() -> tuple[Model, Model]:
    """The manufacturer's model from alpha = 90 deg, and the physical one from a whole sweep."""
    columns = synthetic.turns((90, 30, 150, 60, 120, 45, 135), step_deg=10)
    squares = np.column_stack(synthetic.components(columns)) ** 2 @ KAPPA.T
    x, y, _ = synthetic.components(columns)
    sweep = synthetic.poses(columns, 2.5 + x + squares[:, 0], 2.5 + y + squares[:, 1])
    ideal = synthetic.poses(columns, 2.5 + x, 2.5 + y)  # what a data sheet gives
    return fit(read_model("linear"), ideal).model, fit(read_model("physical"), sweep).model


@cache
def shaken_rig(seed: int = 0) -> Table:
    return shaken.record(duration_s=30.0, seed=seed, kappa=KAPPA, noise_v=NOISE_V)


@cache
def still() -> Table:
    moving = shaken.record(((1e-12, 10.0),), 30.0, seed=7, kappa=KAPPA, noise_v=NOISE_V)
    columns = {name: moving.column(name) for name in ("t_s", "vx_v")}
    return Table.from_columns("still", columns, moving.constants, "still")


@cache
def result(seed: int = 0) -> MotionResult:
    return evaluate_motion(shaken_rig(seed), *models(), still())


def test_the_physical_model_leaves_the_sensors_noise() -> None:
    found = [result(seed) for seed in range(4)]
    assert all(r.rmse_linear.value == pytest.approx(EXPECTED, abs=5) for r in found)
    assert all(r.improvement.value >= 0.97 for r in found)
    assert all(r.excess < 1.1 for r in found)


def test_noise_limit_is_that_of_the_paper() -> None:
    with_still, without = result().noise_limit, evaluate_motion(shaken_rig(), *models()).noise_limit
    # white noise in the band of a second-order Butterworth, pi / (2 sqrt 2) x 20 Hz, the line's correction 1.031
    expected = 1e3 * shaken.GRAVITY * NOISE_V * np.sqrt(np.pi / (2 * np.sqrt(2)) * 20) * 1.031
    assert with_still.value == pytest.approx(expected, abs=4 * with_still.std)
    assert without.value == pytest.approx(expected, abs=4 * without.std)


def test_amplitude_is_the_papers_with_its_uncertainty() -> None:
    true = 1e3 * 30e-6 * (2 * np.pi * 10) ** 2
    assert true == pytest.approx(118.4, abs=0.05)
    found = [result(seed).amplitude for seed in range(4)]
    assert all(abs(q.value - true) < 4 * q.std < 1e-3 * true for q in found)


@pytest.mark.slow
def test_uncertainties_are_the_scatter_between_records() -> None:
    found = [result(seed).rmse_physical for seed in range(12)]
    assert np.std([q.value for q in found]) == pytest.approx(np.mean([q.std for q in found]), rel=0.6)


def test_results_have_the_names_of_a_run() -> None:
    found = result().results
    assert {"rmse-linear-x", "rmse-physical-x", "improvement-x", "noise-limit-x", "amplitude"} <= set(found)
    assert found["improvement-x"].unit == "1"
    assert found["improvement-x"].value == pytest.approx(
        1 - found["rmse-physical-x"].value / found["rmse-linear-x"].value, rel=1e-12
    )


def test_the_errors_of_each_reference_are_stated() -> None:
    biases = result().biases
    assert any("Butterworth" in bias.name for bias in biases)
    assert all(bias.text for bias in biases)


def test_one_axis_takes_the_other_from_the_attitude() -> None:
    one = evaluate_motion(shaken.without_y(shaken_rig()), _of_x(models()[0]), _of_x(models()[1]), still())
    assert one.rmse_physical.value == pytest.approx(result().rmse_physical.value, abs=1.0)


def _of_x(model: Model) -> Model:
    terms = [replace(t, estimates=tuple(e for e in t.estimates if e.axis in ("x", ""))) for t in model.terms]
    return replace(model, terms=tuple(t for t in terms if t.name != "axis-nonorthogonality"))


def test_a_corner_that_the_model_holds_takes_the_place_of_the_nominal_one() -> None:
    moved = shaken.record(duration_s=30.0, kappa=KAPPA, noise_v=20e-6, corner_hz=13.0)
    filtered = fit(read_model("linear").with_effect(catalogue()["output-filter"]), _two_lines())
    term = next(t for t in filtered.model.terms if t.name == "output-filter")
    physical = models()[1]
    with_filter = replace(physical, terms=(*physical.terms, term))
    before, after = (evaluate_motion(moved, models()[0], m) for m in (physical, with_filter))
    assert before.excess > 4
    assert after.excess < 2


def _two_lines() -> Table:
    return shaken.record(shaken.TWO, 20.0, kappa=KAPPA, noise_v=20e-6, corner_hz=13.0)


def test_models_without_values_and_records_without_motion_are_said(golden) -> None:
    with golden.refused(ModelError):
        evaluate_motion(shaken_rig(), read_model("linear"), models()[1])
    with golden.refused(DataError):
        evaluate_motion(shaken.record(((1e-12, 10.0),)), *models())
    mirrored = {**shaken_rig().columns, "displacement_m": -shaken_rig().column("displacement_m")}
    with golden.refused(DataError):
        evaluate_motion(Table.from_columns("motion", mirrored, shaken.CONSTANTS, "mirrored"), *models())


def test_picture_shows_reference_models_and_errors() -> None:
    chart = evaluation(result())
    (above, other), (left, right) = chart.panels
    lines: list[Array] = [line.y for panel in (above, other) for line in panel.series if isinstance(line, Line)]
    n = len(lines[0])
    for drawn, values in zip(lines, ("linear", "reference", "physical", "reference"), strict=True):
        np.testing.assert_array_equal(drawn, getattr(result(), values)[:n])
    assert "rmse 300" in above.title
    assert all("(" in panel.y.label for panel in (above, left))
    assert left.x.label == right.x.label == "time (s)"
    assert png(chart).startswith(b"\x89PNG")


def test_motion_that_is_no_sine_is_followed() -> None:
    lines = tuple((40e-6 / f, f) for f in np.arange(3.0, 14.0, 0.37))  # none stands out of the others for long
    table = shaken.record(lines, 30.0, kappa=KAPPA, noise_v=NOISE_V)
    found = evaluate_motion(table, *models(), still())
    assert found.improvement.value > 0.97
    assert found.excess < 1.2
    assert np.ptp(found.reference) > 200


def test_a_line_above_the_motion_is_the_probes_hum() -> None:
    table = shaken_rig()
    hum = 2e-6 * np.sin(2 * np.pi * 50 * table.time_s)
    columns = {**table.columns, "displacement_m": table.column("displacement_m") + hum}
    found = evaluate_motion(Table.from_columns("motion", columns, table.constants), *models(), still())
    assert found.rmse_physical.value == pytest.approx(result().rmse_physical.value, rel=0.01)


def test_a_turned_sensor_on_a_tilted_stage_shows_the_acceleration_of_its_reference_edge() -> None:
    """Misalignment acts on gravity and on the motion; only gravity at the true angle of the stage is subtracted."""
    motion_m_s2 = np.array([0.0, 0.4, -1.5, 2.0])
    angles = {"alpha_deg": np.full(4, 70.0), "beta_deg": np.full(4, 35.0)}
    columns = {**angles, "t_s": np.arange(4.0), "displacement_m": np.zeros(4)}
    values = {"bias": 2.5, "scale-factor": 1.2, "axis-misalignment": 4.0, "stage-zero-offset": 3.0}
    model = Model("turned", tuple(_term(name, value) for name, value in values.items()))
    steps = steps_of(model)
    poses = Table.from_columns("poses", {**angles, "vx_v": np.zeros(4), "vy_v": np.zeros(4)})
    a = static_force(poses, steps)
    a[:, 0] += motion_m_s2 / STANDARD_GRAVITY
    vx_v, vy_v, _ = respond(sensed(a, poses, steps), poses, steps).T
    table = Table.from_columns("motion", {**columns, "vx_v": vx_v, "vy_v": vy_v})
    np.testing.assert_allclose(acceleration(table, model), motion_m_s2, atol=1e-6)


def _term(name: str, value: float) -> Term:
    effect = catalogue()[name]
    axes = {p.name: ("x", "y", "z") if p.per_axis else ("",) for p in effect.parameters}
    return Term(effect, estimates=tuple(Estimate(p, axis, value, 0.0, "") for p, each in axes.items() for axis in each))
