"""The session: what is missing, how a pose is approached, which temperature stops it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.recorder import Samples
from procedures.errors import Declined, SafetyLimit
from procedures.questions import Question
from procedures.session import Dwell, Limits, Pose, Reading, Session
from procedures.sweep import grid

POSES = st.builds(Pose, st.sampled_from([30.0, 90.0]), st.sampled_from([0.0, 10.0]), st.sampled_from([-1, 1]))


@dataclass
class Stage:
    """Stands where it was told, a little beside; remembers its way."""

    off_deg: float = 0.0
    way: list[float] = field(default_factory=list)
    homed: bool = True

    def move_to(self, deg: float) -> None:
        self.way.append(deg)

    def angle_deg(self) -> float:
        return (self.way[-1] if self.way else 0.0) + self.off_deg

    def home(self) -> None:
        self.homed = True

    def referenced(self) -> bool:
        return self.homed

    def stop(self) -> None: ...


@dataclass
class Book:
    """A host that remembers."""

    held: list[Pose] = field(default_factory=list)
    warm_c: list[float | None] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    read: list[Reading] = field(default_factory=list)
    answers: dict[str, str] = field(default_factory=dict)

    def kept(self) -> Sequence[Pose]:
        return self.held

    def expect(self, missing: int) -> None:
        self.said.append(f"{missing} missing")

    def keep(self, pose: Pose, samples: Samples, temperature_c: float | None) -> None:
        self.held.append(pose)
        self.warm_c.append(temperature_c)

    def measured(self) -> Sequence[Dwell]:
        return ()

    def readings(self) -> Sequence[Reading]:
        return self.read

    def keep_readings(self, *readings: Reading) -> None:
        self.read.extend(readings)

    def ask(self, question: Question) -> str:
        self.said.append(question.text)
        return question.checked(self.answers[question.name])

    def guide(self, guidance: object) -> None: ...

    def doing(self, text: str) -> None:
        self.said.append(text)


def session(book: Book | None = None, beta: Stage | None = None, alpha: Stage | None = None) -> Session:
    nothing: Any = None
    parts: dict[str, Any] = {"adc": nothing, "oven": nothing, "level": nothing, "positioner": nothing, "clock": nothing}
    return Session(alpha or Stage(), beta or Stage(), host=book or Book(), limits=Limits((10.0, 40.0), 5.0), **parts)


@given(st.lists(POSES, max_size=12), st.integers(0, 12))
def test_the_missing_poses_are_those_that_are_not_in_the_record(poses: list[Pose], held: int) -> None:
    book = Book(held=poses[:held])
    for pose in session(book).missing(poses):
        book.held.append(pose)
    assert sorted(book.held, key=str) == sorted(poses, key=str)
    assert book.said == [f"{max(0, len(poses) - held)} missing"]


@pytest.mark.parametrize("off_deg", [0.0, 0.04, -0.04])
def test_every_pose_is_approached_from_its_side(off_deg: float) -> None:
    beta = Stage(off_deg)
    rig = session(beta=beta)
    for pose in grid((90.0, 30.0), 10.0, "ang"):
        rig.move_to(pose)
        before = beta.way[-2] if len(beta.way) > 1 else 0.0
        assert (pose.beta_deg - before) * pose.direction > 1
        assert beta.way[-1] == pose.beta_deg


def test_only_a_turn_of_direction_needs_a_detour() -> None:
    beta = Stage()
    rig = session(beta=beta)
    for pose in grid((90.0,), 90.0):
        rig.move_to(pose)
    assert beta.way == [-5, 0, 90, 180, 270, 360, 365, 360, 270, 180, 90, 0]


def test_a_pose_without_direction_is_approached_straight() -> None:
    beta = Stage()
    session(beta=beta).move_to(Pose(90, 0))
    assert beta.way == [0]


def samples_at(reported_c: float | None) -> Samples:
    """A sample of a sensor that reports this temperature."""
    return Samples(np.zeros((1, 1)), ("ax",), 100.0, 0.0, reported_c)


@pytest.mark.parametrize("temperature", [9.9, 40.1, float("nan"), float("inf")])
@pytest.mark.parametrize("reports", [True, False])
def test_a_temperature_outside_the_limits_stops(temperature: float, reports: bool) -> None:
    book, samples = Book(), samples_at(temperature if reports else None)
    with pytest.raises(SafetyLimit, match="outside the limits of 10 to 40 C"):
        session(book).keep(Pose(90, 0), samples=samples, temperature_c=25.0 if reports else temperature)
    assert not book.held


@pytest.mark.parametrize("temperature", [10.0, 40.0, None])
def test_a_temperature_within_the_limits_or_unknown_is_kept(temperature: float | None) -> None:
    book = Book()
    session(book).keep(Pose(90, 0), samples=samples_at(None), temperature_c=temperature)
    assert book.held == [Pose(90, 0)]
    assert book.warm_c == [temperature]


@pytest.mark.parametrize("beside_c", [25.0, None])
def test_the_temperature_that_the_sensor_reports_is_that_of_the_pose(beside_c: float | None) -> None:
    book = Book()
    session(book).keep(Pose(90, 0), samples=samples_at(31.5), temperature_c=beside_c)
    assert book.warm_c == [31.5]


def test_only_a_stage_that_does_not_know_its_zero_is_homed() -> None:
    book, lost = Book(), Stage(homed=False)
    session(book, beta=lost).reference()
    assert lost.homed
    assert book.said == ["homing beta"]


def test_a_confirmed_question_lets_the_procedure_continue() -> None:
    book = Book(answers={"mounting": "yes"})
    session(book).confirm("mounting", "Is it mounted?")
    assert book.said == ["Is it mounted?"]


def test_a_declined_question_stops_the_procedure() -> None:
    with pytest.raises(Declined, match='mounting: the answer to "Is it mounted\\?" is no'):
        session(Book(answers={"mounting": "no"})).confirm("mounting", "Is it mounted?")


def test_a_typed_number_is_a_number() -> None:
    assert session(Book(answers={"level-x": "-0,25 deg"})).number("level-x", "What?", "deg", -45, 45) == -0.25


def test_a_reading_is_found_by_its_name() -> None:
    rig = session()
    rig.keep_readings(Reading("level-x", 0.02, "deg", 0.001))
    assert (rig.reading("level-x"), rig.reading("level-y")) == (0.02, None)
