"""Free forms: bases, effects of a model, and the search for places."""

import os
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import BSpline

from calibrations.discovery.results import Discovery
from calibrations.discovery.verdict import Verdict
from calibrations.effects import Values, kernels
from calibrations.effects.catalogue import catalogue
from calibrations.errors import ModelError
from calibrations.fitting.fit import Fit, evaluate, fit, refit
from calibrations.free_forms import bases
from calibrations.free_forms.bases import (
    DEGREE,
    Clips,
    Harmonics,
    Play,
    Preisach,
    Products,
    Settling,
    Spline,
    StraightLine,
    Waves,
    spline,
)
from calibrations.free_forms.effect import FreeForm, check_forms, free_form, place_of
from calibrations.free_forms.form import Form
from calibrations.free_forms.saw import _steps
from calibrations.geometry.orientation import nominal_pose, specific_force
from calibrations.loop import dataset
from calibrations.model.file import dump_model, parse_model, read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic
from tests.hidden import sampled

ROOT = Path(__file__).parents[2]


def poses(added: Array, seed: int = 0) -> Table:
    """A sweep of five inclinations; `added` (n, 2) is what the sensor adds, V."""
    columns, forces = columns_of_sweep(), forces_of_sweep()
    outputs = np.array([2.5, 2.52]) + forces[:, :2] * [1.0, 0.97] + added
    return synthetic.poses(columns, outputs[:, 0], outputs[:, 1], seed=seed)


def discover(table: Table) -> Discovery[Fit]:
    return dataset(table).discover(read_model("linear"), catalogue())


def columns_of_sweep() -> dict[str, Array]:
    return synthetic.turns((90, 30, 150, 60, 120), step_deg=10)


def forces_of_sweep() -> Array:
    return np.column_stack(synthetic.components(columns_of_sweep()))


def with_curve(size: float, table: Table) -> Fit:
    """The linear model with a free form of the own response."""
    over = spline(np.linspace(-1.0, 1.0, 50), 12)
    form = Form("own-response", "curve", "own", (over, over), sizes=(size, size))
    start = fit(read_model("linear"), table)
    return refit(start, start.model.with_effect(free_form((form,))))


def test_relays_at_any_place_are_a_sum_of_functions_of_plays() -> None:
    """2,000 relays with centres on one side, along a path with minor loops."""
    random = np.random.default_rng(4)
    path = np.interp(np.arange(400) / 40, np.arange(11), random.uniform(-1, 1, 11))
    centre, half = random.normal(0.4, 0.15, 2000), random.uniform(0.05, 0.6, 2000)
    closed, output = path[0] > centre, np.empty(len(path))
    for i, x in enumerate(path):
        closed = np.where(x > centre + half, True, np.where(x < centre - half, False, closed))
        output[i] = np.mean(closed)
    widths = tuple(np.linspace(0.05, 0.6, 6))
    plays = np.column_stack([kernels.play(path, width) for width in widths])
    columns = np.column_stack([np.ones(len(path)), Preisach(widths, -1.05, 1.05, 8).columns_of(plays)])
    slips = np.column_stack([np.ones(len(path)), path, path[:, None] - plays])

    def left(X: Array) -> float:
        return float(np.std(output - X @ np.linalg.lstsq(X, output, rcond=1e-9)[0]) / np.std(output))

    assert columns.shape[1] == 1 + Preisach(widths, -1.05, 1.05, 8).count
    assert left(columns) < 0.02
    assert left(slips) > 5 * left(columns)


def test_columns_of_a_spline_have_unit_roughness_and_are_independent() -> None:
    basis = Spline(-1.0, 1.0, 8)
    knots, turn = bases._diagonalise_penalty(basis.low, basis.high, basis.intervals, basis.order)
    x = np.linspace(-1.0, 1.0, 20001)[:-1]
    step = 2.0 / basis.intervals
    second = BSpline(knots, np.eye(len(turn)), DEGREE).derivative(2)(x) @ turn * step**2
    roughness = second.T @ second / len(x) * basis.intervals
    assert roughness == pytest.approx(np.eye(basis.count), abs=2e-3)


@pytest.mark.parametrize(
    "basis", [Spline(0.0, 1.0, 5), Harmonics(2, 4), Waves(0.0, 1.0, 6, 2.0), StraightLine(0.0, 1.0)]
)
def test_a_basis_has_as_many_columns_as_it_counts(basis: Spline | Harmonics | Waves | StraightLine) -> None:
    assert basis(np.linspace(0.0, 1.0, 30)).shape == (30, basis.count)


