"""Rivals of a place: what another place explains in its stead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibrations.discovery.structural import structure
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.free_forms.rivals import gain_and_rivals
from calibrations.model.file import read_model
from tests.calibrations.test_free_forms import forces_of_sweep, poses

VIBRATION = "column:std/vibration-rectification"


def test_a_curve_over_the_output_does_not_explain_a_vibration_that_the_output_holds() -> None:
    forces = forces_of_sweep()
    n = len(forces)
    level = 1 + 2 * np.abs(np.sin(0.37 * np.arange(n))) * np.random.default_rng(7).uniform(size=n)
    added = 2e-3 * np.sin(4 * forces[:, :2]) + 8e-4 * level[:, None] ** 2
    v = np.array([2.5, 2.52]) + np.array([1.0, 0.97]) * forces[:, :2] + added
    u = 2 * (v - (v.max() + v.min()) / 2) / np.ptp(v)
    data = poses(added + 8e-3 * u**2 - 5.6e-3 * u**3)
    data = replace(data, columns={**data.columns, "vx_std_v": 8e-4 * level, "vy_std_v": 8e-4 * level})
    result = structure(fit(read_model("linear"), data), catalogue()).result
    assert {VIBRATION, "output/adc-nonlinearity", "own-response/curve"} <= set(result.active)
    assert "output/curve" not in result.active
    gain, rivals = gain_and_rivals(result, [VIBRATION], {"output", "own-response"})
    assert gain > 1e4
    assert rivals == ()
