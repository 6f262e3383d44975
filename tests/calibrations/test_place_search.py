"""The search for places in positions and motion: what acts there, whether or not the catalogue has its form."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calibrations.discovery.curves import place_curves
from calibrations.discovery.place_search import _possible_places
from calibrations.discovery.results import Discovery
from calibrations.discovery.verdict import Verdict
from calibrations.documents import places_document
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.determined import loses_parameters
from calibrations.fitting.fit import Fit, fit
from calibrations.loop import discover
from calibrations.model.file import read_model
from calibrations.presentation.charts.places import forms_through, model_curves, place_pictures
from calibrations.presentation.report.report import _steps
from calibrations.table import Array, Table
from tests.benchmark.shaking import Mechanism, Signals, measured, size_for
from tests.calibrations.hand_held import SHARES, Held, N

SEEDS = (1, 2)
UNKNOWN_CURVES: dict[str, Callable[[Held], Array]] = {
    "cross-response": lambda held: 2e-3 * np.sin(4 * held.up[:, [1, 0, 0]]) * SHARES,
    "own-response": lambda held: 3e-3 * np.tanh((held.up - 0.4) / 0.1) * SHARES,
    "z-response": lambda held: 2e-3 * np.tanh(3 * held.up[:, [2, 2, 1]]) ** 2 * SHARES,
    "temperature-scale": lambda held: 2e-3 * np.sin(held.temperature_c - 25)[:, None] * held.up,
    "time-bias": lambda held: 2e-3 * np.sin(held.t_s / 100)[:, None] * SHARES,
}


def discovered(data: Table) -> Discovery[Fit]:
    return discover(data, read_model("linear"))


def quadratic(held: Held) -> Array:
    return np.asarray(3e-3 * held.up**2 * SHARES)


def warming(held: Held, bend: float = 0.0) -> Array:
    u = (held.temperature_c - 25) / 5
    return np.asarray(1.5e-3 * (u + bend * u**2)[:, None] * SHARES)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("place", UNKNOWN_CURVES)
def test_an_unknown_cause_has_its_place_and_no_name(place: str, seed: int) -> None:
    held = Held(seed)
    found = discovered(held.table(UNKNOWN_CURVES[place](held)))
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.causes == ()
    assert [acting.name for acting in found.findings.places] == [place]
    assert found.end.held_out_excess < 1.5 < found.start.held_out_excess
    assert found.findings.curves == (f"free:{place}",)
    assert "exact form" not in found.judgement.text  # a curve without a cause refines nothing
    assert _steps(found).rows[-1][-1] == "unknown cause"


@pytest.mark.slow
def test_the_curve_of_a_place_is_the_function_that_acts_within_its_band() -> None:
    held = Held(1)
    found = discovered(held.table(UNKNOWN_CURVES["cross-response"](held)))
    curve = place_curves(found.findings)["cross-response"]
    assert (curve.driver, curve.unit) == ("force along the other axis", "g")
    x = held.up[:, 1]
    line = np.polyfit(x, 2e-3 * np.sin(4 * x), 1)  # linear parts belong to the geometry
    true = 2e-3 * np.sin(4 * curve.at["x"]) - np.polyval(line, curve.at["x"])
    assert np.mean(np.abs(curve.value["x"] - true) < 3 * curve.std["x"]) > 0.9
    assert np.max(np.abs(curve.value["x"] - true)) < 0.15 * np.ptp(true)
    assert np.mean(curve.std["x"]) < 3 * np.std(curve.value["x"] - true)
    (document,) = places_document(found)
    assert document["place"] == "cross-response"
    assert document["curve"]["unit"] == "g"
    assert [picture.name for picture in place_pictures(found)] == ["shares", "place-cross-response"]


@pytest.mark.slow
def test_effects_of_the_catalogue_leave_no_form() -> None:
    held = Held(1)
    found = discovered(held.table(quadratic(held) + warming(held)))
    assert set(found.causes) == {"quadratic-nonlinearity", "temperature-bias"}
    assert {step.name for step in found.steps} == set(found.causes)
    assert found.end.pooled_excess < 1.1


@pytest.mark.slow
def test_what_a_model_has_already_is_not_found_again() -> None:
    held = Held(1)
    data = held.table(quadratic(held) + UNKNOWN_CURVES["cross-response"](held))
    model = read_model("linear").with_effect(catalogue()["quadratic-nonlinearity"])
    found = discover(data, model)
    assert [step.name for step in found.steps] == ["free:cross-response"]
    again = discover(data, found.end.model)
    assert (again.verdict, again.steps) == (Verdict.ADEQUATE, ())


@pytest.mark.slow
def test_a_second_place_is_found_beside_the_form_that_a_model_has() -> None:
    held = Held(1)
    one = UNKNOWN_CURVES["cross-response"](held)
    known = discovered(held.table(one)).end
    assert "cross-response" not in _possible_places(known)
    model = known.model
    found = discover(held.table(one + UNKNOWN_CURVES["time-bias"](held)), model)
    assert [step.name for step in found.steps] == ["free:time-bias"]
    assert found.end.held_out_excess < 1.5


def test_a_cause_in_another_form_keeps_its_curve() -> None:
    held = Held(1)
    found = discovered(held.table(warming(held, bend=0.4)))
    assert found.causes == ("temperature-bias",)
    assert [step.name for step in found.steps] == ["temperature-bias", "free:temperature-bias"]
    assert found.end.model.name == "linear+temperature-bias+free:temperature-bias"
    assert found.findings.curves == ()
    (curve,) = model_curves(found.end)
    assert "temperature-bias" in [form.name for form in forms_through(found.end, curve)]


def test_positions_that_all_have_one_force_are_no_calibration() -> None:
    right = fit(read_model("linear"), Held(1).table())
    theta = right.theta.copy()
    theta[[1, 3, 4, 5]] = -1e7, 1e4, 1e7, 1e4  # bias y, scale factors: every force is (0, 1, 0)
    wrong = replace(right, theta=theta, residual=right.problem.residual(theta))
    assert wrong.pooled_excess < 1.5
    assert loses_parameters(right, wrong)
    assert not loses_parameters(right, right)


def test_geometry_is_named_beside_a_cause() -> None:
    held = Held(1)
    turned = 3e-3 * held.up[:, [1, 0, 1]] * [1.0, -1.0, 0.5]
    found = discovered(held.table(turned + 3e-3 * held.up**3 * SHARES))
    assert set(found.causes) == {"cubic-nonlinearity", "axis-nonorthogonality"}


def test_a_place_is_found_where_the_noise_is_not_stated() -> None:
    held = Held(1)
    data = held.table(UNKNOWN_CURVES["cross-response"](held))
    columns = {name: values for name, values in data.columns.items() if name != "n" and not name.endswith("_std")}
    found = discovered(Table.from_columns("positions", columns, data.constants, "without noise"))
    assert (found.causes, [place.name for place in found.findings.places]) == ((), ["cross-response"])


@pytest.mark.slow
def test_the_scatter_of_the_hand_has_no_place() -> None:
    for seed in range(2):
        found = discovered(Held(seed).table(scatter=3.0))
        assert (found.causes, found.steps, found.findings.places) == ((), (), ())


@pytest.mark.slow
def test_a_place_is_found_beside_the_scatter_of_the_hand() -> None:
    held = Held(1)
    found = discovered(held.table(2 * UNKNOWN_CURVES["own-response"](held), scatter=3.0))
    assert [place.name for place in found.findings.places] == ["own-response"]
    assert found.end.pooled_excess == pytest.approx(np.hypot(1, 3), rel=0.15)  # the curve does not follow the scatter


@pytest.mark.slow
def test_the_order_of_rows_changes_no_place() -> None:
    held = Held(2)
    data = held.table(UNKNOWN_CURVES["own-response"](held))
    shuffled = data.rows(np.random.default_rng(0).permutation(N))
    ends = [discovered(table).end for table in (data, shuffled)]
    assert ends[0].model.effects == ends[1].model.effects
    assert ends[0].pooled_excess == pytest.approx(ends[1].pooled_excess, rel=1e-6)


def test_a_place_that_is_left_out_is_not_found() -> None:
    held = Held(1)
    data = held.table(UNKNOWN_CURVES["cross-response"](held))
    found = discover(data, read_model("linear"), without=["cross-response"])
    assert "cross-response" not in [place.name for place in found.findings.places]


@pytest.mark.release
def test_an_unknown_cause_of_a_motion_has_its_place() -> None:
    def bend(s: Signals, size: float) -> Array:
        return np.asarray(size * np.tanh((s.temperature - 23.5) / 0.3)[:, None] * [1.0, 0.7])

    mechanism = Mechanism("", 1e-3, response=bend)
    found = discovered(measured(((mechanism, size_for(mechanism, 10.0, "two lines", 0)),), "two lines", 0))
    (place,) = found.findings.places
    assert place.name in ("temperature-bias", "time-bias")
    assert found.end.held_out_excess < 1.5 < found.start.held_out_excess
    assert place.name in place_curves(found.findings)