def test_columns_of_a_spline_are_cubic_b_splines_that_end_constant() -> None:
    basis = Spline(-1.0, 1.0, 8)
    knots, turn = bases._diagonalise_penalty(basis.low, basis.high, basis.intervals, basis.order)
    x = np.linspace(-1.0, 1.0, 401)[:-1]
    np.testing.assert_allclose(basis(x), BSpline(knots, turn, DEGREE)(x), rtol=0, atol=1e-12)
    np.testing.assert_allclose(basis(np.array([-3.0, 3.0])), basis(np.array([-1.0, 1.0])), rtol=0, atol=1e-12)


def test_products_are_products_of_powers() -> None:
    a = np.random.default_rng(2).standard_normal((20, 3))
    x, y, z = a.T
    expected = np.column_stack([x**i * y**j * z**m for i, j, m in Products(4).powers])
    np.testing.assert_allclose(Products(4)(a), expected, rtol=1e-12)


def test_a_free_form_adds_the_same_whether_its_columns_are_kept_or_not() -> None:
    over, table, a = (
        spline(np.linspace(-1.0, 1.0, 50), 12),
        poses(np.zeros((len(forces_of_sweep()), 2))),
        forces_of_sweep(),
    )
    forms = (
        Form("scale-over-cross", "curve", "cross", (over,), "force", sizes=(1.0, 1.0)),
        Form("scale-over-cross", "line", "cross", (StraightLine(-1.0, 1.0),), sizes=(1.0, 1.0)),
    )
    effect = free_form(forms)
    rng = np.random.default_rng(3)
    p = Values({q.name: np.append(rng.standard_normal(2), 0.0) for q in effect.parameters})
    sum_columns = effect.transduction(a, table, p)
    columns = effect.columns(a, table)
    assert columns is not None
    np.testing.assert_allclose(sum_columns, sum(columns[name] * p[name] for name in p), rtol=0, atol=1e-12)
    np.testing.assert_allclose(effect.transduction(a, table, p), sum_columns, rtol=0, atol=1e-12)


def test_the_sum_of_a_spline_is_that_of_its_columns() -> None:
    x = np.linspace(-1.5, 1.5, 101)
    found = Spline(-1.0, 1.0, 14)
    for count in (found.count, 5):
        coefficients = np.random.default_rng(1).standard_normal(count)
        expected = found(x)[:, :count] @ coefficients
        np.testing.assert_allclose(found.sum_columns(x, coefficients), expected, rtol=0, atol=1e-13)


def test_settling_follows_exponentials_of_very_different_time_constants() -> None:
    t = 20.0 + 8.0 * np.arange(500)
    begun = 0.6 * np.exp(-(t - 20) / 60) + 0.4 * np.exp(-(t - 20) / 2500)
    basis = Settling(20.0, 4000.0, 8.0, 8)
    columns = np.column_stack([np.ones(500), basis(t)])
    assert columns.shape[1] == basis.count + 1
    left = begun - columns @ np.linalg.lstsq(columns, begun, rcond=None)[0]
    assert np.abs(left).max() < 5e-3
    assert basis(np.array([4020.0])) == pytest.approx(basis(np.array([9000.0])))


def test_clips_are_sums_of_dead_zones() -> None:
    x = np.linspace(-1, 1, 9)
    assert Clips((0.5, 2.0))(x) == pytest.approx(np.column_stack([np.clip(x, -0.5, 0.5) / 0.5, x / 2]))


def test_products_and_slip_elements_count_their_columns() -> None:
    assert Products(4).count == len(Products(4).powers)
    assert all((i > 0) + (j > 0) + (m > 0) > 1 for i, j, m in Products(4).powers)
    assert Play((0.1, 0.3)).count == 2


def test_a_free_form_of_size_zero_changes_nothing() -> None:
    table = poses(np.zeros((len(forces_of_sweep()), 2)))
    without, with_it = fit(read_model("linear"), table), with_curve(1e-12, table)
    assert with_it.residual == pytest.approx(without.residual, abs=1e-9)
    assert with_it.params["bias.x"].value == pytest.approx(without.params["bias.x"].value, abs=1e-9)
    assert with_it.held_out_excess == pytest.approx(without.held_out_excess, rel=1e-6)


def test_a_free_form_follows_a_curve_and_predicts_unseen_poses() -> None:
    forces = forces_of_sweep()
    table = poses(1e-3 * np.sin(4 * forces[:, :2]))
    found = with_curve(1e-3, table)
    assert fit(read_model("linear"), table).held_out_excess > 5
    assert found.held_out_excess < 1.15
    assert found.pooled_excess < 1.1


