"""What a notebook shows of a table, of parameters and of results, and what it takes as a data frame."""

from __future__ import annotations

import re
from functools import cache
from xml.etree import ElementTree

import numpy as np
import pytest

import calibrations as cal
from calibrations.errors import UnknownName
from calibrations.fitting.fit import Fit
from calibrations.presentation.page import result_html
from calibrations.table import Table
from calibrations.text import rounded
from tests.calibrations import synthetic


@cache
def found() -> Fit:
    columns = synthetic.turns(step_deg=30)
    x, y, _ = synthetic.components(columns)
    return cal.fit(synthetic.poses(columns, 2.5 + x, 2.5 + 1.1 * y), "linear")


def test_a_table_shows_its_first_and_last_rows() -> None:
    data = found().table
    lines = repr(data).splitlines()
    assert lines[0].startswith(f"{data.n} rows of poses")
    assert lines[2].split() == list(data.columns)
    assert [line.split()[0] for line in lines[3:]] == ["0", "1", "2", "3", "4", "...", *map(str, data.order[-3:])]
    short = Table.from_columns("positions", {"ax": [1.0, 0.0], "ay": [0.0, 1.0], "az": [0.0, 0.0]}, source="<a&b>")
    assert repr(short).splitlines()[3:] == ["0  1   0   0", "1  0   1   0"]
    shown = ElementTree.fromstring(short._repr_html_())  # noqa: S314 made here
    (caption,) = shown.iter("caption")
    assert "".join(caption.itertext()) == "2 rows of positions, <a&b>"
    assert [cell.text for cell in shown.findall("tbody/tr[2]/td")] == ["1", "0", "1", "0"]


def test_parameters_are_a_table_of_value_uncertainty_and_unit() -> None:
    shown = ElementTree.fromstring(found().params._repr_html_())  # noqa: S314 made here
    assert [cell.text for cell in shown.iter("th")] == ["parameter", "value", "standard uncertainty", "unit"]
    rows = {row[0].text: [cell.text for cell in row[1:]] for row in shown.findall("tbody/tr")}
    assert list(rows) == list(found().params)
    value, std, unit = rows["scale-factor.y"]
    assert float(value) == pytest.approx(1.1, abs=1e-4)
    assert std == rounded(found().params["scale-factor.y"].std, 2)
    assert unit == "V/g"


def test_a_result_shows_its_report_and_the_pictures_of_the_report() -> None:
    shown = found()._repr_html_()
    assert found().report().splitlines()[0] in shown
    assert shown.count("<svg") == len(found().pictures()) == 3
    assert all(f"<b>{picture.title}.</b>" in shown for picture in found().pictures())
    known = set(re.findall(r'\bid="([^"]+)"', shown))
    assert set(re.findall(r"url\(#([^)]+)\)", shown)) <= known
    other = result_html("another result", found().pictures()[:1])
    assert known.isdisjoint(re.findall(r'\bid="([^"]+)"', other))  # a notebook is one page


def test_the_covariance_has_the_variances_of_the_parameters() -> None:
    std = np.array([e.std for e in found().params.values()])
    assert np.sqrt(np.diag(found().covariance)) == pytest.approx(std)
    assert found().correlation == pytest.approx(found().covariance / np.outer(std, std))
    assert np.diag(found().correlation) == pytest.approx(1.0)


def test_a_parameter_without_uncertainty_has_no_covariance() -> None:
    data = found().table
    still = data.rows(np.flatnonzero(data.column("beta_deg") == 0.0))  # y does not change: bias and scale are one
    fit = cal.fit(still, "linear")
    std = [e.std for e in fit.params.values()]
    assert None in std
    for k, value in enumerate(std):
        assert np.isnan(fit.covariance[k]).all() == (value is None)


def test_data_frames_of_a_fit_and_of_its_table_have_names() -> None:
    pytest.importorskip("pandas")
    frame = found().to_dataframe("correlation")
    assert list(frame.index) == list(frame.columns) == list(found().params)
    assert frame.loc["bias.x", "scale-factor.x"] == found().correlation[0, 2]
    assert list(found().params.to_dataframe()["parameter"]) == list(found().params)
    assert cal.table(found().table.to_dataframe(), "poses").digest == found().table.digest
    with pytest.raises(UnknownName, match='did you mean "covariance"'):
        found().to_dataframe("covarience")


def test_a_picture_is_shown_also_where_nothing_imported_pyplot() -> None:
    """A notebook draws a figure by `_repr_png_`, unless pyplot has told it another way."""
    head = found().plot()._repr_png_()[:24]  # type: ignore[attr-defined]
    assert head.startswith(b"\x89PNG")
    width, height = (int.from_bytes(head[at : at + 4], "big") for at in (16, 20))
    assert [width, height] == (found().plot().get_size_inches() * 100).astype(int).tolist()
