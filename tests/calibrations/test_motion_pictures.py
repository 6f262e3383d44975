"""Pictures of a motion in the loop: every panel has a unit, and dots are what was measured."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from calibrations.discovery.results import Discovery
from calibrations.loop import compare, discover
from calibrations.model.file import read_model
from calibrations.motion.stretches import make_stretches
from calibrations.presentation.chart import Line, Points
from calibrations.presentation.charts.discovery import album
from calibrations.presentation.charts.fit import MOST_ROWS, failure_chart, measurement_chart, residual_chart
from calibrations.presentation.static import png
from tests.calibrations import shaken


@cache
def found() -> Discovery:
    return discover(shaken.record(shaken.TWO, 12.0, corner_hz=13.0), read_model("linear"))


@pytest.mark.slow
def test_the_album_of_a_motion_has_its_pictures() -> None:
    pictures = album(found(), compare(found().start.table, read_model("linear")))
    assert [p.name for p in pictures] == ["waterfall", "measurement", "residual", "failure", "effect-output-filter"]
    assert all(png(p.chart).startswith(b"\x89PNG") for p in pictures)
    assert "few periods" in pictures[1].caption


def test_measurement_over_time_is_the_samples() -> None:
    ((panel,), *_) = measurement_chart(found().start).panels
    dots = next(series for series in panel.series if isinstance(series, Points))
    samples = make_stretches(found().start.table).samples
    rows = np.searchsorted(samples.time_s - samples.time_s[0], dots.x)
    measured = 1e3 * samples.outputs[rows, 0]
    np.testing.assert_allclose(dots.y - dots.y.mean(), measured - measured.mean(), atol=1e-9)
    assert "(mV)" in panel.y.label


def test_residual_names_the_parts_with_the_largest_residual() -> None:
    labels = [panel.y.label for row in residual_chart(found().start).panels for panel in row]
    assert len(labels) == MOST_ROWS < len(found().start.channels)
    assert "residual of x\nin quadrature at 10 Hz (mV)" in labels


def test_failure_over_a_period_is_gone_with_the_effect() -> None:
    before, after = (failure_chart(fit).panels[0][0].series[-1] for fit in (found().start, found().end))
    assert isinstance(before, Line)
    assert isinstance(after, Line)
    assert np.std(after.y) < 0.4 * np.std(before.y)
