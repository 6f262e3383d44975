"""Parameters as a table: changes, reasons, correlations."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.model.file import read_model
from calibrations.presentation.parameter_table import correlations, parameter_rows, tab_separated
from calibrations.table import Table

LINEAR = read_model("linear")
TURNED = LINEAR.with_effect(catalogue()["axis-misalignment"])


def on_one_circle(step_deg: float = 30.0) -> Table:
    beta = np.arange(0.0, 360.0, step_deg)
    g = np.cos(np.radians(beta)), np.sin(np.radians(beta))
    random = np.random.default_rng(1)
    volts = {
        f"v{axis}_v": 2.5 + 0.9 * a + 1e-4 * random.standard_normal(len(a)) for axis, a in zip("xy", g, strict=True)
    }
    columns = {"alpha_deg": np.full(len(beta), 90.0), "beta_deg": beta, **volts}
    return Table.from_columns("poses", columns, {}, "circle")


def test_a_change_is_relative_to_the_model_before() -> None:
    table = on_one_circle()
    before, after = (fit(model, table).model for model in (LINEAR, TURNED))
    rows = {(row.effect, row.name, row.axis): row for row in parameter_rows(after, before)}
    assert rows["axis-misalignment", "z", ""].change == "new"
    assert rows["bias", "bias", "x"].change
    assert {row.change for row in parameter_rows(after)} == {""}
    assert {row.change for row in parameter_rows(after, after)} == {"unchanged"}


def test_a_parameter_that_the_data_do_not_tell_has_its_reason() -> None:
    rows = parameter_rows(fit(TURNED, on_one_circle()).model)
    reasons = [row.why for row in rows if row.why]
    assert reasons
    assert all(f"not identified: {why}" in tab_separated(rows) for why in reasons)


def test_correlations_are_sorted_and_of_identified_parameters() -> None:
    table = on_one_circle().rows(np.arange(12) < 5)  # of an arc, bias and scale factor cannot be told apart well
    found = correlations(fit(LINEAR, table))
    sizes = [abs(pair.coefficient) for pair in found]
    assert sizes == sorted(sizes, reverse=True)
    assert sizes[0] == pytest.approx(0.6, abs=0.35)
    assert {found[0].first.split()[0], found[0].second.split()[0]} == {"bias", "scale-factor"}
