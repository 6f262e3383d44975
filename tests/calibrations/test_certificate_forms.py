"""The certificate as HTML, PDF and XML: read back by others' programs, with the figures that were written."""

from __future__ import annotations

import base64
import importlib
import io
import json
import re
import sys
import types
import warnings
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pypdf
import pytest
import xmlschema

from calibrations.presentation.certificate.content import document
from calibrations.presentation.certificate.dcc import dcc
from calibrations.presentation.certificate.pages import html, pdf
from calibrations.presentation.certificate.sections import sections, verdict
from tests.calibrations.certified import certificate

SCHEMAS = Path(__file__).parents[1] / "data" / "dcc"
PLACES = {
    "https://ptb.de/si/v2.1.0/SI_Format.xsd": "SI_Format.xsd",
    "https://www.w3.org/TR/xmldsig-core/xmldsig-core-schema.xsd": "xmldsig-core-schema.xsd",
}


@pytest.fixture
def pydcc(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The package's reader, which here neither fetches schemas from the network nor checks signatures.

    For signatures alone it wants a library that cannot tell the version of OpenSSL from 3.0.10 on.
    """
    stub = types.ModuleType("certvalidator")
    for name in ("CertificateValidator", "ValidationContext", "errors"):
        setattr(stub, name, None)
    monkeypatch.setitem(sys.modules, "certvalidator", stub)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        module = importlib.import_module("dcc.dcc")
    monkeypatch.setattr(module, "DCCXMLValidator", lambda: None)
    return module.DCC


def test_pydcc_reads_back_what_was_written(pydcc: Any, tmp_path: Path) -> None:
    c = certificate()
    (tmp_path / "c.xml").write_text(dcc(c), encoding="utf-8")
    read = pydcc(xml_file_name=str(tmp_path / "c.xml"))
    assert (read.uid(), read.version(), read.mandatory_language()) == ("C-2026-17", "3.2.0", "en")
    assert read.calibration_laboratory_name() == "Lab <&> Co"
    assert f"{read.calibration_date():%Y-%m-%d}" == "2026-11-20"
    assert read.item_id()["identifications"]["identification"]["value"] == "17"
    results = {
        words.split()[-1]: found["real"] for words, found in read.get_calibration_results("name") if "left" in words
    }
    for o in c.figures.outcomes:
        factor = 1 / 9.81 if o.unit == "V/g" else 1.0
        assert float(results[o.name]["value"]) == pytest.approx(factor * o.value)
        unc = results[o.name]["expandedUnc"]
        assert float(unc["uncertainty"]) == pytest.approx(factor * o.expanded)
        assert (float(unc["coverageFactor"]), unc["coverageProbability"]) == (
            pytest.approx(o.coverage, abs=1e-4),
            "0.95",
        )


def test_correlations_are_in_every_form(pydcc: Any, tmp_path: Path) -> None:
    c = certificate()
    (tmp_path / "c.xml").write_text(dcc(c), encoding="utf-8")
    read = pydcc(xml_file_name=str(tmp_path / "c.xml")).get_calibration_results("name")
    rows = [found["realListXMLList"] for words, found in read if "Correlation" in words]
    assert rows[0]["labelXMLList"].split() == ["bias-x", "bias-y", "scale-factor-x", "scale-factor-y"]
    assert [[float(r) for r in row["valueXMLList"].split()] for row in rows] == [
        pytest.approx(row, abs=1e-6) for row in c.figures.correlations
    ]
    page = html(c)
    assert "Correlation coefficients" in page
    assert f">{c.figures.correlations[1][0]:.2f}</td>" in page
    assert document(c)["correlations"] == [list(row) for row in c.figures.correlations]


def test_the_covariance_matrix_is_where_the_standard_has_it() -> None:
    """Its diagonal has the squares of u, which are U / k, in the units of the results squared."""
    c = certificate()
    root = ET.fromstring(dcc(c))  # noqa: S314 we wrote it
    space = {"si": "https://ptb.de/si"}
    (values,) = root.iterfind(".//si:realList", space)
    assert [e.text for e in values.iterfind("si:real/si:label", space)] == [o.name for o in c.figures.outcomes]
    columns = list(values.iterfind(".//si:column", space))
    matrix = np.array([[float(e.text or "") for e in column.iterfind(".//si:value", space)] for column in columns])
    std = np.array([o.std / (9.81 if o.unit == "V/g" else 1.0) for o in c.figures.outcomes])
    assert matrix == pytest.approx(np.array(c.figures.correlations) * np.outer(std, std))
    units = [e.text for e in columns[0].iterfind(".//si:unit", space)]
    assert units[0] == r"\volt\tothe{2}"
    assert units[2] == r"\volt\tothe{2}\metre\tothe{-1}\second\tothe{2}"
    assert values.findtext(".//si:coverageFactor", "", space) == "3.0802"  # of four results: the root of 9.488


def test_it_is_valid_by_the_schema_of_ptb() -> None:
    places = {address: (SCHEMAS / name).as_uri() for address, name in PLACES.items()}
    schema = xmlschema.XMLSchema(str(SCHEMAS / "dcc.xsd"), uri_mapper=places, allow="local")
    assert [f"{e.path}: {e.reason}" for e in schema.iter_errors(dcc(certificate()))] == []
    assert not schema.is_valid(dcc(certificate()).replace("dcc:uniqueIdentifier>", "dcc:number>"))


def test_the_xml_holds_budget_conformity_and_every_row() -> None:
    root = ET.fromstring(dcc(certificate()))  # noqa: S314 we wrote it
    space = {"d": "https://ptb.de/dcc"}
    stated = [e.text for e in root.iterfind(".//d:conformity", space)]
    assert stated == ["pass", "pass", "fail"]
    said = " ".join(e.text or "" for e in root.iterfind(".//d:metaData/d:declaration/d:content", space))
    assert "gain of the converter: type B" in said
    assert "effective degrees of freedom" in said
    valid = [e.text for e in root.iterfind(".//d:measuringEquipment/d:certificate/d:inValidityRange", space)]
    assert valid == ["true", "false"]
    declared = [e.text for e in root.iterfind(".//d:statement/d:declaration/d:content", space)]
    assert declared[-1] == "The level's certificate expired."
    whole = json.loads(base64.b64decode(root.findtext("d:document/d:dataBase64", "", space)))
    assert whole["schema"] == "rig.certificate/1"
    assert whole["samples"][5]["sha256"] == f"{5:064x}"
    assert sum(whole["outcomes"][0]["weights"].values()) == pytest.approx(1.0)


def test_html_says_everything_and_takes_nothing_literally() -> None:
    page = html(certificate())
    for text in (
        "C-2026-17",
        "Lab &lt;&amp;&gt; Co",
        "470",
        "CAL-8",
        "2020-01-01, expired",
        "Decision rule",
        "as found",
    ):
        assert text in page
    assert "Lab <&>" not in page
    assert not re.search(r'(src|href)="http', page)
    assert verdict(certificate()) == "fail"
    assert page == html(certificate())
    assert "<h1>Simulated calibration, no certificate: ADXL203, 17</h1>" in html(replace(certificate(), simulated=True))


def test_the_pdf_holds_the_same_text() -> None:
    made = pdf(certificate())
    assert made == pdf(certificate())
    read = pypdf.PdfReader(io.BytesIO(made))
    assert read.metadata is not None
    assert read.metadata.title == "Calibration certificate: ADXL203, 17, No. C-2026-17"
    text = " ".join(" ".join(page.extract_text() for page in read.pages).split())
    for section in sections(certificate()):
        assert section.title in text
        for table in section.tables:
            assert table.title in text
    for expected in ("Lab <&> Co", "2020-01-01, expired", f"page 1 of {len(read.pages)}", "K1 (sensitivity), y"):
        assert expected in text


def test_sections_are_those_of_a_certificate() -> None:
    assert [s.title for s in sections(certificate())] == [
        "Identification", "Procedure", "Environment", "Results", "As found and as left", "Uncertainty", "Traceability",
    ]  # fmt: skip
    (results,) = next(s for s in sections(certificate()) if s.title == "Results").tables
    assert str(results.rows[0][1]).startswith("2.50")
    check = next(s for s in sections(certificate()) if s.title == "Uncertainty").tables[0]
    assert check.rows[0][-1] in ("confirmed", "conservative", "widened to the simulation")


def test_a_widened_factor_and_a_conservative_budget_are_told_where_they_stand() -> None:
    c = certificate()
    (first, second, *others) = c.figures.outcomes
    widened = replace(first, coverage=2.34, freedom=62.7, simulated=replace(first.simulated, verdict="widened"))
    wary = replace(second, simulated=replace(second.simulated, verdict="conservative", why="few degrees of freedom"))
    made = replace(c, figures=replace(c.figures, outcomes=(widened, wary, *others)))
    tables = {table.title: table for section in sections(made) for table in section.tables}
    assert tables["Results, as left"].rows[0][3:5] == ("widened, 2.34", "62")  # the factor is that of 62, not of 63
    assert [row[-1] for row in tables["Check by simulation"].rows[:2]] == [
        "widened to the simulation",
        "conservative: few degrees of freedom",
    ]


def test_figures_in_the_pdf_do_not_run_into_the_next_column() -> None:
    """The heading `highest`, to the right of its column, ends before `unit` begins: there is room between them."""
    found: dict[str, float] = {}

    def seen(text: str, _cm: object, tm: list[float], _font: object, size: float) -> None:
        if text.strip() in ("highest", "unit"):
            found.setdefault(text.strip(), tm[4])

    page = pypdf.PdfReader(io.BytesIO(pdf(certificate()))).pages[0]
    page.extract_text(visitor_text=seen)
    assert found["unit"] - found["highest"] > 34  # points: the word itself is 27 wide
