"""Fleets: effects that a batch shares, errors that a rig adds, and what poses are saved by siblings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calibrations.discovery.candidates import candidates
from calibrations.discovery.significance import Screen
from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.fleet.batch import find_batch_effects
from calibrations.fleet.look import Score, Screening, SharedDesigns, information, screen_sensor
from calibrations.fleet.rigs import Measured, RigError, correct_stage_errors, find_rig_errors, find_unconnected_rigs
from calibrations.fleet.siblings import pool_siblings
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations.fleets import Flaw, Rig, sensor

LINEAR = read_model("linear")
EFFECTS = {k: e for k, e in catalogue().items() if not {"t_s", "temperature_c"} & set(e.needs) and k != "quantisation"}
SHARED = SharedDesigns(EFFECTS)
STAGE = [name for name, effect in catalogue().items() if "pose" in effect.places]


def looks(tables: Iterable[Table]) -> list[Screening]:
    return [screen_sensor(table, LINEAR, SHARED) for table in tables]


def test_a_look_scores_as_the_search_for_one_sensor_does() -> None:
    """Columns are another sensor's, and scores come from one Gram matrix: the statistics are those of the search."""
    first, table = sensor(1, Flaw(bend=3e-4)), sensor(2, Flaw(bend=3e-4))
    found, fitted = looks([first, table])[1], fit(LINEAR, table)
    screen = Screen(fitted)
    own = {c.name: screen.statistic(c.basis) for c in candidates(fitted, EFFECTS)}
    statistics = {name: max(s.statistic for s in found.scores if s.effect == name) for name in own}
    assert statistics == pytest.approx(own, rel=0.03, abs=0.3)
    assert found.chance < 1e-6


def test_information_is_that_of_the_stated_uncertainties() -> None:
    found = fit(LINEAR, sensor(3))
    stated = [e.std for term in found.model.terms for e in term.estimates]
    assert np.sqrt(np.diag(np.linalg.inv(information(found)))) == pytest.approx(stated)


def test_a_batch_shows_an_effect_that_no_single_sensor_shows() -> None:
    found = looks(sensor(100 + k, Flaw(bend=30e-6)) for k in range(20))
    assert sum(each.chance < 0.003 for each in found) <= 1
    first = find_batch_effects(found, STAGE)[0]
    assert "quadratic-nonlinearity" in (first.effect, *first.rivals)
    assert first.common
    assert first.p_value < 1e-3


def test_an_effect_with_another_value_in_each_sensor_is_of_the_batch_and_not_of_the_stage() -> None:
    first = find_batch_effects(looks(sensor(200 + k, Flaw(askew=0.1)) for k in range(8)), STAGE)[0]
    assert (first.effect, first.common) == ("axis-misalignment", False)


def test_an_effect_may_have_more_parameters_in_one_sensor_than_in_another() -> None:
    found = looks(sensor(330 + k) for k in range(8))
    short = [
        replace(each, scores=tuple(_cut(s) if k == 0 else s for k, s in enumerate(each.scores))) for each in found[:4]
    ]
    assert not find_batch_effects([*short, *found[4:]], STAGE)


def _cut(score: Score) -> Score:
    return replace(score, score=score.score[:1], information=score.information[:1, :1], rank=1)


def scored(scores: Iterable[np.ndarray[Any, np.dtype[np.float64]]]) -> list[Screening]:
    """Looks of sensors with these scores of one effect, whose information is 1 for each parameter."""
    bare = looks([sensor(1)])[0]
    return [replace(bare, scores=(Score("bent", 0, s, np.eye(len(s)), float(s @ s), len(s), 1.0),)) for s in scores]


def test_one_sensor_far_off_does_not_hide_what_all_others_have() -> None:
    rng = np.random.default_rng(1)
    scores = [np.array([1.5, 1.5]) + rng.standard_normal(2) for _ in range(30)]
    assert find_batch_effects(scored([*scores, np.array([-300.0, -300.0])]))[0].common


def test_what_less_than_half_of_the_sensors_have_is_not_their_batchs() -> None:
    rng = np.random.default_rng(2)
    scores = [40.0 * (k < 18) * rng.choice([-1, 1], 3) + rng.standard_normal(3) for k in range(40)]
    assert not find_batch_effects(scored(scores))
    assert find_batch_effects(scored(scores[:30]))[0].common is False


