"""Discovery on tables made by formulas: order, causes and refinements, needless effects, rivals and what parts them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from calibrations.discovery.candidates import _is_similar
from calibrations.discovery.outliers import gross
from calibrations.discovery.refinements import _cost_of_removal
from calibrations.discovery.results import Discovery
from calibrations.discovery.row_search import _is_explained
from calibrations.discovery.search import find_path, first_order_cost
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import fit
from calibrations.loop import dataset, diagnose, discover
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations.synthetic import NOISE_V, components, directions, poses, turns
from tests.slow import first_fast

LINEAR = read_model("linear")
COMMON = read_model("common-scale")


def names(found: Discovery) -> list[str]:
    return [step.name for step in found.steps]


def positions(outputs: Array, noise: float = 5e-5, seed: int = 0) -> Table:
    """A table of positions, in g, each the mean of 100 samples."""
    rng = np.random.default_rng(seed)
    measured = outputs + noise * rng.standard_normal(outputs.shape)
    n = len(outputs)
    columns = dict(zip(("ax", "ay", "az"), measured.T, strict=True)) | {"n": np.full(n, 100.0)}
    columns |= {f"{name}_std": np.full(n, 10 * noise) for name in ("ax", "ay", "az")}
    return Table.from_columns("positions", columns, {"unit": "g"}, "made")


def test_nothing_is_added_where_nothing_is_missing() -> None:
    x, y, _ = components(turns())
    found = discover(poses(turns(), 2.5 + x, 2.5 + y), LINEAR)
    assert (found.verdict, found.steps, found.causes, dict(found.alternatives)) == ("adequate", (), (), {})
    assert found.end is found.start


def test_a_value_that_two_axes_share_is_freed_before_anything_new_is_added() -> None:
    """Though the new effect is the greater."""
    x, y, z = components(turns())
    square = 0.03 * z**2
    found = discover(poses(turns(), 2.5 + 1.001 * x + square, 2.5 + 0.999 * y + square), COMMON)
    assert names(found) == ["scale-factor", "z-axis-bias"]
    assert found.steps[-1].after.pooled_excess < 1.15


def test_scales_and_angles_of_a_triad_are_found_on_positions() -> None:
    x, y, z = directions(30).T
    measured = np.column_stack([1.01 * x, 0.99 * y + 0.01 * x, z + 0.005 * x - 0.004 * y])
    found = discover(positions(measured), COMMON)
    assert names(found) == ["scale-factor", "axis-nonorthogonality"]
    assert (found.verdict, found.causes) == ("adequate", ("scale-factor", "axis-nonorthogonality"))


@pytest.mark.parametrize(("cubic", "causes"), [(3e-3, 2), (5e-4, 1)])
def test_a_small_correction_of_the_form_is_a_refinement(cubic: float, causes: int) -> None:
    x, y, _ = components(turns())
    vx, vy = 2.5 + x + 0.01 * x**2 + cubic * x**3, 2.5 + y - 0.01 * y**2 - cubic * y**3
    found = discover(poses(turns(), vx, vy), LINEAR)
    both = ("quadratic-nonlinearity", "cubic-nonlinearity")
    assert names(found) == list(both)
    assert (found.causes, found.refinements) == (both[:causes], both[causes:])
    of_form = "Of these, cubic-nonlinearity only describes the exact form of quadratic-nonlinearity."
    assert (of_form in found.findings.given.text) == (causes == 1)


@pytest.mark.slow
def test_an_effect_that_later_ones_make_needless_is_dropped() -> None:
    """The effects have opposite signs on the two axes, which no one function of the output describes."""
    columns = turns(step_deg=30.0)
    x, y, _ = components(columns)
    found = discover(poses(columns, 2.5 + x + 1.5e-3 * (y**2 + abs(x)), 2.5 + y - 1.5e-3 * (x**2 + abs(y))), LINEAR)
    assert sorted(names(found)) == ["cross-axis-bias", "scale-factor-asymmetry"]
    first = find_path(found.start, (), catalogue()).steps
    assert len(first) > 2  # another was taken first, which explained a part of both
    assert found.end.pooled_excess < 1.15
    assert not found.end.model.holds(first[0].selected.name)


@pytest.mark.parametrize("alpha_deg", [90.0, None])
def test_squares_of_axes_that_add_up_to_one_are_rivals(alpha_deg: float | None) -> None:
    """In a field of 1 g: over beta at alpha = 90 deg x^2 = 1 - y^2, over alpha at beta = 0 or 180 deg x^2 = 1 - z^2."""
    if alpha_deg is not None:
        columns, rival = turns((alpha_deg,), step_deg=5.0), "cross-axis-bias"
    else:
        alpha = np.tile(np.arange(5.0, 180.0, 5.0), 4)
        columns = {"alpha_deg": alpha, "beta_deg": np.repeat([0.0, 180.0, 0.0, 180.0], 35), "t_s": 7.0 * np.arange(140)}
        rival = "z-axis-bias"
    x, y, _ = components(columns)
    table = poses(columns, 2.5 + x + 2e-3 * x**2, 2.5 + y)
    if alpha_deg is None:
        table = Table.from_columns("poses", {k: v for k, v in table.columns.items() if "vy" not in k}, source="made")
    found = discover(table, LINEAR)
    assert found.verdict == "ambiguous"
    (cause,) = found.causes
    assert rival in {cause, *found.alternatives[cause]}
    assert {cause, *found.alternatives[cause]} <= {"quadratic-nonlinearity", "cross-axis-bias", "z-axis-bias"}
    assert found.next_experiment is not None
    assert found.next_experiment.procedure == "sweep"  # at more inclinations the third axis is something of its own
    assert found.next_experiment.separates == tuple((cause, name) for name in found.alternatives[cause])


def test_a_turned_sensor_and_a_turned_stage_are_told_apart_face_down() -> None:
    columns = turns(step_deg=45.0)
    x, y, _ = components(columns)
    turn = np.radians(0.1)
    vx, vy = np.cos(turn) * x - np.sin(turn) * y, np.cos(turn) * y + np.sin(turn) * x
    found = discover(poses(columns, 2.5 + vx, 2.5 + vy), LINEAR)
    assert found.verdict == "ambiguous"
    (cause,) = found.causes
    assert {"axis-misalignment", "stage-zero-offset"} <= {cause, *found.alternatives[cause]}
    assert found.next_experiment is not None
    assert (found.next_experiment.procedure, found.next_experiment.settings) == ("sweep", {"face": "both"})


@pytest.mark.parametrize("step_deg", first_fast([60.0, 15.0]))
def test_what_no_effect_describes_is_unexplained(step_deg: float) -> None:
    """With 42 poses, by effects alone; with 150, after the search for places as well."""
    columns = turns((90, 30, 150), step_deg)
    x, y, _ = components(columns)
    step = 0.005 * (columns["t_s"] > np.median(columns["t_s"]))
    found = discover(poses(columns, 2.5 + x + step, 2.5 + y - step), LINEAR)
    assert found.verdict == "unexplained"
    assert found.residual_structure
    assert found.next_experiment is None


def test_the_effect_that_a_person_chooses_is_added_whatever_it_is_worth() -> None:
    x, y, z = components(turns())
    table = poses(turns(), 2.5 + x + 0.002 * z**2, 2.5 + y + 0.002 * z**2)
    right = dataset(table).add(catalogue()["z-axis-bias"], LINEAR, catalogue())
    wrong = dataset(table).add(catalogue()["cubic-nonlinearity"], LINEAR, catalogue())
    assert (right.verdict, right.causes) == ("adequate", ("z-axis-bias",))
    assert right.steps[0].held_out_after < 1.15 < right.steps[0].held_out_before
    assert wrong.verdict == "unexplained"
    assert wrong.steps[0].held_out_after > 0.9 * wrong.steps[0].held_out_before
    assert right.start.model.effects == LINEAR.effects


def test_a_drift_may_be_an_unlogged_temperature() -> None:
    """The table has times and no temperature: a drift in time cannot be separated from a temperature effect."""
    columns = turns()
    x, y, _ = components(columns)
    drift = 3e-4 * columns["t_s"] / columns["t_s"].max()
    best = diagnose(poses(columns, 2.5 + x + drift, 2.5 + y - drift), LINEAR).candidates[0]
    assert best.name in ("bias-drift", "warm-up-bias")
    assert "temperature-bias" in best.indistinguishable_from


def test_effects_that_the_data_cannot_separate_are_tested_together() -> None:
    columns = turns((90, 30, 150), step_deg=20.0)
    x, y, _ = components(columns)
    table = poses(columns, 2.5 + x - 2e-3 * y, 2.5 + y + 2e-3 * x)  # the sensor, or the stage, is turned
    names = ("stage-zero-offset", "axis-misalignment")
    model = read_model("linear")
    for name in names:
        model = model.with_effect(catalogue()[name])
    end = fit(model, table)
    alone, together = first_order_cost(end, "stage-zero-offset")[0], first_order_cost(end, *names)[0]
    assert alone < 10 < 1000 < together
    no_forms = np.zeros((len(end.whitened), 0))
    assert _cost_of_removal(end, names[0], no_forms)[0] == pytest.approx(alone, rel=1e-6)


def test_outliers_are_found_beside_a_missing_effect_of_their_size() -> None:
    columns = turns()
    x, y, z = components(columns)
    off = np.zeros(len(x))
    off[[20, 70]] = 60 * NOISE_V
    table = poses(columns, 2.5 + x + 100 * NOISE_V * z**2 + off, 2.5 + y)
    assert gross(fit(LINEAR, table)).tolist() == [20, 70]


@pytest.mark.parametrize(("sign", "outliers"), [(-1, 0), (1, 2)])
def test_ends_of_outputs_that_are_read_too_small_are_no_outliers(sign: int, outliers: int) -> None:
    """A limit of the output that one pose of each axis reaches looks like this; a knock can have either sign."""
    columns = turns((80, 30, 135), step_deg=7.0)
    x, y, _ = components(columns)
    vx, vy = 2.5 + x, 2.5 + y
    for output in (vx, vy):
        output[np.argmax(output)] += sign * 60 * NOISE_V
    assert len(gross(fit(LINEAR, poses(columns, vx, vy)))) == outliers


def test_only_a_known_noise_tells_that_nothing_but_noise_is_left() -> None:
    columns = turns((90, 30), step_deg=30.0)
    x, y, _ = components(columns)
    known = poses(columns, 2.5 + x, 2.5 + y)
    unknown = Table.from_columns("poses", {k: v for k, v in known.columns.items() if "std" not in k}, source="made")
    assert [_is_explained(find_path(fit(LINEAR, table), (), {})) for table in (known, unknown)] == [True, False]


@pytest.mark.parametrize(
    ("contained", "contained_in_best", "similar"), [((), (), True), (("b",), (), False), ((), ("a",), False)]
)
def test_an_effect_and_its_part_are_no_similar_effects(
    contained: tuple[str, ...], contained_in_best: tuple[str, ...], similar: bool
) -> None:
    candidate = SimpleNamespace(name="a", effect=SimpleNamespace(contains=contained), rank=1, gain=99.0)
    best = SimpleNamespace(name="b", effect=SimpleNamespace(contains=contained_in_best), rank=1, gain=100.0)
    assert _is_similar(candidate, best) == similar
