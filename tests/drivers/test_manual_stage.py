"""A stage that a person turns: what they are asked, what they may answer, and how well a simulated hand does it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from drivers.clock import SimulatedClock
from drivers.errors import LimitError, LinkRefused, NotSettled
from drivers.manual_stage.driver import ManualStage, Settings, connect
from drivers.manual_stage.twin import Hand
from drivers.transport import Address, Links
from drivers.world.stage import Trajectory

MARK_DEG = 5 / 60


@dataclass
class Person:
    """Reads what `dial` says; remembers what they were asked."""

    dial: Callable[[float | None], float]
    asked: list[tuple[str, str, float, float]] = field(default_factory=list)

    def ask(self, name: str, text: str, unit: str, low: float, high: float, expected: float | None = None) -> float:
        assert unit == "deg"
        self.asked.append((name, text, low, high))
        return self.dial(expected)


def stage(person: Person | None, **settings: float) -> ManualStage:
    links = Links(SimulatedClock())
    links.person.attended_by = person
    return connect(Address("person"), links, Settings(**settings), "alpha")


def test_it_stands_where_the_dial_was_read() -> None:
    person = Person(lambda expected: (expected or 0) + MARK_DEG)
    alpha = stage(person)
    alpha.move_to(90.0)
    assert alpha.angle_deg() == alpha.read_deg == 90 + MARK_DEG
    assert person.asked == [("alpha-90", "Turn alpha to 90 deg. What does its dial show?", 89.5, 90.5)]


def test_nobody_is_asked_for_what_was_set_before() -> None:
    person = Person(lambda expected: (expected or 0) + MARK_DEG)
    alpha = stage(person)
    for angle_deg in (90.0, 90.0, 30.0, 90.0):
        alpha.move_to(angle_deg)
    assert [name for name, *_ in person.asked] == ["alpha-90", "alpha-30", "alpha-90"]


def test_a_dial_that_nobody_has_read_yet_is_read_once() -> None:
    person = Person(lambda expected: 12.5)
    alpha = stage(person)
    assert alpha.angle_deg() == alpha.angle_deg() == 12.5
    assert [(name, low, high) for name, _, low, high in person.asked] == [("alpha-dial", -400, 400)]
    assert alpha.referenced()


def test_a_reading_elsewhere_is_no_arrival_and_leaves_the_stage_unknown() -> None:
    answers = iter([30.0, 9.0, 90.0])
    person = Person(lambda expected: next(answers))
    alpha = stage(person)
    alpha.move_to(30.0)
    with pytest.raises(NotSettled, match=r"alpha: the dial shows 9 deg, but 90 deg was requested"):
        alpha.move_to(90.0)
    assert alpha.read_deg is None
    alpha.move_to(90.0)  # the same again is asked again
    assert alpha.read_deg == 90.0


def test_beyond_its_limits_nobody_is_asked() -> None:
    person = Person(lambda expected: 0.0)
    for angle_deg in (401.0, float("nan")):
        with pytest.raises(LimitError, match="no request was made"):
            stage(person).move_to(angle_deg)
    assert not person.asked


def test_where_nobody_stands_at_the_rig_it_says_so() -> None:
    with pytest.raises(LinkRefused, match="no person is at the rig"):
        stage(None).move_to(1.0)
    with pytest.raises(LinkRefused, match="Write `url: person`"):
        connect(Address("tcp://127.0.0.1:1"), Links(SimulatedClock()), Settings(), "alpha")


class World:
    """A stage whose motor obeys at once."""

    def __init__(self) -> None:
        self.now_s, self.at_deg = 0.0, 7.0

    def motor_angle_deg(self, axis: str) -> float:
        return self.at_deg

    def move_stage(self, axis: str, trajectory: Trajectory) -> None:
        self.now_s, self.at_deg = trajectory.end_s, trajectory.target_deg


def test_a_simulated_hand_sets_within_half_a_mark_and_reads_whole_marks() -> None:
    world, missed, read = World(), [], []
    hand = Hand(world, "alpha", Settings(), seed=1)
    for k in range(400):
        angle_deg = 30.0 * (k % 7 - 3)
        assert hand.turn_to(angle_deg) is not None
        missed.append(world.at_deg - angle_deg)
        read.append(hand.read_deg() - world.at_deg)
        assert round(hand.read_deg() / MARK_DEG, 9) % 1 == 0
    assert 0.2 * MARK_DEG < np.std(missed) < 0.3 * MARK_DEG
    assert np.abs(missed).max() < MARK_DEG / 2
    assert np.std(read) == pytest.approx(MARK_DEG / np.sqrt(12), rel=0.15)  # what the analysis takes it for


def test_a_simulated_hand_leaves_alone_what_is_set_and_reads_it_alike() -> None:
    world = World()
    hand = Hand(world, "alpha", Settings(), seed=1)
    hand.turn_to(90.0)
    first = hand.read_deg()
    world.now_s += 100
    assert hand.turn_to(90.0) is None
    assert hand.read_deg() == first
    assert [Hand(World(), "alpha", Settings(), seed).turn_to(5.0) for seed in (1, 2)] != 2 * [None]
