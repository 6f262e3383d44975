"""The budget in the report and in JSON: every number with its source, and what is not given said."""

from __future__ import annotations

import json

import pytest

from calibrations.fitting.fit import fit
from calibrations.loop import compare, discover
from calibrations.model.file import read_model
from calibrations.presentation.budget import budget_document, budget_section
from calibrations.presentation.report.report import report
from tests.calibrations.test_budget import given, measured
from tests.calibrations.test_report import blank


def test_the_report_shows_sources_and_what_is_not_given() -> None:
    table = given(measured(1), gain_std=2e-4, beta_std_deg=0.01)
    found = discover(table, read_model("linear"))
    page = report(found, compare(table, read_model("linear")), "2026-01-01", "program 1", blank())
    for text in ("Uncertainty budget", "gain of the converter", "white noise of the dwells", "coverage factor"):
        assert text in page
    assert "Not given and not included: gravity at the place" in page


def test_the_section_says_what_counts_most() -> None:
    table = given(measured(1), gain_std=0.2)
    section = budget_section(fit(read_model("linear"), table))
    assert section is not None
    parameters, *sources = section.tables
    assert {row[-1] for row in parameters.rows} == {"gain of the converter"}
    assert [of.title for of in sources] == ["Sources of bias", "Sources of scale-factor"]
    parameter_of_x = next(iter(sources[1].groups))
    contribution = {row[1]: row[5] for row, _ in parameter_of_x}
    assert contribution["gain of the converter"] == "0.20"
    assert contribution["scatter from row to row"] == "negligible"


def test_small_uncertainties_have_a_prefix() -> None:
    fitted = fit(read_model("linear"), given(measured(1), gain_std=2e-4))
    section, document = budget_section(fitted), budget_document(fitted)
    assert section is not None
    assert document is not None
    for row, found in zip(section.tables[0].rows, document["parameters"], strict=True):
        factor = {"µ": 1e6, "m": 1e3}[str(row[6])[0]]
        assert float(str(row[2])) == pytest.approx(factor * found["combined"], rel=0.05)
        assert float(str(row[5])) == pytest.approx(factor * found["expanded"], rel=0.05)


def test_the_document_is_json_and_adds_up() -> None:
    table = given(measured(1), gain_std=2e-4)
    found = budget_document(fit(read_model("linear"), table))
    assert found is not None
    told = json.loads(json.dumps(found, allow_nan=False))
    for row in told["parameters"]:
        assert abs(sum(u**2 for u in row["contributions"].values()) ** 0.5 - row["combined"]) < 1e-9
        assert row["expanded"] > row["combined"]
    assert "thermometer" in told["not_given"]
