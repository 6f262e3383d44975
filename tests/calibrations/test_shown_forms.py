"""Free forms of positions and motion, which a person asks for by name."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.discovery.findings import Step
from calibrations.discovery.rows import Rows
from calibrations.effects.catalogue import catalogue
from calibrations.errors import CalibrationError
from calibrations.fitting.fit import Fit, evaluate, fit
from calibrations.free_forms.requested import resolve_effect
from calibrations.loop import dataset
from calibrations.model.file import dump_model, parse_model, read_model
from calibrations.table import Array, Table
from tests.benchmark.shaking import MECHANISMS, measured

N, NOISE_G = 120, 1e-4
WARMTH = np.linspace(20.0, 30.0, N)
TIMES_S = 10.0 * np.arange(N)


def directions() -> Array:
    random = np.random.default_rng(3).standard_normal((N, 3))
    return np.asarray(random / np.linalg.norm(random, axis=1, keepdims=True))


UP = directions()
CURVES: dict[str, Array] = {
    "own-response": 2e-3 * np.sin(4 * UP),
    "cross-response": 2e-3 * np.sin(4 * UP[:, [1, 0, 0]]),
    "temperature-bias": 2e-3 * np.tanh(WARMTH - 25)[:, None] * [1.0, -0.5, 0.7],
    "time-bias": 2e-3 * np.exp(-TIMES_S / 200)[:, None] * [1.0, -0.5, 0.7],
    "column:supply_v": 2e-3 * ((WARMTH - 25) / 5)[:, None] ** 2 * [1.0, 1.0, 0.5],
}


def positions(added: Array | float = 0.0, rows: int = N) -> Table:
    noise = NOISE_G * np.random.default_rng(4).standard_normal(UP.shape)
    outputs = UP * [1.02, 0.98, 1.01] + [0.01, -0.02, 0.03] + added + noise
    columns = {
        "ax": outputs[:, 0], "ay": outputs[:, 1], "az": outputs[:, 2],
        "temperature_c": WARMTH, "t_s": TIMES_S, "supply_v": 5 + (WARMTH - 25) / 50,
        **{f"a{axis}_std": np.full(N, 10 * NOISE_G) for axis in "xyz"}, "n": np.full(N, 100.0),
    }  # fmt: skip
    return Table.from_columns("positions", columns, {}, "made").rows(np.arange(rows))


def with_form(place: str, data: Table) -> Step[Fit]:
    return Rows(data).add(resolve_effect(f"free:{place}", {}), read_model("linear"), catalogue()).steps[0]


@pytest.mark.parametrize("place", CURVES)
def test_a_form_of_positions_takes_up_the_curve_at_its_place(place: str) -> None:
    step = with_form(place, positions(CURVES[place]))
    assert step.before.pooled_excess > 4
    assert step.after.pooled_excess < 1.1
    assert step.after.held_out_excess < 1.3


def test_a_form_of_positions_changes_nothing_where_nothing_acts() -> None:
    data = positions()
    without, found = fit(read_model("linear"), data), with_form("own-response", data).after
    assert found.pooled_excess == pytest.approx(without.pooled_excess, rel=2e-2)
    for key, e in without.params.items():
        assert e.std is not None
        assert found.params[key].value == pytest.approx(e.value, abs=e.std)


def test_a_form_of_positions_is_read_again_from_its_model_file() -> None:
    data = positions(CURVES["own-response"])
    found = with_form("own-response", data).after
    again = evaluate(parse_model(dump_model(found.model), "again"), data)
    assert again is not None
    assert np.array_equal(again.residual, found.residual)


def test_the_known_derivatives_of_a_form_are_those_of_its_residual() -> None:
    found = with_form("own-response", positions(CURVES["own-response"])).after
    problem, k = found.problem, len(found.theta) - 1
    step = np.zeros(len(found.theta))
    step[k] = 1e-3 * found.theta[k]
    slope = (problem.residual(found.theta + step) - problem.residual(found.theta - step)) / (2 * step[k])
    assert found.jacobian[:, :, k] == pytest.approx(slope, rel=1e-3, abs=1e-3 * float(np.abs(slope).max()))


MOTION = {"own-response": ("cubic-nonlinearity", 0.02), "temperature-bias": ("temperature-bias", 2e-3)}


@pytest.mark.slow
@pytest.mark.parametrize("place", MOTION)
def test_a_form_of_motion_takes_up_the_curve_at_its_place(place: str) -> None:
    cause, size = MOTION[place]
    step = with_form(place, measured(((MECHANISMS[cause], size),), "two lines", 7))
    assert step.before.pooled_excess > 3
    assert step.after.held_out_excess < 1.3


BAD = {
    "free:history": (positions(), "needs a sweep of poses"),
    "free:own-response": (positions(rows=20), "needs 24 positions or more, and the data has 20"),
    "free:column:supply": (positions(), 'did you mean "supply_v"'),
}


@pytest.mark.parametrize("name", BAD)
def test_a_form_that_positions_cannot_show_is_refused_with_the_data_it_needs(name: str) -> None:
    data, message = BAD[name]
    with pytest.raises(CalibrationError, match=message):
        dataset(data).add(resolve_effect(name, {}), read_model("linear"), catalogue())
