"""Additions of a structural search: where a fit begins once more, and which additions are idle."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from calibrations.discovery import structural
from calibrations.discovery.additions import SMALL, Addition, start_small_at_forms
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.free_forms.bases import Spline
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.form import Form
from calibrations.model import Estimate
from calibrations.model.file import read_model
from tests.calibrations import synthetic

CURVE = Form("own-response", "curve", "own", (Spline(-1.1, 1.1, 8),), sizes=(1e-3, 1e-3))


def addition(name: str, **values: float) -> Addition:
    return Addition(catalogue()[name], {}, tuple(Estimate(key, "", value, None, "") for key, value in values.items()))


def test_only_what_is_linear_at_the_place_of_a_free_form_becomes_small() -> None:
    causes = [
        addition("quadratic-nonlinearity", square=0.02),
        addition("saturation", high=3.4, low=1.6, loss=0.5),
        addition("temperature-bias", slope=0.01),
    ]
    found = start_small_at_forms(causes, [Addition(free_form((CURVE,)))])
    values = [{e.name: e.value for e in cause.estimates} for cause in found]
    assert values == [{"square": SMALL * 0.02}, {"high": 3.4, "low": 1.6, "loss": 0.5}, {"slope": 0.01}]


def test_without_such_a_place_nothing_is_tried_again() -> None:
    assert start_small_at_forms([addition("temperature-bias", slope=0.01)], [Addition(free_form((CURVE,)))]) == []


def test_idle_additions_go_one_by_one_where_one_of_them_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    cause, needed, idle = (addition(name) for name in ("temperature-bias", "saturation", "quadratic-nonlinearity"))
    errors = {"temperature-bias": 2.0, "saturation": 2.0, "quadratic-nonlinearity": 1.99}
    fits = [SimpleNamespace(pooled_excess=e, held_out_excess=e) for e in (9.0, *errors.values())]

    def together(base: object, additions: list[Addition]) -> SimpleNamespace:
        held_out = 2.0 if needed in additions else 3.0  # without saturation unseen poses are predicted worse
        return SimpleNamespace(pooled_excess=2.0, held_out_excess=held_out)

    monkeypatch.setattr(structural, "fit_together", together)
    monkeypatch.setattr(structural, "fit_successively", lambda base, end, additions: [end for _ in additions])
    kept, _ = structural._without_idle_additions([cause, needed, idle], fits, ["temperature-bias"], [])
    assert [a.effect.name for a in kept] == ["temperature-bias", "saturation"]


def test_an_insignificant_cause_is_left_out_where_a_later_one_describes_its_part(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first, later = addition("cubic-nonlinearity"), addition("saturation")
    fits = [SimpleNamespace(pooled_excess=e, held_out_excess=e) for e in (9.0, 2.0, 1.0)]

    def together(base: object, additions: list[Addition]) -> SimpleNamespace:
        error = 1.0 if later in additions else 2.0
        return SimpleNamespace(pooled_excess=error, held_out_excess=error)

    monkeypatch.setattr(structural, "fit_together", together)
    monkeypatch.setattr(structural, "fit_successively", lambda base, end, additions: [end for _ in additions])
    for insignificant, names in ((["cubic-nonlinearity"], ["saturation"]), ([], ["cubic-nonlinearity", "saturation"])):
        kept, _ = structural._without_idle_additions([first, later], fits, ["saturation"], insignificant)
        assert [a.effect.name for a in kept] == names


def test_a_curve_is_left_out_without_which_unseen_poses_are_foreseen_better(monkeypatch: pytest.MonkeyPatch) -> None:
    added = [addition("quantisation"), addition("saturation"), Addition(free_form((CURVE,)))]
    held_out = (9.0, 4.0, 2.0, 4.0)
    fits = [SimpleNamespace(pooled_excess=1.0, held_out_excess=e) for e in held_out]

    def together(base: object, additions: list[Addition]) -> SimpleNamespace:
        error = 4.0 if added[2] in additions or added[1] not in additions else 2.0
        return SimpleNamespace(pooled_excess=1.0, held_out_excess=error)

    monkeypatch.setattr(structural, "fit_together", together)
    monkeypatch.setattr(structural, "fit_successively", lambda base, end, additions: [end for _ in additions])
    selected, remaining_fits = structural._without_raising_forms(added, fits)
    assert selected == added[:2]
    assert remaining_fits[-1].held_out_excess == 2.0


def test_beside_steps_a_cause_stays_while_the_curve_of_its_place_does(monkeypatch: pytest.MonkeyPatch) -> None:
    added = [addition("quadratic-nonlinearity"), addition("quantisation"), Addition(free_form((CURVE,)))]
    fits = [SimpleNamespace(pooled_excess=e, held_out_excess=e) for e in (9.0, 3.0, 2.0, 1.0)]

    def together(base: object, additions: list[Addition]) -> SimpleNamespace:
        error = 1.0 if added[2] in additions else 2.0  # the curve describes the quadratic nonlinearity as well
        return SimpleNamespace(pooled_excess=error, held_out_excess=error)

    monkeypatch.setattr(structural, "fit_together", together)
    monkeypatch.setattr(structural, "fit_successively", lambda base, end, additions: [end for _ in additions])
    assert structural._without_idle_additions(added, fits, [], [])[0] == added


def test_a_cause_whose_values_are_noise_in_the_fitted_model_is_not_significant() -> None:
    columns = synthetic.turns((90, 30, 150))
    a = np.column_stack(synthetic.components(columns))[:, :2]
    model = read_model("linear")
    causes = ("quadratic-nonlinearity", "hysteresis", "temperature-bias")
    for name in causes[:2]:
        model = model.with_effect(catalogue()[name])
    end = fit(model, synthetic.poses(columns, *(2.5 + a + 2e-3 * a**2).T))
    assert structural.significant_causes(end, causes) == {"quadratic-nonlinearity"}
    both_act = 2.5 + a + 2e-3 * a**2 + 1e-3 * columns["direction"][:, None] * (1 - a**2)
    assert structural.significant_causes(fit(model, synthetic.poses(columns, *both_act.T)), causes) == set(causes[:2])


def test_beside_the_curve_of_a_place_only_a_significant_cause_is_needed_or_all_where_none_is() -> None:
    with_curve = [("saturation", "quadratic-nonlinearity"), ("adc-nonlinearity",)]
    needed = structural.needed_causes(with_curve, {"saturation", "temperature-bias"})
    assert needed == {"saturation", "temperature-bias", "adc-nonlinearity"}
