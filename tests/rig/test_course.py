"""A night over time in a bounded number of parts: nothing is lost of mean and extremes."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from calibrations.presentation.chart import Line
from procedures.session import Dwell, Pose
from rig.services.charts import MOST, Course, RunTime, course_chart, kind_label, kind_of


def dwell(number: int, path: str = "hold 1") -> Dwell:
    return Dwell(Pose(0, 0, 0, path), 10.0 * number, {"vx": float(number % 7)}, {"vx": 1e-3}, 5000, 20.0)


@pytest.mark.parametrize("n", [1, MOST, MOST + 1, 5000])
def test_many_dwells_are_shown_in_a_few_parts(n: int) -> None:
    course = Course()
    for number in range(n):
        course.add(dwell(number))
    t_s, mean, low, high = (np.array(values) for values in course.line("vx"))
    assert len(course.parts) <= MOST
    weights = np.array([part.n for part in course.parts])
    assert weights.sum() == n
    assert np.average(mean, weights=weights) == pytest.approx(np.mean([number % 7 for number in range(n)]))
    assert np.average(t_s, weights=weights) == pytest.approx(10.0 * (n - 1) / 2)
    assert (low.min(), high.max()) == (0, min(n - 1, 6))
    assert np.all(np.diff(t_s) > 0)


def test_the_measured_quantities_have_names() -> None:
    course = Course()
    assert course.names == []
    course.add(dwell(1))
    assert course.names == ["vx", "rms vx", "temperature"]


@pytest.mark.parametrize(("path", "kind"), [("hold 17", "hold"), ("A+ to B-", ""), ("", ""), ("17", "")])
def test_dwells_of_numbered_paths_belong_together(path: str, kind: str) -> None:
    assert kind_of(dwell(1, path)) == kind


@pytest.mark.parametrize(("kind", "label"), [("up 35 cycle", "up 35 °C"), ("hold", "hold"), ("", "poses")])
def test_a_kind_of_poses_has_a_label(kind: str, label: str) -> None:
    assert kind_label(kind) == label


def test_the_scatter_of_a_dwell_has_a_prefix_and_its_mean_has_none() -> None:
    course = Course()
    course.add(replace(dwell(1), means={"vx": 2e-5}, stds={"vx": 2.6e-5}))
    for name, label, value in (("rms vx", "rms vx (µV)", 26.0), ("vx", "vx (V)", 2e-5)):
        panel = course_chart(course, name).panels[0][0]
        (line,) = panel.series
        assert panel.y.label == label
        assert isinstance(line, Line)
        assert line.y == pytest.approx([value])


def test_times_are_those_since_the_start_with_the_time_of_day_under_the_pointer() -> None:
    course = Course()
    for number in range(3):
        course.add(dwell(number))
    time = RunTime(10.0, " since power-on", datetime(2026, 5, 1, 12, 0, 0, tzinfo=UTC))
    panel = course_chart(course, "vx", time).panels[0][0]
    (line,) = panel.series
    assert panel.x.label == "time since power-on (s)"
    assert isinstance(line, Line)
    assert line.x.tolist() == [-10.0, 0.0, 10.0]
    assert line.texts[1] == "2026-05-01 12:00:10 UTC"
