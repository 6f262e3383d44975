"""Charts of the places of the signal chain."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.discovery.findings import Step
from calibrations.fitting.fit import Fit, fit
from calibrations.model.file import read_model
from calibrations.presentation.chart import Band, Bars, Line
from calibrations.presentation.charts.places import (
    LINEAR,
    UNEXPLAINED,
    curve_chart,
    forms_through,
    model_curves,
    place_pictures,
    shares_by_place,
    shares_chart,
)
from calibrations.presentation.interactive import figure
from tests.calibrations.test_free_forms import forces_of_sweep, poses, with_curve


class Found:
    """A model, and the same with a free form of the own response."""

    def __init__(self) -> None:
        table = poses(3e-3 * forces_of_sweep()[:, :2] ** 3)
        self.start = fit(read_model("linear"), table)
        self.steps: tuple[Step[Fit], ...] = (Step("free:own-response", self.start, with_curve(1e-3, table)),)


@pytest.fixture(scope="module")
def found() -> Found:
    return Found()


def test_shares_of_a_model_are_those_of_its_places_and_of_what_is_not_explained(found: Found) -> None:
    names, shares = shares_by_place(found)
    assert names == ["own-response", UNEXPLAINED]
    assert shares.sum(axis=1)[0] == pytest.approx(1.0)
    assert shares[1, 0] == 0.0
    assert shares[1, 1] == shares[0, 1] < 0.05
    (panel,) = shares_chart(found).panels[0]
    lengths = [series.ends[0] for series in panel.series if isinstance(series, Bars)]
    assert lengths == sorted(lengths, reverse=True)


def test_parts_of_the_base_have_no_place_of_their_own(found: Found) -> None:
    renamed = Found.__new__(Found)
    renamed.start, renamed.steps = found.start, (Step("scale-factor", found.start, found.steps[0].after),)
    assert shares_by_place(renamed)[0] == [LINEAR, UNEXPLAINED]


def test_forms_of_the_catalogue_are_drawn_through_a_curve(found: Found) -> None:
    end = found.steps[-1].after
    (curve,) = model_curves(end)
    forms = forms_through(end, curve)
    assert forms[0].name == "cubic-nonlinearity"
    assert forms[0].share > 0.95
    panels = curve_chart(curve, forms).panels[0]
    assert [panel.title for panel in panels] == ["x", "y"]
    (band,) = [series for series in panels[0].series if isinstance(series, Band)]
    lines = [series for series in panels[0].series if isinstance(series, Line)]
    assert np.all(band.low < lines[0].y)
    assert np.all(lines[0].y < band.high)
    assert len(lines) == 1 + len(forms)


def test_pictures_of_places_are_drawn_by_both_renderers(found: Found) -> None:
    pictures = place_pictures(found)
    assert [picture.name for picture in pictures] == ["shares", "place-own-response"]
    assert all(figure(picture.chart, picture.name)["data"] for picture in pictures)
    assert forms_through(found.start, model_curves(found.steps[-1].after)[0]) == []
