"""The simulated hand and its sensor."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from drivers.handheld.hand import Hand, Script
from drivers.handheld.motion import rotations
from drivers.handheld.triad import Mass, Triad, individual, steady_v
from drivers.handheld.world import FIELDS, FORCES, INPUTS, RATES, Handheld, HandheldWorld, handheld
from drivers.world.config import WorldConfig
from drivers.world.errors import BadSetting, UnknownSetting

CALM = Hand(slips=0.0, errs=0.0, clings=0.0, aim_deg=0.0, side_deg=0.0, table_deg=0.0)
EDGE = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
TIMES_S = np.arange(0.0, 12.0, 0.01)


def script(hand: Hand = CALM, seed: int = 1) -> Script:
    return Script(hand, np.random.default_rng(seed), np.array([0.0, 0.0, 1.0]))


def test_it_lies_still_until_it_is_told_to_turn() -> None:
    hand = script()
    assert hand.motion(TIMES_S).force_g == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(TIMES_S), 1)))


def test_it_turns_the_sensor_trembling_and_then_lets_go() -> None:
    hand = script()
    hand.turn_to(EDGE, 0.0)
    force = hand.motion(TIMES_S[:700]).force_g
    assert force[:70].std(axis=0).max() < 1e-9  # the reaction
    assert np.linalg.norm(force[120:180], axis=1).std() > 0.01  # turning
    assert force[-100:] == pytest.approx(np.tile(EDGE, (100, 1)), abs=1e-6)


def test_an_impatient_hand_tries_again_without_being_told() -> None:
    hand = script(replace(CALM, patience_s=2.0))
    hand.turn_to(EDGE, 0.0)
    moving = np.linalg.norm(np.diff(hand.motion(np.arange(0.0, 60.0, 0.01)).force_g, axis=0), axis=1) > 1e-3
    windows = moving[: 100 * (len(moving) // 100)].reshape(-1, 100).any(axis=1)
    assert np.sum(np.diff(windows.astype(int)) == 1) >= 4


def test_a_sensor_slips_after_it_was_let_go() -> None:
    slipped = []
    for seed in range(40):
        hand = script(replace(CALM, slips=0.5, slip_deg=4.0), seed)
        hand.turn_to(EDGE, 0.0)
        at = hand.up(np.arange(0.0, 7.0, 0.01))[-1]
        slipped.append(bool(at @ EDGE < np.cos(np.radians(0.5))))
    assert 8 <= sum(slipped) <= 32


def test_it_misses_an_edge_by_more_than_a_side() -> None:
    def missed_deg(up: np.ndarray) -> float:
        found = []
        for seed in range(60):
            hand = script(Hand(slips=0.0, errs=0.0, clings=0.0), seed)
            hand.turn_to(up, 0.0)
            found.append(np.degrees(np.arccos(min(1.0, hand.up(np.array([8.0]))[0] @ up))))
        return float(np.sqrt(np.mean(np.square(found))))

    assert 8 < missed_deg(EDGE) < 16
    assert 1 < missed_deg(np.array([0.0, 1.0, 0.0])) < 5


def test_a_triad_is_linear_with_its_own_zeros_gains_and_angles() -> None:
    triad = Triad(x=Mass(zero_v=1.7, volts_per_g=0.9, leans_deg=1.0))
    volts = steady_v(triad, np.vstack([np.eye(3), -np.eye(3)]))
    assert volts.mean(axis=0) == pytest.approx([1.7, 1.65, 1.65])
    gains = (volts[:3] - volts[3:]) / 2
    assert gains[:, 0] == pytest.approx([0.9 * np.cos(np.radians(1.0)), 0.9 * np.sin(np.radians(1.0)), 0.0], rel=1e-3)
    assert np.diag(gains)[1:] == pytest.approx([0.8, 0.8], rel=1e-3)


def test_softening_springs_are_nonlinear() -> None:
    triad = Triad(x=Mass(hardening_per_um2=-15.0))
    half, whole = steady_v(triad, np.array([[0.5, 0, 0], [1.0, 0, 0]]))[:, 0] - 1.65
    assert whole / half == pytest.approx(2 * (1 + 0.75 * 15e-6 * 8.2**2), rel=1e-4)


def test_sensors_of_one_kind_differ() -> None:
    gains = [individual(Triad(), np.random.default_rng(seed)).x.volts_per_g for seed in range(50)]
    assert np.std(gains) == pytest.approx(0.8 * 0.02, rel=0.4)


def samples(world: HandheldWorld, start_s: float, n: int = 400) -> np.ndarray:
    return world.adc_volts(FORCES, start_s, 0.005, n)


def test_it_continues_sample_for_sample_from_a_kept_state() -> None:
    one, other = (HandheldWorld(WorldConfig.ideal(), 3, Handheld()) for _ in range(2))
    samples(one, 0.0)
    one.turn_by_hand((1.0, 0.0, 0.0))
    samples(one, 2.0)
    kept = json.loads(json.dumps(one.state()))
    expected = samples(one, 4.0, 4000)
    other.restore(kept)
    assert np.array_equal(samples(other, 4.0, 4000), expected)


def test_its_noise_is_that_of_its_settings() -> None:
    world = HandheldWorld(WorldConfig.ideal(), 3, Handheld(triad=Triad(wander_v=0.0)))
    assert samples(world, 0.0, 20_000).std(axis=0) == pytest.approx(np.full(3, 1.2e-3), rel=0.05)


def test_other_inputs_are_those_of_the_world() -> None:
    world = HandheldWorld(WorldConfig.ideal(), 3, Handheld())
    volts = world.adc_volts(("supply", "az", "vx"), 0.0, 0.005, 10)
    assert volts[:, 0] == pytest.approx(np.full(10, 5.0), abs=0.01)
    assert volts[:, 1].mean() == pytest.approx(2.45, abs=0.2)
    assert volts[:, 2].mean() == pytest.approx(2.5, abs=0.1)


def test_a_bench_file_sets_the_hand_and_the_sensor() -> None:
    rest, held = handheld({"preset": "ideal", "hand": {"slips": 0.5}, "triad": {"x": {"zero_v": 1.2}}})
    assert rest == {"preset": "ideal"}
    assert held is not None
    assert (held.hand.slips, held.triad.x.zero_v) == (0.5, 1.2)
    assert handheld({"preset": "ideal"})[1] is None
    with pytest.raises(UnknownSetting, match="tremor"):
        handheld({"hand": {"tremour_g": 1}})
    with pytest.raises(BadSetting, match="defaults"):
        handheld({"hand": 3})


TREMBLING = Hand(slips=0.5, errs=0.0, clings=0.0, patience_s=3.0)


def test_the_rates_of_a_trembling_hand_lead_from_attitude_to_attitude() -> None:
    """Integrated in steps of 1 ms, turn by turn."""
    hand = script(TREMBLING, 2)
    times_s = np.arange(0.0, 24.0, 1e-3)
    parts = []
    attitudes = (EDGE, [0.0, 1.0, 0.0]), ([0.0, -1.0, 0.0], [1.0, 0.0, 0.0]), ([0.0, 0.0, 1.0], None)
    for k, (up, north) in enumerate(attitudes):
        hand.turn_to(np.array(up), 8.0 * k, None if north is None else np.array(north))
        parts.append(hand.motion(times_s[8000 * k : 8000 * (k + 1)]))
    moved = np.concatenate([part.attitude for part in parts])
    rates_rad_s = np.radians(np.concatenate([part.rate_deg_s for part in parts]))
    assert np.degrees(np.linalg.norm(rates_rad_s, axis=1).max()) > 90
    attitude = moved[0]
    for turned in rotations(-(rates_rad_s[1:] + rates_rad_s[:-1]) / 2 * 1e-3):
        attitude = turned @ attitude
    assert attitude == pytest.approx(moved[-1], abs=2e-4)


def test_it_points_the_wanted_side_to_the_north() -> None:
    hand = script(replace(CALM, heading_deg=0.0))
    hand.turn_to(np.array([1.0, 0.0, 0.0]), 0.0, np.array([0.0, 0.0, 1.0]))
    attitude = hand.motion(np.array([8.0])).attitude[0]
    assert attitude[:, 0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)
    assert attitude[:, 2] == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    assert attitude.T @ attitude == pytest.approx(np.eye(3))
    assert np.linalg.det(attitude) == pytest.approx(1.0)


def units(world: HandheldWorld, names: Sequence[str], start_s: float, n: int = 400) -> np.ndarray:
    return world.sensed(names, start_s, 0.005, n)


def test_a_magnetometer_senses_the_field_of_the_place_and_a_gyroscope_the_earth() -> None:
    place = {"field_ut": 50.0, "dip_deg": 60.0, "declination_deg": 0.0}
    config = WorldConfig.from_mapping({"preset": "ideal", "laboratory": place})
    world = HandheldWorld(config, 3, Handheld(hand=CALM))
    field = units(world, FIELDS, 0.0, 4000).mean(axis=0)
    assert field == pytest.approx([25.0, 0.0, -25.0 * np.sqrt(3)], abs=0.02)  # x to the north, z upward
    rate = units(world, RATES, 25.0, 40_000).mean(axis=0)
    latitude = np.radians(config.laboratory.latitude_deg)
    assert rate == pytest.approx(np.array([np.cos(latitude), 0, np.sin(latitude)]) * 360 / 86164, abs=5e-3)


def test_a_magnet_in_the_table_changes_the_field_from_place_to_place() -> None:
    magnet = {"x_mm": 0.0, "z_mm": -80.0, "moment_z_ma_m2": 20.0}
    sizes = {}
    for name, laboratory in {"clean": {}, "magnet": {"magnet": magnet}}.items():
        config = WorldConfig.from_mapping({"preset": "ideal", "laboratory": laboratory})
        world = HandheldWorld(config, 3, Handheld(hand=CALM))
        means = []
        for k, side in enumerate(np.vstack([np.eye(3), -np.eye(3)])):
            world.turn_by_hand(side, np.roll(side, 1))
            units(world, FIELDS, 8.0 * k, 1400)
            means.append(units(world, FIELDS, 8.0 * k + 7.0, 100).mean(axis=0))
        sizes[name] = np.linalg.norm(means, axis=1)
    assert np.ptp(sizes["clean"]) < 0.1
    assert np.ptp(sizes["magnet"]) > 1.0


def test_all_sensors_of_a_hand_continue_from_a_kept_state() -> None:
    one, other = (HandheldWorld(WorldConfig.ideal(), 3, Handheld()) for _ in range(2))
    one.turn_by_hand((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    units(one, INPUTS, 0.0)
    kept = json.loads(json.dumps(one.state()))
    expected = units(one, INPUTS, 2.0, 4000)
    other.restore(kept)
    assert np.array_equal(units(other, INPUTS, 2.0, 4000), expected)
