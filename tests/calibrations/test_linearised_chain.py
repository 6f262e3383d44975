"""A chain in which one effect changes gives what the whole chain gives, worked out anew."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from calibrations.effects import Values
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.problem_kinds import make_problem
from calibrations.free_forms.bases import spline
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.form import TILT, TURNED, Form
from calibrations.model.chain import forward
from calibrations.model.file import read_model
from calibrations.model.linearised_chain import LinearisedChain
from calibrations.table import Table
from tests.calibrations import synthetic, test_common_floor

COLUMNS = synthetic.turns(inclinations_deg=(90, 30))
AX, AY, _ = synthetic.components(COLUMNS)
ROOM = {"temperature_c": 25 + np.sin(0.01 * COLUMNS["t_s"]), "supply_v": 5 + 1e-3 * np.cos(0.02 * COLUMNS["t_s"])}
TABLE = synthetic.poses(COLUMNS | ROOM, 2.5 + AX, 2.5 + AY)
EVERY = ("axis-misalignment", "stage-zero-offset", "dead-zone", "hysteresis", "temperature-hysteresis", "quantisation")


@pytest.mark.parametrize("name", ["bias", "scale-factor", *EVERY])
def test_one_effect_changes_as_in_the_whole_chain(name: str) -> None:
    model = read_model("linear")
    for each in EVERY:
        model = model.with_effect(catalogue()[each])
    problem = make_problem(model, TABLE)
    layout, theta = problem.layout, problem.layout.starts()[0] + problem.layout.typical / 10
    near, changed = (
        LinearisedChain(problem.table, layout.steps(theta)),
        theta + 0.3 * layout.typical * layout.of_effect(name),
    )
    term = layout.model.effects.index(name)
    found = near.output(term, layout.values(term, changed))
    np.testing.assert_array_equal(found, forward(problem.table, layout.steps(changed)))
    assert np.any(found != forward(problem.table, layout.steps(theta)))


def test_what_only_adds_has_derivatives_to_the_last_digits() -> None:
    problem = make_problem(read_model("linear").with_effect(catalogue()["hysteresis"]), TABLE)
    layout, theta = problem.layout, problem.layout.starts()[0]
    near, term = LinearisedChain(problem.table, layout.steps(theta)), layout.model.effects.index("hysteresis")
    values = layout.values(term, theta)
    more, less, whole = (
        near.output(term, Values({**values, "height": values["height"] * factor}))
        for factor in (1 + 1e-4, 1 - 1e-4, 1.0)
    )
    np.testing.assert_allclose((more - less) / 2e-4, whole, rtol=0, atol=1e-11 * np.max(np.abs(whole)))


@pytest.mark.parametrize("stairs", [False, True])
def test_derivatives_are_those_of_the_whole_chain(stairs: bool) -> None:
    model = read_model("linear")
    others = ("base-tilt", "stage-eccentricity", "temperature-scale", "cubic-nonlinearity", "supply-sensitivity")
    for each in (*EVERY, *others, "z-axis-scale", "cross-axis-scale"):
        if each != "quantisation" or stairs:
            model = model.with_effect(catalogue()[each])
    over_time = (spline(COLUMNS["t_s"], 4),)
    turning = (Form(TILT, name, "time", over_time, sizes=(1e-3,), shared=True) for name in TURNED)
    model = model.with_effect(free_form(tuple(turning)))
    converter = Form("output", "curve", "output", (spline(np.array([1.0, 4.0]), 6),), sizes=(1e-2,), shared=True)
    if not stairs:  # the derivatives of free forms are always by the mean slope of the stairs
        model = model.with_effect(free_form((converter,))).with_effect(catalogue()["adc-nonlinearity"])
    problem = make_problem(model, TABLE)
    theta = problem.layout.starts()[0] + problem.layout.typical / 10
    found, steps = problem.jacobian(theta, stairs=stairs), 1e-3 * np.diag(problem.layout.typical)
    for k, step in enumerate(steps):
        expected = (problem.residual(theta + step) - problem.residual(theta - step)) / (2 * step[k])
        np.testing.assert_allclose(found[:, :, k], expected, rtol=0, atol=1e-5 * max(np.max(np.abs(expected)), 1e-6))


SENSOR = ("scale-factor", "axis-misalignment", "quadratic-nonlinearity", "z-axis-scale", "dead-zone")


@pytest.mark.parametrize(
    ("table", "model", "effects"),
    [
        (test_common_floor.accelerometer(3), "common-scale", SENSOR),
        (test_common_floor.magnetometer(), "field", ("hard-iron",)),
    ],
    ids=["positions", "fields"],
)
def test_derivatives_of_magnitudes_are_those_of_the_way_back(
    table: Table, model: str, effects: tuple[str, ...]
) -> None:
    larger = read_model(model)
    for each in effects:
        larger = larger.with_effect(catalogue()[each])
    problem = make_problem(larger, table)
    theta = problem.layout.starts()[0] + problem.layout.typical / 30
    found, steps = problem.jacobian(theta), 1e-4 * np.diag(problem.layout.typical)
    for k, step in enumerate(steps):
        plain = (problem.residual(theta + step) - problem.residual(theta - step)) / (2 * step[k])
        np.testing.assert_allclose(found[:, :, k], plain, rtol=0, atol=1e-4 * np.max(np.abs(found[:, :, k])))


CONVERSIONS = ("supply-sensitivity", "saturation", "quantisation")


@pytest.mark.parametrize("order", list(permutations(CONVERSIONS)))
def test_an_output_at_its_limit_does_not_follow_the_supply_in_whatever_order_effects_are_added(
    order: tuple[str, ...],
) -> None:
    model = read_model("linear")
    for name in order:
        model = model.with_effect(catalogue()[name])
    layout = make_problem(model, TABLE).layout
    chosen = {
        "bias": 2.5,
        "scale": 1.0,
        "share": 1.0,
        "high": 3.2,
        "low": 1.0,
        "loss": 1.0,
        "step": 1e-6,
        "noise": 1e-5,
    }
    steps = layout.steps(np.array([chosen.get(slot.parameter.name, 0.0) for slot in layout.slots]))
    output, supply = forward(TABLE, steps), TABLE.column("supply_v")
    beyond = 2.5 + np.column_stack([AX, AY]) > 3.3
    assert np.count_nonzero(beyond) > 4
    np.testing.assert_allclose(output[beyond], 3.2, atol=1e-9)
    within = np.abs(AX) < 0.6
    np.testing.assert_allclose(output[within, 0] / (2.5 + AX[within]), supply[within] / supply.mean(), rtol=1e-6)
