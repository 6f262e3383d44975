"""What an experiment is expected to tell is what it then tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.criteria import CERTAIN_PROBABILITY
from calibrations.design.expected import ExpectedResult, expected_gain, pairs_separated, predict_data, vary_one_way
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit, refit
from calibrations.joined import join_tables
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from drivers.world.world import World
from tests.hidden.rigs import IDEAL

UP = np.arange(0.0, 361.0, 45.0)
ALPHA, BETA = np.repeat([90.0, 30.0, 150.0], 18), np.tile(np.concatenate([UP, UP[::-1]]), 3)
DIRECTION = np.tile(np.repeat([1, -1], 9), 3)
CONSTANTS = {"sample_rate_hz": 1000.0, "filter_corner_hz": 15.07}


def model(effect: str) -> Model:
    return read_model("linear").with_effect(catalogue()[effect])


def measured(turn_z_deg: float, seed: int, faces: tuple[int, ...]) -> list[Table]:
    """A coarse sweep each with the sensor face up (0) or down (1), one after the other."""
    config = IDEAL.changed(
        {"sensor": {"package": {"turn_z_deg": turn_z_deg}}, "spread": {"imperfection_fraction": 0.0}}
    )
    world = World(config, seed)
    means = [world.dwell_mean(ALPHA, BETA, direction=DIRECTION, flip=flip) for flip in faces]
    return [Table.from_columns("poses", columns, CONSTANTS, "made") for columns in means]


def rivals(table: Table) -> tuple[Fit, Fit]:
    best = fit(model("stage-zero-offset"), table)
    return best, refit(best, model("axis-misalignment"))


def planned(best: Fit, flip: float | Array) -> Table:
    t = best.table.time_s.max() + 60 + 7 * np.arange(float(len(ALPHA)))
    columns = {"alpha_deg": ALPHA, "beta_deg": BETA, "direction": DIRECTION, "t_s": t, "flip": flip + np.zeros(len(t))}
    return predict_data(best, columns)


@pytest.mark.slow
def test_what_is_identical_stays_so_and_what_turns_with_the_sensor_does_not() -> None:
    best, rival = rivals(measured(0.05, 1, (0,))[0])
    up, down = (expected_gain(best, rival, planned(best, flip)) for flip in (0.0, 1.0))
    assert pairs_separated(up.together) < 0.1
    assert pairs_separated(down.together) > 0.999
    assert down.deviations == pytest.approx(np.sqrt(down.together))
    assert pairs_separated(down.alone) < 0.1, "face down alone it is as face up alone: only both faces tell"


def test_squares_of_three_axes_are_not_separated_wherever_the_search_for_the_distance_begins() -> None:
    """They add up to a constant. A search that ends early promises an experiment that separates nothing."""
    table = measured(0.05, 4, (0,))[0]
    best, rival = (
        fit(model("quadratic-nonlinearity").with_effect(catalogue()[name]), table)
        for name in ("z-axis-bias", "cross-axis-bias")
    )
    far = replace(rival, theta=rival.theta + 1e3 * rival.problem.layout.typical)
    assert pairs_separated(expected_gain(best, far, planned(best, 0.0)).together) < 0.1


def test_it_is_the_gain_in_likelihood_that_the_experiment_then_brings() -> None:
    ratios = []
    for seed in range(6):
        tables = measured(0.02, seed, (0, 1))
        best, rival = rivals(tables[0])
        foretold = expected_gain(best, rival, planned(best, 1.0)).together
        wrong, right = rivals(join_tables(tables))
        gain = np.sum((wrong.residual**2 - right.residual**2) / right.noise.white**2)
        ratios.append(gain / foretold)
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.15)


def test_a_longer_dwell_brings_more_in_proportion() -> None:
    """By its own data: four times the samples, four times lambda. What tells here is a sweep on both faces."""
    best, rival = rivals(measured(0.05, 2, (0,))[0])
    table = planned(best, np.repeat([0.0, 1.0], len(ALPHA) // 2))
    columns = {name: table.column(name) for name in ("alpha_deg", "beta_deg", "direction", "t_s", "flip")}
    longer = predict_data(best, {**columns, "n": 4 * table.column("n")})
    assert expected_gain(best, rival, longer).alone / expected_gain(best, rival, table).alone == pytest.approx(
        4.0, rel=0.05
    )


def test_the_probability_of_telling_apart() -> None:
    """Odds of 20 to 1 are six in twice the logarithm: at lambda = 6 they are reached half of the time."""
    assert pairs_separated(0.0) == 0.0
    assert pairs_separated(6.0) == pytest.approx(0.5)
    assert pairs_separated(21.2) == pytest.approx(CERTAIN_PROBABILITY, abs=0.001)
    draws = 30.0 + 2 * np.sqrt(30.0) * np.random.default_rng(1).standard_normal(20000)
    assert pairs_separated(30.0) == pytest.approx(np.mean(draws > 6), abs=0.005)


def test_what_does_not_show_by_itself_is_not_named_by_itself() -> None:
    clear = ExpectedResult(alone=100.0, together=100.0, visible=100.0)
    faint = ExpectedResult(alone=100.0, together=100.0, visible=15.0)
    assert clear.probability_alone == pytest.approx(1.0, abs=1e-3)
    assert faint.probability_alone < 0.5
    assert faint.probability == clear.probability
    best, _ = rivals(measured(0.05, 3, (0,))[0])
    nothing = refit(best, best.model.without("stage-zero-offset"))
    assert vary_one_way(best, nothing, planned(best, 0.0)).alone > 1000