def test_a_prior_pulls_coefficients_towards_zero() -> None:
    table = poses(1e-3 * np.sin(4 * forces_of_sweep()[:, :2]))
    free, pulled = with_curve(1e-2, table), with_curve(1e-6, table)
    own = free.problem.layout.of_effect("free:own-response")
    assert np.linalg.norm(pulled.theta[own]) < 0.1 * np.linalg.norm(free.theta[own])


def test_a_model_file_keeps_a_free_form_to_the_last_bit() -> None:
    table = poses(1e-3 * np.sin(4 * forces_of_sweep()[:, :2]))
    found = with_curve(1e-3, table)
    again = parse_model(dump_model(found.model), "again")
    effect = again.terms[-1].effect
    assert isinstance(effect, FreeForm)
    assert effect.forms == found.model.terms[-1].effect.forms  # type: ignore[attr-defined]
    evaluated = evaluate(again, table)
    assert evaluated is not None
    assert np.array_equal(evaluated.residual, found.residual)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sizes": ()}, "has no size"),
        ({"place": "time-bias"}, "acts at time-bias, and the effect at own-response"),
        ({"kept": (40, 40)}, "not above the columns of the basis"),
        ({"kept": (1, 1, 1)}, "for 2 axes"),
    ],
)
def test_a_model_file_with_an_impossible_form_is_refused(change: dict[str, object], message: str) -> None:
    found = with_curve(1e-3, poses(np.zeros((len(forces_of_sweep()), 2))))
    text = dump_model(found.model)
    effect = found.model.terms[-1].effect
    assert isinstance(effect, FreeForm)
    broken = replace(effect.forms[0], **change)
    import yaml
    from pydantic import TypeAdapter

    document = yaml.safe_load(text)
    document["effects"][-1]["forms"] = TypeAdapter(tuple[Form, ...]).dump_python((broken,), mode="json")
    with pytest.raises(ModelError, match=message):
        parse_model(yaml.safe_dump(document), "broken")


def test_a_turn_of_the_base_about_an_unknown_axis_is_refused(golden) -> None:
    form = Form("tilt-over-time", "about-w", "time", (Spline(0.0, 1.0, 4),), sizes=(1e-3,), shared=True)
    with golden.refused(ModelError):
        check_forms((form,), form.place)


def test_an_unknown_place_is_refused_with_the_nearest(golden) -> None:
    with golden.refused(ModelError):
        place_of("free:own-respons")


def test_an_exact_form_of_the_catalogue_leaves_no_free_form() -> None:
    """Two effects: one alone would need no search for places."""
    added = 1e-3 * forces_of_sweep()[:, :2] ** 3
    added[:, 0] += 2e-3 * forces_of_sweep()[:, 2] ** 2
    result = discover(poses(added))
    assert set(result.causes) == {"cubic-nonlinearity", "z-axis-bias"}
    assert len(result.steps) == 2
    assert {place.name for place in result.findings.places} == {"own-response", "z-response"}


def test_a_form_that_the_catalogue_lacks_is_an_unknown_effect_at_its_place() -> None:
    forces = forces_of_sweep()[:, :2]
    result = discover(poses(1e-3 * np.exp(-((forces - 0.35) ** 2) / 0.02) * [1.0, -0.6]))
    assert result.verdict is Verdict.UNEXPLAINED
    assert not result.causes
    assert [place.name for place in result.findings.places if place.unknown] == ["own-response"]
    assert "not in the catalogue acts at own-response" in result.judgement.text
    assert result.end.held_out_excess < 1.3


def test_a_cause_in_another_form_keeps_its_curve() -> None:
    cross = forces_of_sweep()[:, [1, 0]]
    result = discover(poses(1e-3 * cross**2 + 1.2e-4 * np.cos(6 * cross) + 5e-4 * cross))
    assert result.causes == ("cross-axis-bias",)
    assert "free:cross-response" in [step.name for step in result.steps]
    assert result.end.held_out_excess < 1.15


def test_a_curve_of_which_a_form_of_the_catalogue_is_the_smaller_part_has_an_unknown_cause() -> None:
    cross = forces_of_sweep()[:, [1, 0]]
    result = discover(poses(1e-3 * cross**2 + 7e-4 * np.cos(6 * cross) + 5e-4 * cross))
    assert (result.verdict, result.causes) == (Verdict.UNEXPLAINED, ())
    assert [place.name for place in result.findings.places if place.unknown] == ["cross-response"]


def test_a_linear_sensor_gets_neither_a_name_nor_a_form() -> None:
    for seed in range(5):
        result = discover(poses(np.zeros((len(forces_of_sweep()), 2)), seed))
        assert not result.steps
        assert not result.findings.places


