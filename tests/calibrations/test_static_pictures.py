"""Pictures by matplotlib: the same bytes, small, with the words of users, inside a page and in files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calibrations.discovery.results import Discovery
from calibrations.fitting.fit import fit
from calibrations.model import Model
from calibrations.presentation import static
from calibrations.presentation.chart import Chart, Panel, Points, single_chart
from calibrations.presentation.charts import fit as charts
from calibrations.presentation.charts.discovery import levels, waterfall
from calibrations.presentation.smaller_svg import compact
from calibrations.presentation.static import PictureError, inline, png, save, save_all, svg
from tests.calibrations.test_pictures import warm, warm_table


@pytest.mark.parametrize("make", [svg, png])
def test_the_same_chart_gives_the_same_bytes(make: object) -> None:
    first, second = (make(charts.residual_chart(warm().start)) for _ in range(2))
    assert first == second
    assert b"20" + b"2" not in first.split(b"<defs>")[0] if make is svg else True  # no date


def test_compact_cuts_digits_of_places_and_none_of_words() -> None:
    text = (
        '<g clip-path="url(#p)">\n  <use href="#m" x="1.23456" y="2.5" style="fill: red"/>\n'
        '  <use href="#m" x="3.99999" y="4" style="fill: red"/>\n</g><text x="0.123456">0.00025</text>'
    )
    small = compact(text)
    assert '<g clip-path="url(#p)" style="fill: red">' in small
    assert small.count("style=") == 1
    assert 'x="1.23"' in small
    assert ">0.00025</text>" in small


def test_markers_of_the_same_style_are_in_one_group() -> None:
    points = Points(np.arange(500.0), np.arange(500.0), colour="#102030")
    text = inline(single_chart(Panel((points,))), "cloud", "500 points")
    assert text.count("<use href=") >= 500
    assert len(text) < 500 * 60 + 10_000


def test_words_of_users_are_not_taken_for_formulas() -> None:
    model = Model("a$b$ & <c>", warm().start.model.terms)
    found = Discovery.of(replace(warm().findings, start=fit(model, warm_table())))
    assert b"a$b$ &amp; &lt;c&gt;" in svg(waterfall(levels(found)))


def test_an_inline_picture_of_the_same_content_is_drawn_once(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, draw = list[Chart](), static.svg
    monkeypatch.setattr(static, "svg", lambda chart: drawn.append(chart) or draw(chart))
    texts = [
        inline(single_chart(Panel((Points(np.array([1.0, 2.0]), np.array([0.5, at])),))), name, "two points")
        for at, name in ((7.25, "a"), (7.25, "a"), (7.25, "b"), (8.5, "a"))
    ]
    assert texts[0] == texts[1]
    assert len(set(texts)) == len(drawn) == 3


def test_an_inline_picture_reaches_nowhere_and_owns_its_names() -> None:
    text = inline(charts.failure_chart(warm().start), "map", 'where "it" fails')
    assert text.startswith('<svg role="img" aria-label="where &quot;it&quot; fails"')
    assert "http" not in text
    assert "<style" not in text
    names = {part.split('"')[0] for part in text.split('id="')[1:]}
    assert all(name.startswith("map-") for name in names)
    used = {part.split(")")[0] for part in text.split("url(#")[1:]}
    used |= {part.split('"')[0] for part in text.split('href="#')[1:]}
    assert used <= names


def test_pictures_are_saved_as_svg_and_png(tmp_path: Path) -> None:
    chart = waterfall(levels(warm()))
    save(chart, tmp_path / "a.svg")
    save(chart, tmp_path / "b.PNG")
    assert (tmp_path / "a.svg").read_bytes() == svg(chart)
    assert (tmp_path / "b.PNG").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_file()) == ["a.svg", "b.PNG"]


def test_a_picture_that_cannot_be_saved_gives_the_reason(golden, tmp_path: Path) -> None:
    chart = Chart(((Panel(()),),))
    with golden.refused(PictureError):
        save(chart, tmp_path / "a.pdf")
    with golden.refused(PictureError):
        save(chart, tmp_path / "no" / "a.svg")
    (tmp_path / "file").touch()
    with golden.refused(PictureError):
        save_all({"a": chart}, tmp_path / "file", "svg")
