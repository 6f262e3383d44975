"""Sensors of a simulator whose forms nobody here fitted anything to: names and errors in the end."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import calibrations as cal
from tests.benchmark.foreign.__main__ import STRENGTHS
from tests.benchmark.foreign.causes import CATALOGUE, UNKNOWN, Cause
from tests.benchmark.foreign.sensor import WHITE_V, table
from tests.benchmark.hidden import Score, score, shipped
from tests.slow import before_release, slow

SEED = 2028


def searched(folder: Path, number: int, causes: list[Cause], floors: float) -> Score:
    random = np.random.default_rng([SEED, number])
    path = folder / f"{number}.csv"
    path.write_text(table(random, causes, [floors] * len(causes), slow=0.3))
    return score(path.stem, [c.name for c in causes], shipped(path), 0.0)


@pytest.mark.parametrize("step", [*slow([3]), *before_release([1])])
def test_one_cause_of_each_form_is_named_and_removed(tmp_path: Path, step: int) -> None:
    """Every third form, or all."""
    found = [searched(tmp_path, number, [CATALOGUE[number]], 10.0) for number in range(0, len(CATALOGUE), step)]
    errors = [s.answer.held_out or np.inf for s in found]
    assert np.mean([s.exact for s in found]) >= 0.85, [(s.truth, s.answer) for s in found if not s.exact]
    assert np.mean(np.array(errors) <= 1.25) >= 0.9, [(s.truth, s.answer) for s in found if s.answer.held_out > 1.25]


@pytest.mark.release
def test_a_sensor_without_a_cause_gets_no_name(tmp_path: Path) -> None:
    found = [searched(tmp_path, 100 + number, [], 0.0) for number in range(12)]
    assert not any(s.answer.causes for s in found)


@pytest.mark.release
def test_what_no_catalogue_holds_gets_no_name(tmp_path: Path) -> None:
    found = [searched(tmp_path, 200 + number, [cause], 10.0) for number, cause in enumerate(UNKNOWN)]
    assert sum(bool(s.answer.causes) for s in found) <= 1, [s.answer for s in found]


@pytest.mark.slow
def test_a_cause_in_another_form_is_not_told_apart_from_what_has_nearly_its_form(tmp_path: Path) -> None:
    converter, eccentricity = CATALOGUE[41], CATALOGUE[37]
    found = searched(tmp_path, 303, [converter, eccentricity], 20.0)
    assert found.answer.alternatives == {"quadratic-nonlinearity": ("adc-nonlinearity",)}
    assert found.exact


@pytest.mark.release
def test_where_all_effects_at_once_lead_the_fit_astray_they_are_added_one_by_one(tmp_path: Path) -> None:
    causes, floors = [CATALOGUE[k] for k in [11, 13, 23, 31, 17]], [3.3, 54.6, 53.0, 211.6, 4.7]
    random = np.random.default_rng([23, 200])
    path = tmp_path / "astray.csv"
    path.write_text(table(random, causes, floors, slow=float(random.uniform(0.0, 0.6))))
    answer = shipped(path)
    assert answer.held_out is not None
    assert answer.held_out < 10
    assert {"supply-sensitivity", "saturation", "scale-factor-asymmetry"} <= set(answer.causes)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "reason"),
    [
        (9, "a converter and an own response that can take up each other"),
        (63, "hysteresis of relays, whose loops differ from place to place"),
        (110, "a noisy thermometer that lags by two minutes"),
        (111, "the same of the scale factor, beside a curve over time"),
        (112, "errors of the thermometer that resemble a random walk"),
        (122, "errors of the estimate of vibration that resemble a random walk"),
    ],
)
def test_what_the_readings_or_the_form_leave_gets_no_second_name(tmp_path: Path, number: int, reason: str) -> None:
    floors, cause = STRENGTHS[number // len(CATALOGUE)], CATALOGUE[number % len(CATALOGUE)]
    random = np.random.default_rng([77, number])
    path = tmp_path / f"{number}.csv"
    slow = float(random.uniform(0.0, 0.6))
    path.write_text(table(random, [cause], [floors], slow))
    found = score(path.stem, [cause.name], shipped(path), 0.0)
    assert found.exact, (reason, found.answer)


@pytest.mark.slow
def test_vibration_in_the_standard_deviations_does_not_hide_slow_effects(tmp_path: Path) -> None:
    """With the stated noise, twice the true one and more, one effect leaves noise; two slow ones are in it."""
    causes = [CATALOGUE[k] for k in (24, 29, 22)]
    random = np.random.default_rng([311, 205])
    path = tmp_path / "vibrating.csv"
    path.write_text(table(random, causes, [10.0] * 3, slow=float(random.uniform(0.0, 0.6))))
    end = cal.discover(cal.read(path), "linear").findings.end
    assert np.all(end.noise.floor < 1.5 * WHITE_V)
    assert end.held_out_excess < 1.15


@pytest.mark.slow
def test_a_second_search_beside_the_fitted_cause_reaches_the_floor(tmp_path: Path) -> None:
    random = np.random.default_rng([777, 93])
    path = tmp_path / "exponential.csv"
    path.write_text(table(random, [CATALOGUE[5]], [30.0], slow=float(random.uniform(0.0, 0.6))))
    answer = shipped(path)
    assert answer.causes == ("z-axis-scale",)
    assert answer.held_out is not None
    assert answer.held_out < 1.15  # 1.28 where the forms of the first search stay
