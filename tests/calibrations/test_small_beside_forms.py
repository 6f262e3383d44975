"""Where a fit begins once more: causes that are small beside the free forms of their own places."""

from __future__ import annotations

from calibrations.discovery.additions import SMALL, Addition, start_small_at_forms
from calibrations.effects.catalogue import catalogue
from calibrations.free_forms.bases import Spline
from calibrations.free_forms.effect import free_form
from calibrations.free_forms.form import Form
from calibrations.model import Estimate

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
