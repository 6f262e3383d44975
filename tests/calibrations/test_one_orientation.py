"""Poses of a sensor at rest: one orientation shows the bias and what changes it, and nothing that depends on force."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.discovery.enough import parse_enough
from calibrations.discovery.results import Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.errors import ModelError
from calibrations.fitting.fit import Fit, fit
from calibrations.free_forms.place_names import acts_at_rest, place_of_effect
from calibrations.loop import compare, dataset
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.calibrations.ramps import RATE_HZ, record

LEVEL = (0.0, 0.0)  # alpha and beta, deg: gravity along z
UPRIGHT = (90.0, 0.0)  # along x
BLOCK = 60  # samples of a mean
FORMS = {
    "line": {"line": 5e-4},
    "bow": {"line": 5e-4, "bow": 4e-3},
    "glue": {"line": 5e-4, "glue": 4e-3},
    "lag": {"line": 5e-4, "delay_s": 300.0},
}


def at_rest(angles: tuple[float, float] = UPRIGHT, seed: int = 1, axes: str = "x", **form: float) -> Table:
    """The table of the means of a temperature ramp at one orientation, the same in each axis but its noise."""
    random = np.random.default_rng(seed)
    columns: dict[str, np.ndarray] = {}
    for axis in axes:
        volts, warm = record(random, **form)
        columns[f"v{axis}_v"] = volts.reshape(-1, BLOCK).mean(axis=1)
    n = len(warm) // BLOCK
    columns |= {
        "alpha_deg": np.full(n, angles[0]),
        "beta_deg": np.full(n, angles[1]),
        "t_s": (np.arange(n) + 0.5) * BLOCK / RATE_HZ,
        "temperature_c": warm.reshape(-1, BLOCK).mean(axis=1),
        **{f"v{axis}_std_v": np.full(n, 1e-3) for axis in axes},
        "n": np.full(n, float(BLOCK)),
    }
    # independent samples: the filter is far above the rate
    return Table.from_columns("poses", columns, {"sample_rate_hz": RATE_HZ, "filter_corner_hz": 100.0}, "made")


def discovered(table: Table) -> Discovery[Fit]:
    return dataset(table).discover(read_model("linear"), catalogue())


@pytest.mark.parametrize("angles", [LEVEL, UPRIGHT])
@pytest.mark.parametrize("form", FORMS)
def test_what_follows_the_temperature_is_found_at_one_orientation(form: str, angles: tuple[float, float]) -> None:
    found = discovered(at_rest(angles, **FORMS[form]))
    assert found.causes
    assert all(place_of_effect(name) == "temperature-bias" for name in found.causes)
    assert all(acts_at_rest(place_of_effect(step.name)) for step in found.steps)
    assert found.end.pooled_excess < 0.1 * found.start.pooled_excess


def test_a_line_over_temperature_has_its_slope() -> None:
    found = discovered(at_rest(axes="xy", line=5e-4))
    assert found.causes == ("temperature-bias",)
    for axis in "xy":
        slope = found.model.params[f"temperature-bias.{axis}"]
        assert slope.value == pytest.approx(5e-4, abs=3 * slope.std)


@pytest.mark.parametrize("angles", [LEVEL, UPRIGHT])
def test_a_sensor_at_rest_without_an_effect_gets_none(angles: tuple[float, float]) -> None:
    for seed in range(3):
        assert discovered(at_rest(angles, seed)).steps == ()


def test_the_answer_names_what_one_orientation_cannot_show() -> None:
    table = at_rest(line=5e-4)
    text = discovered(table).judgement.text
    assert "scale factor" in text
    assert "rig run sweep" in text
    assert any("rig run sweep" in caution for caution in dataset(table).cautions(fit(read_model("linear"), table)))


def test_an_error_at_rest_is_in_the_unit_of_the_output() -> None:
    table = at_rest(line=5e-4)
    assert any(
        place.where == "temperature" and "mg" not in place.text for place in compare(table, read_model("linear")).fails
    )
    with pytest.raises(ModelError, match="one orientation"):
        dataset(table).discover(read_model("linear"), catalogue(), parse_enough("0.5mg"))
    assert dataset(table).discover(read_model("linear"), catalogue(), parse_enough("1mV")).steps