def test_the_order_of_rows_changes_nothing() -> None:
    table = poses(1e-3 * forces_of_sweep()[:, [1, 0]] ** 2)
    shuffled = table.rows(np.random.default_rng(1).permutation(table.n))
    first, second = (discover(each) for each in (table, shuffled))
    assert first.causes == second.causes == ("cross-axis-bias",)
    assert [p.name for p in first.findings.places] == [p.name for p in second.findings.places]


def test_uncertainties_beside_a_free_form_are_wider() -> None:
    table = poses(1e-3 * np.sin(4 * forces_of_sweep()[:, :2]))
    alone = refit(fit(read_model("linear"), table), read_model("linear").with_effect(catalogue()["cubic-nonlinearity"]))
    form = with_curve(1e-3, table).model.terms[-1].effect
    beside = refit(alone, alone.model.with_effect(form))
    narrow, wide = (f.params["cubic-nonlinearity.x"].std for f in (alone, beside))
    assert narrow is not None
    assert wide is not None
    assert wide * beside.birge > narrow / alone.birge


def test_forces_of_the_chain_drive_the_form() -> None:
    table = poses(np.zeros((len(forces_of_sweep()), 2)))
    forces = specific_force(nominal_pose(table))
    form = Form("z-response", "line", "out-of-plane", (StraightLine(-1.0, 1.0),), sizes=(1.0, 1.0))
    assert form.columns(table, forces, forces[:, 0], 0)[:, 0] == pytest.approx(forces[:, 2])


def test_relays_of_a_width_close_at_any_force_alike() -> None:
    """The prior: what a step of the force closes has one variance, and steps have nothing in common."""
    closed = np.diff(Preisach((0.1,), -1.0, 1.0, 10).columns_of(np.linspace(-0.8, 0.8, 9)[:, None]), axis=0)
    variances = closed @ closed.T / np.sum(closed[0] ** 2)
    assert np.diagonal(variances) == pytest.approx(1.0, abs=0.03)
    assert abs(variances[0, 4]) < 0.03


def test_in_few_poses_effects_are_searched_without_places() -> None:
    found = discover(poses(1e-3 * forces_of_sweep()[:, :2] ** 3).rows(np.arange(8)))
    assert found.findings.places == ()


def test_an_even_curve_over_the_out_of_plane_axis_leaves_a_misalignment_its_name() -> None:
    x, y, z = forces_of_sweep().T
    turned = np.radians([0.75, -1.3, 0.4])
    added = np.column_stack([turned[2] * y - turned[1] * z + 4e-3 * z**2, turned[0] * z - turned[2] * x])
    found = discover(poses(added))
    assert set(found.causes) == {"axis-misalignment", "z-axis-bias"}


def test_the_saw_of_a_quantiser_tells_its_step_offset_and_noise() -> None:
    step, offset, noise = 4e-3, 0.7e-3, 0.6e-3
    v = np.linspace(0.0, 1.0, 20000, endpoint=False)
    quantiser = catalogue()["quantisation"]
    p = SimpleNamespace(step=np.array([step]), offset=np.array([offset]), noise=np.array([noise]))
    saw = quantiser.output(v[:, None], poses(np.zeros((len(forces_of_sweep()), 2))), p)[:, 0] - v
    turned = 2 * np.pi * v / step
    sine, cosine = (float(2 * np.mean(saw * wave(turned))) for wave in (np.sin, np.cos))
    found = dict(_steps(1 / step, sine, cosine))
    assert found == pytest.approx({"step": step, "offset": offset, "noise": noise}, rel=1e-2)


@pytest.mark.slow
def test_each_step_lowers_the_error_where_a_sharp_corner_is_hundreds_of_floors() -> None:
    found = discover(sampled.measured(2, cause=sampled.clipped(3.3, 0.02)))
    errors = [step.after.pooled_excess for step in found.findings.steps]
    assert found.findings.steps[0].name == "saturation"
    assert all(later < 1.02 * earlier for earlier, later in pairwise(errors))
    assert errors[-1] < 1.5


@pytest.mark.slow
def test_the_hash_seed_of_the_process_changes_no_result() -> None:
    code = (
        "from tests.hidden import sampled; from calibrations.loop import discover;"
        "from calibrations.model.file import read_model;"
        "found = discover(sampled.measured(1, cause=sampled.lagging_stress(1e-3)), read_model('linear'));"
        "print(found.causes, repr(found.findings.end.pooled_excess))"
    )
    places = {**os.environ, "PYTHONPATH": str(ROOT)}
    ends = [
        subprocess.run(
            [sys.executable, "-c", code],
            env=places | {"PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2", "3")
    ]
    assert ends[0] == ends[1] == ends[2]
    assert "temperature-hysteresis" in ends[0]
