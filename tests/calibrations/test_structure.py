"""The structure of a residual is named right, and its expression takes the error to the noise floor."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from calibrations.criteria import MOST_UNSEEN, MUCH_MORE_THAN_NOISE
from calibrations.discovery.fit_doubts import _misfit
from calibrations.discovery.patterns import Pattern
from calibrations.discovery.structure import poorly_predicted, structure_of
from calibrations.effects.expression_effect import effect_for
from calibrations.fitting.fit import Fit, fit
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.hidden import sampled

SWEEP = sampled.sweep()
BETA, TIME, WARM = np.radians(SWEEP.beta_deg), SWEEP.t_s, SWEEP.temperature_c
FLOOR_V = 60e-6  # of a mean of `sampled`


def changed(of: Array) -> Table:
    """A sweep with as many noise floors of `of` on x, and less on y."""
    return sampled.measured(3, lambda v, poses, random: v + FLOOR_V * of[:, None] * np.array([1.0, -0.7]))


def turned(wave_deg: Array) -> Table:
    """A sweep whose stage is off by so much."""
    turn = np.radians(wave_deg)[:, None]
    return sampled.measured(3, lambda v, poses, random: v + turn * poses.a[:, ::-1] * np.array([-1.0, 1.0]))


def found(table: Table) -> tuple[Fit, Pattern | None]:
    before = fit(read_model("linear"), table)
    return before, structure_of(before)


BUMP = np.maximum(0, 1 - np.abs(SWEEP.beta_deg - 200) / 25)
KINDS: dict[str, Callable[[], Table]] = {
    "5th harmonic of beta": lambda: changed(3 * np.sin(5 * BETA + 0.3)),
    "8th harmonic of the stage angle beta": lambda: turned(0.02 * np.sin(8 * BETA)),
    "step at t = 802 s": lambda: changed(6.0 * (TIME > 800)),
    "step at temperature = 24.5 C": lambda: changed(6.0 * (WARM > 24.5)),
    "ramp from t = 1": lambda: changed(9 * np.maximum(0, TIME - 1500) / 2100),
    "oscillation in time, period 51 s": lambda: changed(4 * np.sin(2 * np.pi * TIME / 51)),
    "sector of beta around 200 deg": lambda: changed(12 * BUMP),
    "inclination alpha = 60 deg": lambda: changed(6.0 * (SWEEP.alpha_deg == 60)),
    "follows direction of turning": lambda: changed(3 * SWEEP.direction),
    "6th harmonic of beta, turning clockwise only": lambda: changed(4 * np.sin(6 * BETA) * (SWEEP.direction > 0)),
}


@pytest.mark.parametrize("words", KINDS)
def test_each_kind_is_named_and_its_expression_explains_it(words: str) -> None:
    before, pattern = found(KINDS[words]())
    assert pattern is not None
    assert words in pattern.text
    after = fit(before.model.with_effect(effect_for(pattern.name, pattern.expression, before.table)), before.table)
    assert before.pooled_excess > 1.5
    assert after.pooled_excess < 1.15


def test_poses_that_stand_out_are_listed() -> None:
    off = np.zeros(len(BETA))
    off[[12, 140, 377]] = 60.0, -60.0, 60.0
    _, pattern = found(changed(off))
    assert pattern is not None
    assert (pattern.text, pattern.expression) == ("3 poses differ from the others: #12, #140, #377", "")


def test_poses_keep_their_numbers_when_others_are_left_out() -> None:
    off = np.zeros(len(BETA))
    off[[12, 140, 377]] = 60.0, -60.0, 60.0
    table = changed(off)
    _, pattern = found(table.rows(np.delete(np.arange(table.n), [3, 4, 200])))
    assert pattern is not None
    assert (pattern.text, pattern.poses) == ("3 poses differ from the others: #12, #140, #377", (12, 140, 377))


def test_poses_that_stand_out_are_listed_in_part() -> None:
    off = np.zeros(len(BETA))
    off[7] = 60.0
    assert found(changed(off))[1].text == "1 pose differs from the others: #7"  # type: ignore[union-attr]
    off[np.arange(20, 29) * 13 % 500] = 60.0
    assert found(changed(off))[1].text.endswith("and 4 more")  # type: ignore[union-attr]


@pytest.mark.parametrize("floors", [8, 20])
def test_a_walk_is_a_drift_and_no_step(floors: float) -> None:
    _, pattern = found(sampled.measured(3, sampled.kicks(floors * FLOOR_V)))
    assert pattern is not None
    assert pattern.text.startswith("slow drift without a pattern")


def test_noise_has_no_structure() -> None:
    assert found(changed(0 * TIME))[1] is None


@pytest.mark.parametrize(("moving", "factor", "doubtful"), [(True, 1.1, True), (True, 0.9, False), (False, 1.1, False)])
def test_only_a_motion_with_a_large_error_on_unseen_stretches_is_doubtful(
    moving: bool, factor: float, doubtful: bool
) -> None:
    table = SimpleNamespace(type=SimpleNamespace(moving=moving, stage_angles=not moving, same_pose=()))
    error = factor * MOST_UNSEEN
    fitted = SimpleNamespace(table=table, held_out_excess=error, cross_validated_excess=1.0, pooled_excess=0.98)
    assert (poorly_predicted(fitted) is not None) == doubtful


@pytest.mark.parametrize(
    ("seen", "cross_validated", "unseen", "doubtful"),
    [
        (0.7, 1.4, 27.0, True),  # half of the freedom of the rows is in the parameters
        (0.99, 1.01, 6.8, False),  # one pose alone reaches the limit of a saturation
        (1.4, 1.5, 1.9, False),  # slow noise, which every row has
    ],
)
def test_a_model_that_follows_the_poses_of_its_fit_alone_is_doubtful(
    seen: float, cross_validated: float, unseen: float, doubtful: bool
) -> None:
    table = SimpleNamespace(type=SimpleNamespace(moving=False, stage_angles=True, same_pose=()))
    fitted = SimpleNamespace(
        table=table, pooled_excess=seen, cross_validated_excess=cross_validated, held_out_excess=unseen
    )
    pattern = poorly_predicted(fitted)
    assert (pattern is not None) == doubtful
    assert pattern is None or pattern.text == "the error on unseen poses is 27 times the noise floor"


@pytest.mark.parametrize(("known", "factor", "doubted"), [(True, 1.1, True), (True, 0.9, False), (False, 1.1, False)])
def test_a_model_that_does_not_follow_a_motion_is_doubted(known: bool, factor: float, doubted: bool) -> None:
    table = SimpleNamespace(type=SimpleNamespace(moving=True))
    noise = SimpleNamespace(known=known)
    fitted = SimpleNamespace(table=table, noise=noise, pooled_excess=factor * MUCH_MORE_THAN_NOISE)
    assert bool(list(_misfit(fitted))) == doubted
