"""Rivals of a place: what another place explains in its stead."""

from __future__ import annotations

from calibrations.discovery.structural import structure
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.free_forms.rivals import gain_and_rivals
from calibrations.model.file import read_model
from tests.calibrations.test_free_forms import bent_converter

VIBRATION = "column:std/vibration-rectification"


def test_a_curve_over_the_output_does_not_explain_a_vibration_that_the_output_holds() -> None:
    data = bent_converter(vibration=8e-4, bow=8e-3, bend=-5.6e-3)
    result = structure(fit(read_model("linear"), data), catalogue()).result
    assert {VIBRATION, "output/adc-nonlinearity", "own-response/curve"} <= set(result.active)
    assert "output/curve" not in result.active
    gain, rivals = gain_and_rivals(result, [VIBRATION], {"output", "own-response"})
    assert gain > 1e4
    assert rivals == ()
