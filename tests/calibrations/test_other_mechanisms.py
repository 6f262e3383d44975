"""Mechanisms of real sensors whose form is far from the catalogue's: one mechanism has one name, and none is noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calibrations.discovery.results import Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.effects.signal.quantisation import mean_of_rounded
from calibrations.fitting.fit import Fit
from calibrations.free_forms.acting_places import ActingPlace, places
from calibrations.free_forms.chain import ModelEffects, start
from calibrations.free_forms.place_names import PREFIX
from calibrations.free_forms.places import components
from calibrations.free_forms.poses import PoseData
from calibrations.free_forms.search_result import Point, Setting, finish
from calibrations.loop import dataset
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.calibrations import synthetic
from tests.slow import slow

TURN = synthetic.turns((90, 30, 150, 60, 120), step_deg=10)
DURATION_S = float(np.ptp(TURN["t_s"]))


def forces(columns: dict[str, Array], alpha_deg: Array | float = 0.0, beta_deg: Array | float = 0.0) -> Array:
    """Specific force, g, (n, 3), where the stages are off their readings by these angles."""
    true = {"alpha_deg": columns["alpha_deg"] + alpha_deg, "beta_deg": columns["beta_deg"] + beta_deg}
    return np.column_stack(synthetic.components(true))


def discover(columns: dict[str, Array], outputs: Array) -> Discovery[Fit]:
    table = synthetic.poses(columns, *(np.array([2.5, 2.52]) + outputs * [1.0, 0.9]).T)
    return dataset(table).discover(read_model("linear"), catalogue())


def in_all_directions(count: int, seed: int) -> dict[str, Array]:
    """Columns of poses whose directions are random, as is their order."""
    rng = np.random.default_rng(seed)
    alpha, beta = np.degrees(np.arccos(rng.uniform(-1, 1, count))), rng.uniform(0, 360, count)
    return {"alpha_deg": alpha, "beta_deg": beta, "direction": np.ones(count), "t_s": 9.0 * np.arange(count) + 50.0}


def swings_of_the_arm() -> dict[str, Array]:
    """Columns of poses over inclinations to both sides, there and back, at one angle of the turntable after another."""
    up = np.arange(-150.0, 151.0, 20.0)
    alpha = np.concatenate([up if k % 2 == 0 else up[::-1] for k in range(14)])
    columns = {"alpha_deg": alpha, "beta_deg": np.repeat(np.arange(14) * 25.0, len(up))}
    columns["direction"] = np.repeat([1.0 if k % 2 == 0 else -1.0 for k in range(14)], len(up))
    return columns | {"t_s": 7.0 * np.arange(len(alpha)) + 100.0}


@pytest.mark.parametrize("seed", [1, *slow([2, 3])])
def test_a_base_that_moves_slowly_is_no_scatter_of_poses_in_random_order(seed: int) -> None:
    """Its sign changes from pose to pose. Means without a stated filter may scatter more than their samples say."""
    poses = in_all_directions(100, seed)
    a = forces(poses)
    tilt = 1e-3 * np.sin(2 * np.pi * poses["t_s"] / (0.61 * np.ptp(poses["t_s"])) + 4.45)
    beta = np.radians(poses["beta_deg"])
    found = discover(poses, a[:, :2] + (tilt * a[:, 2])[:, None] * np.column_stack([np.cos(beta), np.sin(beta)]))
    assert (found.verdict, found.causes) == ("unexplained", ())
    assert found.start.pooled_excess > 5
    assert found.steps[-1].held_out_after < 1.15
    assert "scatter of the poses" not in found.judgement.text


@pytest.mark.slow
def test_an_out_of_plane_gap_has_one_name_for_its_line_and_its_curve() -> None:
    a = forces(TURN)
    found = discover(TURN, a[:, :2] + 4e-3 / (1 - 0.35 * a[:, 2:]))
    assert found.causes == ("z-axis-bias",)
    assert found.steps[-1].held_out_after < 1.15


def test_a_misalignment_that_turns_no_axis_in_the_plane_keeps_its_name_beside_a_square() -> None:
    """The line of a gap would come with a cube, which is not there."""
    a = forces(TURN)
    tilted = a[:, :2] + np.radians([0.5, -0.4]) * a[:, 2:]
    found = discover(TURN, tilted + 3e-3 * a[:, 2:] ** 2)
    assert set(found.causes) == {"axis-misalignment", "z-axis-bias"}
    assert found.steps[-1].held_out_after < 1.15


def test_a_misalignment_beside_an_out_of_plane_gap_keeps_its_name() -> None:
    """Its angle about z shows it."""
    a = forces(TURN, beta_deg=0.1)
    turned = a[:, :2] + np.radians([0.1, -0.1]) * a[:, 2:]
    found = discover(TURN, turned + 4e-3 / (1 - 0.35 * a[:, 2:]))
    assert "z-axis-bias" in found.causes
    assert {"axis-misalignment", "stage-zero-offset"} & set(found.causes)


def acting_places(outputs: Array, names: tuple[str, ...]) -> list[ActingPlace]:
    """The places where these components of a search act, at outputs of TURN, V, (n, 2)."""
    data = PoseData.of(synthetic.poses(TURN, *outputs.T))
    given = ModelEffects.without_effects(data)
    setting = Setting(data, np.full((2, data.n), synthetic.NOISE_V), given)
    values = start(data, given)
    state = setting.state_at(values, ())
    return places(finish(setting, Point(components(data, state), dict.fromkeys(names, 1e-4), values, state), {}, {}))


def test_a_warm_up_with_two_time_constants_is_one_cause() -> None:
    """The effect acts at the shorter one, beside a curve with the longer one: its name needs most of both together."""
    t = (TURN["t_s"] - TURN["t_s"][0]) / DURATION_S
    warming = 8e-3 * (0.5 * np.exp(-t / 0.03) + 0.5 * np.exp(-t / 0.3))
    outputs = 2.5 + forces(TURN)[:, :2] * (1 + warming[:, None] * [1.0, -0.8])
    (place,) = acting_places(outputs, ("time-scale/curve", "time-scale/warm-up-scale@0.040"))
    assert place.causes == ("warm-up-scale",)
    assert place.share > 0.9


def test_a_warm_up_with_a_jump_has_its_name_beside_a_line_in_time() -> None:
    """A curve that jumps is no drift, so that none competes for the name."""
    t = (TURN["t_s"] - TURN["t_s"][0]) / DURATION_S
    bias = 8e-3 * np.exp(-t / 0.3) + 1e-3 * (t > 0.5)
    names = ("time-bias/line", "time-bias/walk-x", "time-bias/walk-y", "time-bias/warm-up-bias@0.150")
    (place,) = acting_places(2.5 + forces(TURN)[:, :2] + bias[:, None] * [1.0, -0.8], names)
    assert place.causes == ("warm-up-bias",)


@pytest.mark.slow
def test_an_eccentric_stage_with_a_second_wave_has_its_name() -> None:
    beta = np.radians(TURN["beta_deg"])
    found = discover(TURN, forces(TURN, beta_deg=0.1 * (np.sin(beta + 0.4) + 0.36 * np.sin(2 * beta + 1.1)))[:, :2])
    assert found.causes == ("stage-eccentricity",)
    assert found.verdict == "adequate"


def test_an_arm_that_sags_is_an_offset_of_the_stage_and_no_effect_of_the_sensor() -> None:
    columns = swings_of_the_arm()
    sag = 0.063 * (1 + 0.15 * np.sin(np.radians(columns["alpha_deg"])))
    found = discover(columns, forces(columns, alpha_deg=sag, beta_deg=-0.03)[:, :2])
    assert found.causes == ("stage-zero-offset",)


@pytest.mark.parametrize("centre", [(0.02, -0.025), (0.0, 0.0)])
def test_a_dead_zone_about_the_own_zero_of_each_axis_has_its_name(centre: tuple[float, float]) -> None:
    directions = in_all_directions(300, seed=4)
    own = forces(directions)[:, :2]
    width = 0.01
    found = discover(directions, own - np.clip(own - centre, -width, width))
    assert found.causes == ("dead-zone",)
    for axis, value in zip("xy", centre, strict=True):
        assert found.end.params[f"dead-zone.centre.{axis}"].value == pytest.approx(value, abs=1e-3)
        assert found.end.params[f"dead-zone.width.{axis}"].value == pytest.approx(width, abs=1e-3)


def test_two_slopes_that_meet_at_the_own_zero_are_no_dead_zone() -> None:
    directions = in_all_directions(300, seed=4)
    own = forces(directions)[:, :2]
    found = discover(directions, own + 3e-3 * np.abs(own - [-0.03, 0.025]))
    assert found.causes == ("scale-factor-asymmetry",)
    assert found.end.held_out_excess < 1.15


def test_two_slopes_about_the_own_zero_leave_no_curve_in_swings_of_the_arm() -> None:
    columns = swings_of_the_arm()
    own = forces(columns)[:, :2]
    found = discover(columns, own + [-0.03, 0.002] * np.abs(own - [0.012, -0.01]))
    assert found.causes == ("scale-factor-asymmetry",)
    assert found.end.held_out_excess < 1.15


@pytest.mark.slow
@pytest.mark.parametrize(
    ("columns", "offset"),
    [(in_all_directions(300, seed=4), "base-tilt"), (swings_of_the_arm(), "stage-zero-offset")],
)
def test_a_saturation_that_bends_softly_has_its_name_beside_an_offset(columns: dict[str, Array], offset: str) -> None:
    """Its bend is six times as wide as that of a hard one; curves of response and output would cancel each other."""
    force, n = forces(columns, alpha_deg=0.14), len(columns["t_s"])
    output = force - 0.024 * np.sign(force) * np.logaddexp(0, (np.abs(force) - 1.0) / 0.03)
    noise = synthetic.NOISE_V * np.random.default_rng(0).standard_normal(output.shape)
    measured = {f"v{axis}_v": values for axis, values in zip("xyz", (2.5 + output + noise).T, strict=True)}
    known = dict.fromkeys(["vx_std_v", "vy_std_v", "vz_std_v"], np.full(n, synthetic.NOISE_V * np.sqrt(5000.0)))
    table = Table.from_columns("poses", {**columns, **measured, **known, "n": np.full(n, 5000.0)}, source="made")
    found = dataset(table).discover(read_model("linear"), catalogue())
    assert set(found.causes) == {"saturation", offset}
    assert {step.name for step in found.steps if not step.name.startswith(PREFIX)} == set(found.causes)
    assert found.end.held_out_excess < 1.15


def test_a_scale_factor_over_the_other_axis_keeps_its_name_beside_a_curve_of_products() -> None:
    directions = in_all_directions(200, seed=7)
    x, y, z = forces(directions).T
    own, other = np.column_stack([x, y]), np.column_stack([y, x])
    over_cross, over_z = 2e-3 * np.sin(1.8 * other) * [1.0, -0.7], 1e-3 * np.tanh(2 * z)[:, None] * [1.0, 0.6]
    found = discover(directions, own * (1 + over_cross + over_z))
    assert found.causes == ("cross-axis-scale",)
    assert found.end.held_out_excess < 1.15


@pytest.mark.slow
def test_effects_before_a_converter_are_added_one_by_one_where_places_leave_more_than_noise() -> None:
    columns = swings_of_the_arm()
    x, y, _ = forces(columns).T
    own, other = np.column_stack([x, y]), np.column_stack([y, x])
    smooth = 2.5 + own + 4e-4 * (own**2 + 0.6 * own**4) * [1.0, -0.8] + 2e-4 * own * np.sin(1.8 * other)
    noise = synthetic.NOISE_V * np.sqrt(5000.0)
    outputs = np.column_stack([mean_of_rounded(v, 3.6 * noise, 0.0, noise) for v in smooth.T])
    found = dataset(synthetic.poses(columns, *outputs.T)).discover(read_model("linear"), catalogue())
    assert set(found.causes) == {"quantisation", "quadratic-nonlinearity"}
    assert found.end.held_out_excess < 1.15


@pytest.mark.parametrize("seed", [3, *slow(range(6, 12))])
def test_no_effect_is_named_where_noise_hides_every_step_of_a_converter(seed: int) -> None:
    directions = in_all_directions(300, seed=4)
    table = synthetic.poses(directions, *(2.5 + forces(directions)[:, :2]).T, noise_v=0.02, seed=seed)
    assert catalogue()["quantisation"].searched(table) == 1.0
    assert not dataset(table).discover(read_model("linear"), catalogue()).causes


def test_a_converter_whose_samples_never_scatter_has_its_name() -> None:
    columns = swings_of_the_arm()
    outputs = np.round((2.5 + forces(columns)[:, :2]) / 5e-3) * 5e-3
    table = synthetic.poses(columns, *outputs.T, seed=None)
    without_scatter = dict.fromkeys(["vx_std_v", "vy_std_v"], np.zeros(table.n))
    found = dataset(replace(table, columns={**table.columns, **without_scatter})).discover(
        read_model("linear"), catalogue()
    )
    assert found.causes == ("quantisation",)


@pytest.mark.parametrize("columns", [in_all_directions(300, seed=4), *slow([swings_of_the_arm()])])
def test_a_wave_in_the_response_is_no_quantisation_of_noisier_samples_than_measured(columns: dict[str, Array]) -> None:
    """Only noise of half a step smooths a saw to a sine."""
    own = forces(columns)[:, :2]
    found = discover(columns, own + 1e-3 * np.sin(14 * own))
    assert (found.verdict, found.causes) == ("unexplained", ())
    assert found.end.held_out_excess < 1.15


def test_an_eccentric_stage_has_its_name_where_beta_stops_at_eight_headings() -> None:
    alpha, beta = (angle.ravel() for angle in np.meshgrid([45.0, 90.0, 135.0], np.arange(8) * 45.0, indexing="ij"))
    columns = {"alpha_deg": np.tile(alpha, 8), "beta_deg": np.tile(beta, 8), "direction": np.ones(8 * alpha.size)}
    columns["t_s"] = 9.0 * np.arange(8 * alpha.size) + 50.0
    turned = np.radians(columns["beta_deg"])
    found = discover(columns, forces(columns, 0.0, 0.1 * np.sin(turned + 0.6) + 0.02 * np.cos(2 * turned))[:, :2])
    assert found.causes == ("stage-eccentricity",)
    assert found.end.held_out_excess < 1.15


def test_two_causes_are_found_in_forty_poses_of_unknown_noise() -> None:
    directions = in_all_directions(40, seed=6)
    x, y, z = forces(directions).T
    added = np.column_stack([2e-3 * z**2 + 2e-3 * x * np.abs(x), -1.5e-3 * z**2 + 3e-3 * y * np.abs(y)])
    table = synthetic.poses(directions, *(np.array([2.5, 2.52]) + (np.column_stack([x, y]) + added) * [1.0, 0.9]).T)
    means = {name: values for name, values in table.columns.items() if name != "n" and "std" not in name}
    found = dataset(replace(table, columns=means)).discover(read_model("linear"), catalogue())
    assert found.verdict == "adequate"
    assert set(found.causes) == {"z-axis-bias", "odd-quadratic-nonlinearity"}


def with_vibration(directions: dict[str, Array], seed: int) -> tuple[dict[str, Array], Array]:
    """Standard deviations of samples that vibration raises at random, V, and its mean squares, V^2, (n, 2)."""
    rng = np.random.default_rng(seed)
    vibration = rng.uniform(0.2, 1.0, (len(directions["t_s"]), 2)) * 8e-3
    std = np.hypot(vibration, synthetic.NOISE_V * np.sqrt(5000.0))
    return {"vx_std_v": std[:, 0], "vy_std_v": std[:, 1]}, vibration**2


def discover_with_vibration(directions: dict[str, Array], outputs: Array, std: dict[str, Array]) -> Discovery[Fit]:
    table = synthetic.poses(directions, *(np.array([2.5, 2.52]) + outputs).T)
    return dataset(replace(table, columns={**table.columns, **std})).discover(read_model("linear"), catalogue())


@pytest.mark.slow
def test_a_drift_keeps_its_name_beside_vibration_that_differs_from_pose_to_pose() -> None:
    """No level lies beneath the scatter of such standard deviations, so that their readings have no known error."""
    directions = in_all_directions(300, seed=8)
    std, squares = with_vibration(directions, seed=9)
    walk = 1e-4 * np.cumsum(np.random.default_rng(3).standard_normal((300, 2)), axis=0)
    found = discover_with_vibration(directions, forces(directions)[:, :2] + 30.0 * squares + walk, std)
    assert set(found.causes) == {"vibration-rectification", "bias-drift"}


@pytest.mark.slow
def test_vibration_that_is_rectified_more_under_load_is_one_cause() -> None:
    directions = in_all_directions(300, seed=8)
    std, squares = with_vibration(directions, seed=9)
    own = forces(directions)[:, :2]
    found = discover_with_vibration(directions, own + 60.0 * squares * (1 + 0.5 * own), std)
    assert found.causes == ("vibration-rectification",)
    assert not found.findings.final.unknown
    assert found.end.held_out_excess < 1.15
    assert np.sqrt(np.mean(found.end.residual**2)) < 1.2 * synthetic.NOISE_V  # vibration would raise the floor


@pytest.mark.slow
def test_rectified_vibration_keeps_its_name_beside_a_far_larger_effect() -> None:
    directions = in_all_directions(300, seed=8)
    std, squares = with_vibration(directions, seed=9)
    own = forces(directions)[:, :2]
    found = discover_with_vibration(directions, own + 10.0 * squares + 0.1 * own**3, std)
    assert set(found.causes) == {"cubic-nonlinearity", "vibration-rectification"}