def test_who_came_first_hardly_makes_a_difference() -> None:
    """Columns of another sensor are scaled to the outputs of this one."""
    table = sensor(2, Flaw(bend=3e-4))
    outputs = {"vx_v": 3 * table.column("vx_v"), "vy_v": 0.5 * table.column("vy_v")}
    other = replace(table, columns={**table.columns, **outputs})
    shared, alone = SharedDesigns(EFFECTS), SharedDesigns(EFFECTS)
    screen_sensor(sensor(1, Flaw(warmth=1e-3), Rig(wave=0.3)), LINEAR, shared)
    after, own = screen_sensor(other, LINEAR, shared), screen_sensor(other, LINEAR, alone)
    assert after.stage.information == pytest.approx(own.stage.information, abs=1e-2 * np.max(own.stage.information))
    assert [s.statistic for s in after.scores] == pytest.approx([s.statistic for s in own.scores], rel=1e-2, abs=1e-2)
    assert after.chance == pytest.approx(own.chance, rel=0.02)
    drifting, still = (
        SharedDesigns(EFFECTS).of(fit(LINEAR, s)).trials for s in (sensor(1, Flaw(warmth=1e-2)), sensor(2))
    )
    assert drifting == pytest.approx(still, rel=1e-2)


def test_columns_of_an_effect_on_the_output_are_each_sensors_own() -> None:
    class BentOutput(Effect):
        square = Parameter("{out}/g^2", typical=0.02)

        def output(self, v: Array, table: Table, p: Values) -> Array:
            return v + p.square * v * v

    bent = BentOutput()
    table, shared = sensor(1), SharedDesigns({bent.name: bent})
    far = replace(table, columns={**table.columns, "vx_v": 40 * table.column("vx_v")})
    screen_sensor(far, LINEAR, shared)
    after, own = (screen_sensor(table, LINEAR, s).scores[0] for s in (shared, SharedDesigns({bent.name: bent})))
    assert after.information == pytest.approx(own.information)


def test_columns_are_shared_where_an_effects_constants_are_the_same() -> None:
    class Multiplied(Effect):
        square = Parameter("{out}/g^2", typical=0.02)
        times = Constant(lambda table: table.number("times", 1.0))

        def transduction(self, a: Array, table: Table, p: Values) -> Array:
            return p.times * a**2 * p.square

    effect = Multiplied()
    shared = SharedDesigns({effect.name: effect})
    once, thrice = (
        screen_sensor(replace(sensor(1), constants={"times": times}), LINEAR, shared).scores[0].information
        for times in (1.0, 3.0)
    )
    assert thrice == pytest.approx(9 * once)


def test_an_equal_batch_misses_nothing_and_one_defect_does_not_speak_for_it() -> None:
    clean = looks(sensor(300 + k) for k in range(14))
    assert not find_batch_effects(clean, STAGE)
    assert not find_batch_effects([*clean[1:], *looks([sensor(400, Flaw(bend=0.01))])], STAGE)


def fleet(rigs: dict[str, Rig], count: int = 5) -> list[Measured]:
    """Sensors of one batch, each askew by an angle of its own, some on each rig."""
    places = [rig for rig in rigs for _ in range(count)]
    found = looks(sensor(500 + k, Flaw(askew=0.1), rigs[rig]) for k, rig in enumerate(places))
    return [Measured("lot", rig, each.stage) for rig, each in zip(places, found, strict=True)]


def beyond(errors: Iterable[RigError]) -> dict[tuple[str, str, str], RigError]:
    return {(e.rig, e.effect, e.parameter): e for e in errors if e.beyond}


def test_what_all_sensors_of_a_rig_share_is_the_rigs() -> None:
    """Each sensor is askew by an angle of its own, which looks like its stage's zero: a fleet tells them apart."""
    members = fleet({"a": Rig(), "b": Rig(wave=0.05), "c": Rig(), "d": Rig(zero=0.8)})
    found = beyond(find_rig_errors(members))
    assert set(found) == {("b", "stage-eccentricity", "sine"), ("d", "stage-zero-offset", "beta")}
    wave, zero = found["b", "stage-eccentricity", "sine"], found["d", "stage-zero-offset", "beta"]
    assert abs(wave.value - 0.05) < 4 * wave.std < 0.02
    assert abs(zero.value - 0.8) < 4 * zero.std < 0.5


def test_equal_rigs_and_a_single_rig_have_no_rig_error() -> None:
    assert not find_rig_errors(fleet({"a": Rig(), "b": Rig(), "c": Rig()}, count=4))
    assert not find_rig_errors(fleet({"a": Rig(wave=0.1)}))


