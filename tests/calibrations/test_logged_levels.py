"""The level of a logged column beneath the scatter of its readings, and the effects that it drives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.discovery.results import Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.effects.logged import follows_level, level, level_is_known, reading_error
from calibrations.estimators.scatter import without_scatter
from calibrations.fitting.fit import Fit, fit
from calibrations.loop import dataset
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic

SAMPLES = 500  # independent ones in the scatter of a mean


def wandering(random: np.random.Generator, n: int, rows: float) -> Array:
    """A Gauss-Markov process of standard deviation 1 that forgets within so many rows."""
    return synthetic.gauss_markov(random, 1.0, rows, np.ones(n))


@pytest.mark.parametrize(("rows", "scatter"), [(100.0, 0.1), (30.0, 0.3)])
def test_the_errors_of_a_level_are_as_large_as_stated(rows: float, scatter: float) -> None:
    """40 records: of the level, and of its change from row to row, which leads a thermometer."""
    actual, stated = [], []
    for seed in range(40):
        random = np.random.default_rng(seed)
        true = wandering(random, 300, rows)
        read = true + scatter * random.normal(size=300)
        found = without_scatter(read - read.mean(), len(read))
        off = found.values - (true - true.mean())
        actual.append([np.mean(off**2), np.mean(np.diff(off) ** 2)])
        stated.append([found.error**2, found.change_error**2])
    ratio = np.sqrt(np.mean(stated, axis=0) / np.mean(actual, axis=0))
    assert ratio == pytest.approx([1.0, 1.1], abs=0.25)


def sweep(outputs_v: Array, columns: dict[str, Array]) -> Table:
    """Poses of five inclinations with these additions to the outputs (n, 2) and these columns."""
    turns = synthetic.turns((90, 30, 150, 60, 120), step_deg=10)
    force = np.column_stack(synthetic.components(turns))[:, :2]
    outputs = np.array([2.5, 2.52]) + force * [1.0, 0.97] + outputs_v
    table = synthetic.poses(turns, outputs[:, 0], outputs[:, 1], seed=3)
    return Table.from_columns("poses", {**table.columns, **columns})


def rows() -> int:
    return len(synthetic.turns((90, 30, 150, 60, 120), step_deg=10)["beta_deg"])


def discover(table: Table) -> Discovery[Fit]:
    return dataset(table).discover(read_model("linear"), catalogue())


def vibrating(size_v: float) -> Table:
    """Outputs in proportion to the mean square of a vibration, whose estimate scatters by 4.5 % of a deviation."""
    random = np.random.default_rng(8)
    squares = np.exp(0.8 * wandering(random, rows(), 40.0))
    stds = {
        f"v{axis}_std_v": 5e-4 * np.sqrt(1 + squares) * random.normal(1, 1 / np.sqrt(SAMPLES), rows()) for axis in "xy"
    }
    added = size_v * (squares - squares.mean()) / squares.std()
    return sweep(np.outer(added, [1.0, 0.8]), stds)


def test_a_level_is_nearer_to_the_vibration_than_its_estimate() -> None:
    table = vibrating(0.0)
    squares = [table.column(name) ** 2 for name in table.std_names]
    levels = [level(table, name, 2) for name in table.std_names]
    assert np.corrcoef(*levels)[0, 1] > np.corrcoef(*squares)[0, 1]
    assert 0 < reading_error(table, "vx_std_v", 2) < 0.3


def test_peaks_of_a_standard_deviation_do_not_spoil_its_level_in_quiet_rows() -> None:
    """Its estimate scatters in proportion to itself, and its stated error is large enough; 10 records."""
    off, quiet_off, stated = [], [], []
    for seed in range(10):
        random = np.random.default_rng(seed)
        true = 1e-3 * np.exp(0.8 * wandering(random, rows(), 15.0))
        read = true * random.normal(1, 1 / np.sqrt(2 * SAMPLES), rows())
        table = sweep(np.zeros((rows(), 2)), {"vx_std_v": read, "vy_std_v": read})
        found = level(table, "vx_std_v", 2)
        relative = found / true**2 - 1
        quiet_off.append(np.mean(relative[true < np.median(true)] ** 2))
        off.append(np.mean((found - true**2) ** 2) / np.var(true**2))
        stated.append(reading_error(table, "vx_std_v", 2) ** 2)
    assert np.sqrt(np.mean(quiet_off)) < 0.1
    assert 0.9 < np.sqrt(np.mean(stated) / np.mean(off)) < 1.8


def test_standard_deviations_that_only_scatter_have_no_level() -> None:
    """Scatter alone has a slope over the record, which would follow any drift; 40 records."""
    known = 0
    for seed in range(40):
        random = np.random.default_rng(seed)
        stds = {f"v{axis}_std_v": 1e-3 * random.normal(1, 1 / np.sqrt(2 * SAMPLES), rows()) for axis in "xy"}
        table = sweep(np.zeros((rows(), 2)), stds)
        known += all(level_is_known(table, name, 2) for name in table.std_names)
    assert known <= 2


@pytest.mark.release
def test_vibration_of_a_noisy_estimate_has_one_name_and_its_whole_size() -> None:
    found = discover(vibrating(20 * synthetic.NOISE_V))
    assert found.causes == ("vibration-rectification",)
    term = next(t for t in found.findings.end.model.terms if t.name == "vibration-rectification")
    assert term.constants["level"] == 1.0


def test_a_supply_with_noisy_readings_has_one_name() -> None:
    """The noise is an eighth of the variation: a slope on the readings is too small, and its remainder seems a walk."""
    random = np.random.default_rng(2)
    supply = 5.0 + 1e-3 * wandering(random, rows(), 60.0)
    read = supply + 0.125e-3 * random.normal(size=rows())
    table = sweep(np.zeros((rows(), 2)), {"supply_v": read})
    found = discover(table.with_outputs(table.outputs * (supply / 5.0)[:, None]))
    assert found.causes == ("supply-sensitivity",)
    term = next(t for t in found.findings.end.model.terms if t.name == "supply-sensitivity")
    assert term.constants["level"] == 1.0


def test_outputs_that_follow_the_readings_are_driven_by_the_readings() -> None:
    """A supply that changes at random from pose to pose: what looks like scatter is felt by the sensor."""
    random = np.random.default_rng(5)
    supply = 5.0 + 1e-3 * wandering(random, rows(), 60.0) + 0.3e-3 * random.normal(size=rows())
    table = sweep(np.zeros((rows(), 2)), {"supply_v": supply})
    found = discover(table.with_outputs(table.outputs * (supply / 5.0)[:, None]))
    assert found.causes == ("supply-sensitivity",)
    assert found.findings.end.params["supply-sensitivity.x"].value == pytest.approx(1.0, abs=0.01)


def warmed(random: np.random.Generator, effect: str) -> Table:
    """Outputs that follow the temperature: 20 mV/K times 10 mK, the scatter of the thermometer, are 4 noise floors."""
    temperature = 24 + 2.2 * np.arange(rows()) / rows() + 0.1 * np.sin(np.arange(rows()) / 9)
    force = np.column_stack(synthetic.components(synthetic.turns((90, 30, 150, 60, 120), step_deg=10)))[:, :2]
    driven = force if effect == "temperature-scale" else np.ones_like(force)
    added = 20e-3 * (temperature - temperature.mean())[:, None] * driven * [1.0, 0.5]
    return sweep(added, {"temperature_c": temperature + 0.01 * random.normal(size=rows())})


@pytest.mark.parametrize("effect", ["temperature-scale", "temperature-bias"])
def test_a_sensor_feels_the_temperature_and_not_the_scatter_of_its_thermometer(effect: str) -> None:
    found = discover(warmed(np.random.default_rng(7), effect))
    assert found.causes == (effect,)
    assert [step.name for step in found.steps] == [effect]  # scatter that was taken for temperature leaves a curve
    assert found.steps[-1].held_out_after < 2.0
    term = next(t for t in found.findings.end.model.terms if t.name == effect)
    assert term.constants["level"] == 1.0


@pytest.mark.parametrize("effect", ["temperature-scale", "temperature-bias"])
def test_a_fit_without_a_search_uses_the_level_where_the_outputs_follow_it(effect: str) -> None:
    random = np.random.default_rng(7)
    table, model = warmed(random, effect), read_model("linear").with_effect(catalogue()[effect])
    of_level = fit(model, table)
    term = next(t for t in of_level.model.terms if t.name == effect)
    assert term.constants["level"] == 1.0
    of_readings = fit(replace(model, terms=(*model.terms[:-1], replace(term, constants={"level": 0.0}))), table)
    assert of_level.pooled_excess < 0.7 * of_readings.pooled_excess
    without = table.with_outputs(table.outputs - 0.02 * (table.column("temperature_c") - 25.0)[:, None])
    assert follows_level(without, ["temperature_c"]) == 0.0


@pytest.mark.parametrize("lead_s", [0.0, 200.0])
def test_a_lead_makes_the_error_of_a_level_larger(lead_s: float) -> None:
    table = vibrating(0.0)
    assert reading_error(table, "vx_std_v", 2, lead_s) >= reading_error(table, "vx_std_v", 2)


def test_the_level_of_a_single_row_is_its_logged_value() -> None:
    one = vibrating(0.0).rows(np.array([5]))
    assert level(one, "vx_std_v", 2) == pytest.approx(one.column("vx_std_v") ** 2, abs=0)
