"""Pictures of a motion in the loop: every panel has a unit, and dots are what was measured."""

from __future__ import annotations

from functools import cache

import numpy as np

from calibrations.compare import compare
from calibrations.discover import Discovery, discover
from calibrations.model_file import read_model
from calibrations.motion.stretches import stretches
from calibrations.pictures import measurement, residual
from calibrations.pictures.album import album
from calibrations.pictures.motion import failure
from calibrations.pictures.save import png
from tests.calibrations import shaken


@cache
def found() -> Discovery:
    return discover(shaken.record(shaken.TWO, 12.0, corner_hz=13.0), read_model("linear"))


def test_album_of_a_motion() -> None:
    pictures = album(found(), compare(found().start.table, read_model("linear")))
    assert [p.name for p in pictures] == ["waterfall", "measurement", "residual", "failure", "effect-output-filter"]
    assert all(png(p.figure).startswith(b"\x89PNG") for p in pictures)
    assert "few periods" in pictures[1].caption


def test_measurement_over_time_is_the_samples() -> None:
    ax = measurement.picture(found().start).axes[0]
    dots = next(line for line in ax.lines if line.get_marker() == "o")
    samples = stretches(found().start.table).samples
    rows = np.searchsorted(samples.time_s, dots.get_xdata())
    shown, measured = np.asarray(dots.get_ydata(), float), 1e3 * samples.outputs[rows, 0]
    np.testing.assert_allclose(shown - shown.mean(), measured - measured.mean(), atol=1e-9)
    assert "(mV)" in ax.get_ylabel()


def test_residual_names_each_part() -> None:
    labels = [ax.get_ylabel() for ax in residual.picture(found().start).axes if ax.get_ylabel()]
    assert "residual of x mean (mV)" in labels
    assert "residual of x\nin quadrature at 10 Hz (mV)" in labels


def test_failure_over_a_period_is_gone_with_the_effect() -> None:
    before, after = (failure(fit).axes[0].lines[-1].get_ydata() for fit in (found().start, found().end))
    assert np.std(after) < 0.4 * np.std(before)
