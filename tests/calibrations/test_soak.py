"""A soak's table: courses, gaps, what is left out; and the night's page on it."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
import pytest

from calibrations.analyses.soak import Soak, analyse_soak
from calibrations.errors import TooFewRows
from calibrations.presentation.charts.soak import soak_album
from calibrations.presentation.report.soak import soak_report
from calibrations.text import estimate_text
from tests.calibrations.soaks import BLOCK_S, soak_table

FACTS = {"sensor": "a <sensor>", "run": "a night"}


@cache
def night() -> Soak:
    return analyse_soak(soak_table())


def page(found: Any, results: Any = None) -> str:
    return re.sub(r"\s+", " ", soak_report(found, results or {}, FACTS))


def test_bias_and_scale_factor_come_to_rest() -> None:
    found = night()
    assert list(found.courses) == ["bias-x", "scale-x", "bias-y", "scale-y"]
    for course in found.courses.values():
        assert course.state is not None
        assert course.state.terms[0].tau_s[0] == pytest.approx(5400, abs=3 * course.state.terms[0].tau_s[1])
    time = found.time_s()
    assert time is not None
    assert time == max(found.time_s("x") or (0, 0), found.time_s("y") or (0, 0))
    assert found.temperature_wander_k == pytest.approx(0.0, abs=1e-4)
    assert found.gaps == ()


def test_a_negative_scale_factor_has_the_uncertainty_of_a_positive_one(undrawn: None) -> None:
    table = soak_table(10800.0)
    columns = {**table.columns, "vx_v": 5.0 - table.column("vx_v")}
    mirrored = analyse_soak(type(table).from_columns("poses", columns, table.constants, "", table.labels))
    course, positive = mirrored.courses["scale-x"], analyse_soak(table).courses["scale-x"]
    assert course.values == pytest.approx(-positive.values)
    assert course.stds == pytest.approx(positive.stds)


def test_times_count_from_power_on() -> None:
    table = soak_table()
    columns = {**table.columns, "t_s": table.time_s + 3600.0}
    late = analyse_soak(type(table).from_columns("poses", columns, table.constants, "", table.labels))
    early = analyse_soak(table)
    assert late.courses["bias-x"].t_s == pytest.approx(early.courses["bias-x"].t_s + 3600)
    times = late.time_s(), early.time_s()
    assert times[0] is not None
    assert times[1] is not None
    assert times[0][0] == pytest.approx(times[1][0] + 3600)


def test_a_gap_is_marked_and_the_fit_goes_by_real_time(undrawn: None) -> None:
    found = analyse_soak(soak_table(cut_s=5000.0))
    (gap,) = found.gaps
    assert (gap.path, gap.length_s) == ("hold 10", pytest.approx(5000.0))
    state = found.courses["bias-x"].state
    assert state is not None
    assert state.terms[0].tau_s[0] == pytest.approx(5400, abs=3 * state.terms[0].tau_s[1])
    text = page(found)
    assert "1.39 h at" in text
    assert "1.39 h are lost in 1 gap." in text


def test_a_reversal_that_was_interrupted_is_left_out() -> None:
    table = soak_table()
    rows = [k for k, path in enumerate(table.labels["path"]) if path == "reversal 10"]
    late = np.where(np.arange(table.n) > rows[3], 4000.0, 0.0)
    cut = type(table).from_columns(
        "poses", {**table.columns, "t_s": table.time_s + late}, table.constants, "", table.labels
    )
    found = analyse_soak(cut)
    assert [gap.path for gap in found.gaps] == ["reversal 10"]
    assert found.left_out == 1
    assert len(found.courses["bias-x"].t_s) == len(analyse_soak(table).courses["bias-x"].t_s) - 1


def test_a_reversal_that_is_not_complete_yet_is_left_out() -> None:
    table = soak_table()
    assert analyse_soak(table.rows(np.arange(table.n - 3))).left_out == 1


def test_in_an_oven_the_approach_begins_when_it_is_warm() -> None:
    whole, warm = night(), analyse_soak(soak_table(), oven_c=28.0)
    assert warm.left_out > whole.left_out == 0
    assert warm.courses["bias-x"].t_s[0] > 5400 * np.log(6)


def test_a_short_soak_has_courses_and_no_verdict_on_steady_state(undrawn: None) -> None:
    found = analyse_soak(soak_table(120.0))
    assert all(course.state is None for course in found.courses.values())
    assert found.time_s() is None
    assert found.temperature_wander_k is None
    assert "Too few reversals" in page(found)


def test_a_table_without_a_whole_reversal_is_refused(golden) -> None:
    table = soak_table()
    with golden.refused(TooFewRows):
        analyse_soak(table.rows(np.char.startswith(np.array(table.labels["path"]), "hold")))


def test_noise_of_hours_and_allan_deviation_are_those_of_the_still_record() -> None:
    found = night()
    hours_s, rms = found.noise_of_hours("x")
    assert hours_s[0] == 1800.0
    assert rms == pytest.approx(0.8e-3)
    times_s, deviations = found.allan("x")
    assert times_s.tolist() == [BLOCK_S, 2 * BLOCK_S, 4 * BLOCK_S]
    assert deviations[0] == pytest.approx(0.8e-3 * np.sqrt(20 / 60_000), rel=0.2)
    drift_v = 2e-3 * np.exp(-found.holds.time_s / 5400)
    straight = BLOCK_S * np.abs(np.gradient(drift_v, found.holds.time_s)).mean() / np.sqrt(2)
    assert deviations[2] < 0.8e-3 * np.sqrt(20 / 240_000) + 4 * straight


def test_a_still_record_in_pieces_has_the_deviation_of_each() -> None:
    """A straight drift within every hold: the deviation rises with time, and no piece is compared with the next."""
    table = soak_table(drift_v=0.0)
    paths = np.array(table.labels["path"])
    jumps = np.cumsum(np.append(False, paths[1:] != paths[:-1]))
    columns = {**table.columns, "vx_v": 1e-6 * table.time_s + 0.1 * jumps}
    times_s, deviations = analyse_soak(
        type(table).from_columns("poses", columns, table.constants, "", table.labels)
    ).allan("x")
    assert deviations == pytest.approx(1e-6 * times_s / np.sqrt(2))


def test_holds_of_one_block_have_no_deviation() -> None:
    times_s, deviations = analyse_soak(soak_table(60.0)).allan("x")
    assert len(times_s) == len(deviations) == 0


def test_the_page_shows_results_limits_and_facts_and_loads_nothing() -> None:
    found = night()
    rounded = {"value": 0.123456, "std": None, "unit": "K", "limit": 0.3, "verdict": "pass"}
    limited = {"value": 3.0, "std": 0.1, "unit": "h", "limit": [0, 7], "verdict": "pass"}
    results = {"steady-state-time": limited, "gap": {**limited, "limit": None}, "temperature-wander": rounded}
    text = page(found, results)
    time = found.time_s()
    assert time is not None
    assert f"Bias and scale factor are steady {estimate_text(time[0] / 3600, time[1] / 3600)} h after power-on" in text
    assert "every sample of 12.0 h at rest, and 53 reversals" in text
    assert "0 to 7" in text
    assert re.search("0.123 K<.*at most 0.3<", text)
    assert "None: the record holds every sample" in text
    assert "a &lt;sensor&gt;" in text
    assert not re.search(r'(src|href)="https?:', text)
    assert text == page(found, results)


def test_the_page_of_a_soak_says_that_the_steady_state_is_not_reached() -> None:
    found = analyse_soak(soak_table(7200.0, drift_v=0.02))
    assert found.time_s() is None
    assert "bias of x, scale factor of x, bias of y and scale factor of y may still drift" in page(found)
    assert "steady state not reached" in page(found)


def test_the_page_says_that_the_ambient_temperature_changed(undrawn: None) -> None:
    table = soak_table()
    wandering = table.column("temperature_c") + 2 * np.sin(table.time_s / 3000)
    warm = type(table).from_columns(
        "poses", {**table.columns, "temperature_c": wandering}, table.constants, "", table.labels
    )
    assert "ambient temperature was not constant" in page(analyse_soak(warm))


def test_pictures_are_named() -> None:
    assert [picture.name for picture in soak_album(night())] == ["drift", "night", "allan"]


@pytest.mark.parametrize(("poses", "pictures"), [(8, ["drift"]), (9, ["drift", "night"]), (10, ["drift", "night"])])
def test_the_page_of_a_soak_that_ended_early_has_the_pictures_that_there_are(poses: int, pictures: list[str]) -> None:
    found = analyse_soak(soak_table().rows(np.arange(poses)))  # a warning is an error here
    assert [picture.name for picture in soak_album(found)] == pictures
    text = page(found)
    assert "Too few reversals to decide" in text
    assert "1 reversal." in text
    assert ("The soak ended before the record at rest began." in text) == (poses == 8)
    assert ("The thin grey line is the record" in text) == (poses > 8)
    assert "exponential approach" not in text
