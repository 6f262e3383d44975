"""What hysteresis and its free form know of the time before the first pose."""

from collections.abc import Mapping

import numpy as np
import pytest

from calibrations.compensation.forward import steps_of
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import evaluate, fit
from calibrations.free_forms.bases import Play
from calibrations.free_forms.form import Form
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.geometry.stage_path import STATED_APPROACH
from calibrations.model import Model
from calibrations.model.chain import respond
from calibrations.model.file import dump_model, parse_model, read_model
from calibrations.table import Table
from tests.calibrations import synthetic
from tests.calibrations.fitted import LINEAR, Numbers, model

HELD: Mapping[str, Numbers] = {
    "height": (0.006, 0.004),
    "reach": (0.15, 0.2),
    "spread": 0.5,
    "pressing": 0.1,
    "pressing_square": 0.2,
    "begin": (0.0, 0.8),
}


def with_hysteresis(held: Mapping[str, Numbers]) -> Model:
    return model({**LINEAR, "hysteresis": held}, constants={"approach_deg": STATED_APPROACH})


def swept(held: Mapping[str, Numbers]) -> Table:
    """A sweep with this hysteresis. The first pose has x at 1 g, and y where it was at home."""
    columns = synthetic.turns((90, 30, 150, 60), step_deg=10)
    nothing = np.zeros(len(columns["beta_deg"]))
    table = synthetic.poses(columns, nothing, nothing)
    v = respond(specific_force(nominal_pose(table)), table, steps_of(with_hysteresis(held)))
    return synthetic.poses(columns, v[:, 0], v[:, 1], seed=1)


def test_a_fit_finds_the_state_before_the_first_pose() -> None:
    found = fit(read_model("linear").with_effect(catalogue()["hysteresis"]), swept(HELD))
    assert found.pooled_excess < 1.1
    begin = found.params["hysteresis.begin.y"]
    assert begin.std is not None
    assert begin.std < 0.1
    assert abs(begin.value - 0.8) < 4 * begin.std
    assert not found.params["hysteresis.begin.x"].identified  # all its elements slip on the way to the first pose


def test_a_model_file_without_the_state_has_begun_at_rest() -> None:
    older = with_hysteresis({name: value for name, value in HELD.items() if name != "begin"})
    at_rest = swept({**HELD, "begin": (0.0, 0.0)})
    read = evaluate(parse_model(dump_model(older), "older.yaml", catalogue()), at_rest)
    assert read is not None
    assert read.pooled_excess < 1.1


def test_the_first_state_of_a_free_form_is_whole_at_first_and_gone_after_a_turn() -> None:
    table = swept(HELD)
    form = Form("history", "slip", "way", (Play((0.05, 0.4), memory=True),), approach_deg=5.0)
    force = specific_force(nominal_pose(table))
    x, y = (form.columns(table, force, force[:, k], k) for k in range(2))
    assert x.shape == y.shape == (table.n, 4)
    x, y = x[:, 2:], y[:, 2:]
    assert 0.1 < y[0, 0] < 0.5  # the narrow element has slipped on the approach
    assert y[0, 1] == pytest.approx(1.0)
    assert np.all(np.diff(y[:7, 1]) <= 1e-12)
    assert np.abs(y[7:]).max() < 1e-12
    assert np.abs(x).max() < 1e-12
