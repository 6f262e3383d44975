"""hand-turns on a simulated hand, without sockets."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from calibrations.geometry.turns import make_turns
from calibrations.table import Table
from drivers.handheld.hand import Hand
from drivers.recorder import Samples
from procedures.hand_turns import TURN, hand_turns
from rig.record.measured import turns_table
from rig.record.turns import is_turn, turn_columns
from rig.record.values import Run
from tests.handling import CALM, SlowAdc, hand_session, turn_errors, turn_world, turns_by_procedure
from tests.procedures.bench import Book

FEWEST = 12


@pytest.fixture(scope="module")
def calm() -> Book:
    rig, book = hand_session(turn_world(1, CALM))
    hand_turns(rig)
    return book


def table(book: Book) -> Table:
    return Table.from_columns("turns", turn_columns(book.blocks, 2.0), {}, "a hand")


def test_a_calm_hand_needs_no_more_rests_than_the_accelerometer_does(calm: Book) -> None:
    rests = [block for block in calm.blocks if not is_turn(block.pose)]
    assert len(rests) == FEWEST
    assert len(calm.blocks) == 2 * FEWEST - 1  # a turn before each rest but the first
    assert calm.asked == ["at-rest"]
    assert calm.world.now_s < 150
    assert "target 0.2 %" in calm.guided[-1].text


def test_the_first_guidance_asks_for_a_rest(calm: Book) -> None:
    positions = [guidance.text for guidance in calm.guided if guidance.text.startswith("position ")]
    assert positions[0].endswith("; keep the sensor still until this position is taken")
    assert not any("keep the sensor still" in text for text in positions[1:])


def test_a_turn_goes_from_rest_to_rest_without_a_gap(calm: Book) -> None:
    for turn, rest in zip(calm.blocks[1::2], calm.blocks[2::2], strict=True):
        assert turn.pose.path == TURN + rest.pose.path
        end_s = turn.samples.start_s + len(turn.samples.volts) / turn.samples.rate_hz
        assert rest.samples.start_s == pytest.approx(end_s, abs=1e-6)
        at_rest = [turn.samples.volts[:400, 3:], rest.samples.volts[:, 3:]]
        assert max(part.std(axis=0).max() for part in at_rest) < 1.2 * 1.5e-3
    assert min(np.ptp(turn.samples.volts[:, 3:], axis=0).max() for turn in calm.blocks[1::2]) > 0.2  # 33 deg/s


def test_the_errors_are_those_that_the_fit_states(calm: Book) -> None:
    errors = turn_errors(calm.world, calm)
    assert errors.worst < 2e-3
    assert np.abs(errors.bias_deg_s).max() < 0.015
    assert np.sqrt(np.mean(errors.normalised**2)) < 2


def test_each_turn_is_a_row_with_its_axis(calm: Book) -> None:
    turns = make_turns(table(calm))
    assert turns.n == FEWEST - 1
    assert turns.numbers is not None
    assert list(turns.numbers) == list(range(1, 2 * FEWEST - 1, 2))
    angle_deg = turns.column("rate_deg_s") * turns.duration_s
    between_deg = np.degrees(np.arccos(np.sum(turns.before * turns.after, axis=1)))
    assert angle_deg == pytest.approx(between_deg, abs=3)  # without a wanted north the hand takes the shortest way


def test_the_table_of_a_run_has_the_constants_that_turns_need(calm: Book) -> None:
    constants = {"latitude_deg": 40.4, "filter_corner_hz": 15.07, "approach_deg": 5.0}
    run = Run("a", "turns", "hand-turns", "complete", {"rest_s": 2.0}, {}, {}, "", constants, "", "", None, None, {}, 0)
    assert turns_table(run, calm.blocks).constants.keys() == {"latitude_deg", "unit", "sample_rate_hz"}


def test_an_interrupted_run_continues_with_its_turns(calm: Book) -> None:
    """It ended after a turn and before the rest: the turn does not count, and the next rest begins anew."""
    rig, book = hand_session(turn_world(1, CALM))
    book.blocks, book.dwells = list(calm.blocks[:14]), list(calm.dwells[:14])
    assert is_turn(book.blocks[-1].pose)
    hand_turns(rig)
    assert book.blocks[13] is calm.blocks[13]
    assert not is_turn(book.blocks[14].pose)
    used = set(table(book).column("turn"))
    assert 13.0 not in used
    assert len(used) >= FEWEST - 2
    assert turn_errors(book.world, book).worst < 2e-3


@dataclass
class FaultyAdc(SlowAdc):
    """In the third turn `spoil` changes the windows."""

    spoil: Callable[[Any], Any] = lambda block: block

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        turns, was_turning = 0, False
        for window in super().stream(duration_s, block_s):
            is_turning = bool(np.ptp(window.volts[:, 3:], axis=0).max() > 0.15)
            turns += is_turning and not was_turning
            was_turning = is_turning
            yield self.spoil(window) if is_turning and turns == 3 else window


def saturate(block: Samples) -> Samples:
    volts = block.volts.copy()
    volts[:, 3:] = np.clip(volts[:, 3:], 2.4, 2.6)  # 17 deg/s each way
    return replace(block, volts=volts)


FAULTS = {
    "samples were lost during the turn": lambda block: replace(block, lost=3),
    "reached the end of its range, turn more slowly": saturate,
}


@pytest.mark.parametrize("fault", list(FAULTS))
def test_an_unusable_turn_is_recorded_with_the_reason(fault: str) -> None:
    rig, book = hand_session(turn_world(1, CALM))
    adc = FaultyAdc(book.world, channels=("vx", "vy"))
    adc.spoil = FAULTS[fault]
    hand_turns(replace(rig, adc=adc))
    spoilt = [block for block in book.blocks if fault in block.pose.path]
    assert spoilt
    assert any(fault in guidance.text for guidance in book.guided)
    assert not {float(block.number) for block in spoilt} & set(table(book).column("turn"))
    assert turn_errors(book.world, book).worst < 2e-3


def test_a_smaller_target_takes_more_turns() -> None:
    rig, book = hand_session(turn_world(1, CALM))
    hand_turns(rig, target_percent=1e-6, most_positions=13)
    assert sum(not is_turn(block.pose) for block in book.blocks) == 13


@pytest.mark.slow
def test_a_clumsy_hand_is_not_worse() -> None:
    clumsy = Hand(slips=0.3, errs=0.15, clings=0.3, patience_s=5.0, table_deg=5.0, tremor_deg=0.8)
    assert turns_by_procedure(4, clumsy).worst < 3e-3


@pytest.mark.release
def test_ten_hands_reach_the_target() -> None:
    found = [turns_by_procedure(seed) for seed in range(1, 11)]
    assert max(errors.worst for errors in found) < 4e-3
    assert max(errors.positions for errors in found) <= FEWEST + 4
    normalised = np.concatenate([errors.normalised for errors in found])
    assert 0.7 < np.sqrt(np.mean(normalised**2)) < 1.5
