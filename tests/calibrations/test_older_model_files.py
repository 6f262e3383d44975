"""Model files of older programs are read, and mean what they meant.

`tests/data/models` has, of each program that wrote other keys, a model file and a table whose outputs are that
program's answers of the model. Keys that came later are optional. Since then, z-axis-scale and cross-axis-scale also
multiply the nonlinear part of the response. This changes the answers of the model `first` by 4 uV. A hysteresis follows
the force that a sensor at an angle senses on its way; the sensor of `common-reach` is square, so that its answers stay.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from calibrations.errors import ModelError
from calibrations.fitting.fit import evaluate
from calibrations.importing.foreign import read_csv
from calibrations.model.file import dump_model, parse_model, read_model
from tests.docs.markdown import ROOT

SECOND_ORDER_V = {"first": 5e-6}
FILES = sorted((ROOT / "tests" / "data" / "models").glob("*.yaml"))


def test_there_is_a_file_of_each_format() -> None:
    assert [file.stem for file in FILES] == ["common-reach", "common-steps", "covered", "expressions", "first"]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_an_older_model_answers_as_before(file: Path) -> None:
    model = read_model(file)
    assert parse_model(dump_model(model), "again") == model
    evaluated = evaluate(model, read_csv(file.with_suffix(".csv")))
    assert evaluated is not None
    assert np.max(np.abs(evaluated.residual)) < SECOND_ORDER_V.get(file.stem, 1e-12)


def test_constants_that_came_later_have_the_values_that_were_assumed() -> None:
    text = (
        "schema: rig.model/1\nname: alone\neffects:\n- effect: temperature-bias\n  constants: {lead_s: 40.0}\n"
        "  parameters:\n  - {name: slope, axis: x, value: 0.001}\n"
    )
    (temperature,) = parse_model(text, "alone.yaml").terms
    assert temperature.known_constants == {"lead_s": 40.0, "level": 0.0}
    (for_table,) = parse_model(text, "alone.yaml").for_table(read_csv(ROOT / "tests/golden/files/thermal.csv")).terms
    assert for_table.constants["level"] == 0.0


def test_a_value_of_all_axes_becomes_that_of_each_axis() -> None:
    model = read_model(ROOT / "tests" / "data" / "models" / "common-reach.yaml")
    assert [model[f"hysteresis.reach.{axis}"].value for axis in "xy"] == [0.15, 0.15]
    assert model.correlations is not None
    keys = ["hysteresis.reach.x", "hysteresis.reach.y", "hysteresis.height.x"]
    assert model.correlations.submatrix(keys).tolist() == [[1, 1, 0.5], [1, 1, 0.5], [0.5, 0.5, 1]]


def test_values_of_all_axes_alone_tie_the_effect() -> None:
    model = read_model(ROOT / "tests" / "data" / "models" / "common-steps.yaml")
    assert model["quantisation.step"].value == 0.004
    assert [term.name for term in model.terms if term.tied] == ["quantisation"]


def test_a_value_of_all_axes_needs_the_axes_of_another_parameter(golden) -> None:
    text = (
        "schema: rig.model/1\nname: alone\neffects:\n- effect: hysteresis\n  parameters:\n"
        "  - {name: reach, value: 0.15}\n"
    )
    with golden.refused(ModelError):
        parse_model(text, "alone.yaml")
