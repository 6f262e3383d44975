"""The simulated hand and its sensor."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from drivers.handheld.hand import Hand, Script
from drivers.handheld.triad import Mass, Triad, individual, steady_v
from drivers.handheld.world import INPUTS, Handheld, HandheldWorld, handheld
from drivers.world.config import WorldConfig
from drivers.world.errors import BadSetting, UnknownSetting

CALM = Hand(slips=0.0, errs=0.0, clings=0.0, aim_deg=0.0, side_deg=0.0, table_deg=0.0)
EDGE = np.array([1.0, 0.0, 1.0]) / np.sqrt(2)
TIMES_S = np.arange(0.0, 12.0, 0.01)


def script(hand: Hand = CALM, seed: int = 1) -> Script:
    return Script(hand, np.random.default_rng(seed), np.array([0.0, 0.0, 1.0]))


def test_it_lies_still_until_it_is_told_to_turn() -> None:
    hand = script()
    assert hand.force_g(TIMES_S) == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(TIMES_S), 1)))


def test_it_turns_the_sensor_trembling_and_then_lets_go() -> None:
    hand = script()
    hand.turn_to(EDGE, 0.0)
    force = hand.force_g(TIMES_S[:700])
    assert force[:70].std(axis=0).max() < 1e-9  # the reaction
    assert np.linalg.norm(force[120:180], axis=1).std() > 0.01  # turning
    assert force[-100:] == pytest.approx(np.tile(EDGE, (100, 1)), abs=1e-6)


def test_an_impatient_hand_tries_again_without_being_told() -> None:
    hand = script(replace(CALM, patience_s=2.0))
    hand.turn_to(EDGE, 0.0)
    moving = np.linalg.norm(np.diff(hand.force_g(np.arange(0.0, 60.0, 0.01)), axis=0), axis=1) > 1e-3
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
    return world.adc_volts(INPUTS, start_s, 0.005, n)


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
