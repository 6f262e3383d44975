"""A curve that only many effects of the catalogue together approximate has no name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.discovery.verdict import Verdict
from calibrations.loop import discover
from calibrations.model.file import read_model
from tests.calibrations.test_requested_forms import FORCES, table

BIAS, SCALE = np.array([2.5, 2.52]), np.array([1.0, 0.97])


@pytest.mark.slow
def test_an_unknown_response_before_a_bent_converter_gets_no_names_of_four_effects() -> None:
    n = len(FORCES)
    level = 1 + 2 * np.abs(np.sin(0.37 * np.arange(n))) * np.random.default_rng(7).uniform(size=n)
    added = 2e-3 * np.sin(4 * FORCES[:, :2]) + 3e-4 * level[:, None] ** 2
    v = BIAS + SCALE * FORCES[:, :2] + added
    u = 2 * (v - (v.max() + v.min()) / 2) / np.ptp(v)
    data = table(added + 7e-3 * u**2 - 5e-3 * u**3)
    data = replace(data, columns={**data.columns, "vx_std_v": 8e-4 * level, "vy_std_v": 8e-4 * level})
    found = discover(data, read_model("linear"))
    assert found.causes == ("vibration-rectification",)  # no saturation, dead zone or polynomial beside it
    assert found.verdict is Verdict.UNEXPLAINED
    assert found.findings.places[0].name == "own-response"
