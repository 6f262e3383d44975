"""A bent converter, an unknown response and rectified vibration in one sensor: the causes named, and their rivals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.discovery.structural import structure
from calibrations.discovery.verdict import Verdict
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.free_forms.rivals import gain_and_rivals
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.calibrations.test_free_forms import discover, forces_of_sweep, poses

VIBRATION = "column:std/vibration-rectification"


def bent_converter(vibration: float, bow: float, bend: float) -> Table:
    """An unknown response of its own and rectified vibration of size `vibration`, V, before a bent converter."""
    forces = forces_of_sweep()
    n = len(forces)
    level = 1 + 2 * np.abs(np.sin(0.37 * np.arange(n))) * np.random.default_rng(7).uniform(size=n)
    added = 2e-3 * np.sin(4 * forces[:, :2]) + vibration * level[:, None] ** 2
    v = np.array([2.5, 2.52]) + np.array([1.0, 0.97]) * forces[:, :2] + added
    u = 2 * (v - (v.max() + v.min()) / 2) / np.ptp(v)
    made = poses(added + bow * u**2 + bend * u**3)
    return replace(made, columns={**made.columns, "vx_std_v": 8e-4 * level, "vy_std_v": 8e-4 * level})


@pytest.mark.slow
def test_an_unknown_response_before_a_bent_converter_gets_no_names_of_four_effects() -> None:
    found = discover(bent_converter(vibration=3e-4, bow=7e-3, bend=-5e-3))
    assert found.causes == ("vibration-rectification",)  # no saturation, dead zone or polynomial beside it
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.findings.places[0].name == "own-response"


def test_a_curve_over_the_output_does_not_explain_a_vibration_that_the_output_holds() -> None:
    data = bent_converter(vibration=8e-4, bow=8e-3, bend=-5.6e-3)
    result = structure(fit(read_model("linear"), data), catalogue()).result
    assert {VIBRATION, "output/adc-nonlinearity", "own-response/curve"} <= set(result.active)
    assert "output/curve" not in result.active
    gain, rivals = gain_and_rivals(result, [VIBRATION], {"output", "own-response"})
    assert gain > 1e4
    assert rivals == ()
