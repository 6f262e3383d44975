"""A stated noise that holds something else: differences of neighbours show that, whatever slow error is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import calibrations as cal
from calibrations.table import Table
from tests.calibrations import synthetic

COLUMNS = synthetic.turns()
AX, AY, _ = synthetic.components(COLUMNS)
AGE = (COLUMNS["t_s"] - COLUMNS["t_s"][0]) / np.ptp(COLUMNS["t_s"])
SLOW_V = 2.5 * synthetic.NOISE_V * np.sqrt(2) * np.sin(3 * np.pi * AGE)


def stated(times: float, slow_v: float) -> Table:
    """A sensor that drifts a little, with a stated noise of a mean of some times the true one."""
    table = synthetic.poses(COLUMNS, 2.5 + AX + slow_v * SLOW_V, 2.5 + AY + slow_v * SLOW_V)
    spread = {name: times * table.column(name) for name in table.std_names}
    return replace(table, columns={**table.columns, **spread})


def test_a_drift_as_large_as_a_wrong_floor_is_found() -> None:
    result = cal.discover(stated(2.7, 1.0), "linear")
    assert [place.name for place in result.findings.places] == ["time-bias"]
    assert np.allclose(result.findings.end.noise.floor, synthetic.NOISE_V, rtol=0.15)


def test_a_right_floor_stays() -> None:
    result = cal.discover(stated(1.0, 0.0), "linear")
    assert not result.causes
    np.testing.assert_allclose(result.findings.end.noise.floor, synthetic.NOISE_V, rtol=1e-3)
