"""Measured data of others, from the raw log to the discovery, against what their authors published."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from calibrations.discovery.results import Discovery
from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit
from calibrations.importing.raw_logs import average_still_positions
from calibrations.importing.units import ColumnMapping
from calibrations.loop import diagnose, discover
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.foreign_files import read_foreign

DATA = Path(__file__).parent.parent / "data"


def log(file: str, *mapped: str, rate_hz: float = 100.0, **constants: float) -> Table:
    table = read_foreign(DATA / file, "positions", [ColumnMapping.parse(m) for m in mapped], constants)
    return average_still_positions(table, rate_hz)


@cache
def xsens() -> Table:
    columns = ("t_s=1:s", "ax=2:counts", "ay=3:counts", "az=4:counts")
    return log("imu_tk_xsens/xsens_acc.mat.txt.gz", *columns, gravity_m_s2=9.81744)


@cache
def mikoff() -> Table:
    columns = ("ax=1:m/s2", "ay=2:m/s2", "az=3:m/s2")
    return log("mikoff_mpu9150/imu0.log.gz", *columns, gravity_m_s2=9.81)


def suarez() -> Table:
    return log("suarez_mpu6050/example_data_calibration.csv.gz", "ax=ax:counts", "ay=ay:counts", "az=az:counts")


@cache
def nine(data: Callable[[], Table]) -> Discovery[Fit]:
    """What is found beside biases and scale factors."""
    return discover(data(), read_model("linear"))


def values(found: Fit, effect: str) -> dict[str, float]:
    term = next(term for term in found.model.terms if term.name == effect)
    return {e.axis or e.name: e.value for e in term.estimates}


def test_every_position_of_the_xsens_log_is_found() -> None:
    table = xsens()
    assert table.n == 38
    assert table.column("n")[0] > 5000  # it lies still for the first 51 s


def test_the_error_falls_as_published() -> None:
    found = discover(xsens(), read_model("common-scale"))
    rms_mg = [1e3 * found.start.rmse[0], *(1e3 * step.after.rmse[0] for step in found.steps)]
    assert [step.name for step in found.steps] == ["scale-factor", "axis-nonorthogonality"]
    assert rms_mg == pytest.approx([3.80, 3.44, 0.10], abs=0.006)
    assert list(values(found.end, "bias").values()) == pytest.approx([33123.8, 33275.1, 32364.5], abs=0.5)
    assert found.verdict == "adequate"
    assert found.causes == ("scale-factor", "axis-nonorthogonality")


def test_nothing_beyond_nine_parameters_is_claimed() -> None:
    for data in (xsens, mikoff):
        found = nine(data)
        assert [step.name for step in found.steps] == ["axis-nonorthogonality"]
        again = diagnose(data(), found.end.model)
        assert again.verdict == "adequate"
        assert all(c.p_value > 0.05 for c in again.candidates)


def test_the_published_calibration_of_an_mpu9150_is_recovered() -> None:
    found = discover(mikoff(), read_model("common-scale")).end
    scale_percent = [100 * (s / 9.81 - 1) for s in values(found, "scale-factor").values()]
    assert scale_percent == pytest.approx([0.363, 0.315, 0.647], abs=0.02)
    assert list(values(found, "bias").values()) == pytest.approx([0.103, 0.097, 0.344], abs=0.002)
    assert sorted(abs(v) for v in values(found, "axis-nonorthogonality").values()) == pytest.approx(
        sorted([0.123, 0.02, 0.317]), abs=0.02
    )


def test_ten_positions_do_not_determine_nine_parameters() -> None:
    model = read_model("linear").with_effect(effect("axis-nonorthogonality"))
    found = fit(model, suarez())
    doubtful = [e for term in found.model.terms for e in term.estimates if not e.identified]
    assert [e.name for e in doubtful] == ["xy"]
    assert "is not smaller than a typical value" in str(doubtful[0].why)
    # the residual is tiny, and on positions that were left out the error is not
    assert diagnose(suarez(), model).held_out_before > 5 * found.pooled_excess


def effect(name: str) -> Effect:
    return catalogue()[name]


def test_the_noise_floor_of_still_positions_is_that_of_their_samples() -> None:
    found = fit(nine(xsens).end.model, xsens())
    assert 1e3 * found.noise.floor[0] == pytest.approx(0.038, abs=0.01)  # mg
    assert np.all(found.rmse > found.noise.floor)  # hands do not repeat a position to the sensor's noise
