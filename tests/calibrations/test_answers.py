"""Results of the loop as text, documents, rows, pictures and in a notebook, for rows and for still records."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import calibrations as cal
from calibrations.errors import DataError
from calibrations.loop import compare, diagnose, discover
from calibrations.model.file import read_model
from calibrations.noise.record import Samples, reduce_record
from calibrations.result import Result
from tests.calibrations import synthetic

SCHEMAS = {"compare": "rig.comparison/1", "diagnose": "rig.diagnosis/1", "discover": "rig.discovery/1"}
LOOP: dict[str, Any] = {"compare": compare, "diagnose": diagnose, "discover": discover}


def samples() -> np.ndarray[Any, Any]:
    return np.random.default_rng(1).standard_normal(20_000) * 1e-3 + 2.5


@cache
def result(question: str, kind: str) -> Result:
    if kind == "still":
        still = reduce_record([Samples("x", [samples()], 100.0, "V")], "made")
        return LOOP[question](still, read_model("still"))
    columns = synthetic.turns(step_deg=20)
    x, y, _ = synthetic.components(columns)
    return LOOP[question](synthetic.poses(columns, 2.5 + x + 0.01 * x**2, 2.5 + y), read_model("linear"))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["poses", "still"])
@pytest.mark.parametrize("question", LOOP)
def test_every_answer_has_the_face_of_a_result(question: str, kind: str) -> None:
    answer = result(question, kind)
    assert repr(answer) == answer.report()
    assert answer._repr_html_().startswith("<pre ")
    assert answer.to_dict()["schema"] == SCHEMAS[question]
    assert all(isinstance(row, dict) for row in answer.records())
    assert answer.plot().axes


def test_a_discovery_of_a_square_reports_the_effect_and_the_model() -> None:
    found = result("discover", "poses")
    assert "quadratic-nonlinearity" in found.report()
    assert found.model["quadratic-nonlinearity.x"].value == pytest.approx(0.01, rel=0.1)  # type: ignore[attr-defined]


def test_the_noise_of_an_array_and_of_a_table_are_one() -> None:
    of_array = cal.noise(samples(), rate_hz=100.0)
    table = cal.table({"t_s": np.arange(20_000) / 100.0, "vx_v": samples()}, "still")
    of_table = cal.noise(table)
    values = [each.channels["x"].coefficients["white-noise"].value for each in (of_array, of_table)]
    assert values == pytest.approx([1e-4] * 2, rel=0.05)
    assert repr(of_table) == of_table.report()
    assert of_table.to_dict()["schema"] == "rig.noise/1"
    assert {row["process"] for row in of_table.records()} >= {"white-noise", "flicker-noise"}
    assert of_table.plot().axes


def test_noise_refuses_samples_without_a_rate_and_uneven_times() -> None:
    with pytest.raises(DataError, match="rate_hz=100"):
        cal.noise(samples())
    t_s = np.arange(20_000) / 100.0
    t_s[500:] += 3.0
    with pytest.raises(DataError, match="uneven"):
        cal.noise(cal.table({"t_s": t_s, "vx_v": samples()}, "still"))