def test_rigs_are_compared_where_a_batch_connects_them() -> None:
    stage = looks([sensor(1)])[0].stage
    of = [Measured(batch, rig, stage) for batch, rig in ("1a", "1b", "2c", "3b", "3d")]
    assert find_unconnected_rigs(of) == [("c",), ("a", "b", "d")] or find_unconnected_rigs(of) == [
        ("a", "b", "d"),
        ("c",),
    ]


def test_a_corrected_table_stands_where_the_stage_truly_was() -> None:
    table = sensor(1)
    errors = {"stage-zero-offset": {"beta": 0.3, "alpha": 0.1}, "base-tilt": {"x": 0.2}}
    moved = correct_stage_errors(table, errors, EFFECTS)
    pose = nominal_pose(table)
    for name, values in errors.items():
        effect = EFFECTS[name]
        pose = effect.pose(pose, table, Values.of({p.name: values.get(p.name, 0.0) for p in effect.parameters}))
    assert specific_force(nominal_pose(moved)) == pytest.approx(specific_force(pose), abs=1e-12)
    assert correct_stage_errors(table, {}, EFFECTS) is table


def test_sensors_of_a_batch_need_fewer_poses_together() -> None:
    """A third of the poses, pooled, know a batch's bend better than all of them alone; and the intervals hold."""
    bent = LINEAR.with_effect(EFFECTS["quadratic-nonlinearity"])
    rng, truth, few, alone = np.random.default_rng(3), [], [], []
    for k in range(20):
        bend = 2e-4 + 2e-5 * rng.standard_normal()
        truth.append(bend)
        few.append(fit(bent, sensor(700 + k, Flaw(bend=bend), chosen=slice(0, 60, 3))))
        alone.append(fit(bent, sensor(700 + k, Flaw(bend=bend))))
    together = pool_siblings(
        np.array([f.theta for f in few]), np.array([information(f) for f in few]), few[0].problem.layout.typical
    )
    error = np.sqrt(np.mean((together.values[:, 4] - truth) ** 2))
    assert error < np.sqrt(np.mean((np.array([f.theta[4] for f in alone]) - truth) ** 2))
    low, high = together.intervals()
    assert np.mean((low[:, 4] <= truth) & (high[:, 4] >= truth)) >= 0.85


@pytest.mark.parametrize("count", [5, 40])
def test_pooled_intervals_of_correlated_parameters_hold_what_they_say(count: int) -> None:
    rng, held = np.random.default_rng(count), []
    for _ in range(240 // count):
        J = rng.standard_normal((count, 5, 3)) @ np.array([[1.0, 0.9, 0.5], [0, 0.4, 0.3], [0, 0, 1.0]])
        A = np.swapaxes(J, 1, 2) @ J
        truth = np.array([1.0, -2.0, 0.5]) + np.array([2.0, 0.3, 0.0]) * rng.standard_normal((count, 3))
        cov = np.linalg.inv(A)
        theta = truth + np.einsum("nij,nj->ni", np.linalg.cholesky(cov), rng.standard_normal((count, 3)))
        low, high = pool_siblings(theta, A, np.ones(3)).intervals()
        held.append(np.mean((low <= truth) & (high >= truth), axis=0))
    assert np.all(np.mean(held, axis=0) > 0.9)


def test_what_siblings_tell_of_one_parameter_tells_of_another_that_poses_mix_with_it() -> None:
    rng, cov = np.random.default_rng(4), np.array([[1.0, 0.97], [0.97, 1.0]])
    truth = np.column_stack([np.full(40, 2.0), 5 * rng.standard_normal(40)])
    theta = truth + rng.multivariate_normal(np.zeros(2), cov, 40)
    found = pool_siblings(theta, np.tile(np.linalg.inv(cov), (40, 1, 1)), np.ones(2))
    error, alone = found.values[:, 1] - truth[:, 1], theta[:, 1] - truth[:, 1]
    assert np.sqrt(np.mean(error**2)) < 0.5 * np.std(alone)
    assert np.all(found.stds[:, 1] < 0.6)


def test_what_a_sensors_poses_do_not_tell_is_foretold_by_its_siblings() -> None:
    A = np.tile(np.diag([4.0, 4.0]), (10, 1, 1))
    A[0] = np.diag([4.0, 0.0])
    theta = np.tile([1.0, 5.0], (10, 1)) + 0.1 * np.random.default_rng(0).standard_normal((10, 2))
    theta[0, 1] = 50.0
    found = pool_siblings(theta, A, np.ones(2))
    assert found.values[0, 1] == pytest.approx(5, abs=0.5)
    assert np.isinf(found.alone[0, 1])
    assert found.stds[0, 1] < 1
