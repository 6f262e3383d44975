"""Positions at rest of a sensor in a hand: the part that all procedures by hand have in common.

The noise at rest is measured first. Then the program shows which attitude it needs, detects when the sensor is at rest
in a new one, records the position, and ends when the uncertainties are small enough.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from drivers.recorder import Samples, join_samples
from procedures.bounds import require_possible
from procedures.errors import NoAnswer, SettingError
from procedures.session import Dwell, Guidance, HandAnalysis, HandCourse, NoiseAtRest, Pose, Session

WINDOW_S = 0.5  # of a test of rest
NOISE_WINDOWS = 20  # windows of rest that show the noise
LONGEST_WAIT_S = 86_400.0
FEWEST = 12  # positions: nine parameters, and three that check them
SIDES = 6  # the first positions
TRIES = 2  # rests at known positions before another orientation is requested
FLAT = (0.0, 0.0, 1.0)


class HandStep(Enum):
    """What the program waits for while a person moves the sensor."""

    MOVING = auto()  # the end of the motion
    AT_REST = auto()  # enough samples at rest
    KNOWN = auto()  # another position: the present one is measured already


Course = Callable[[Sequence[Dwell], NoiseAtRest, Sequence[str]], HandCourse]


@dataclass(frozen=True)
class Goal:
    """When the positions suffice. `target` is a share of the full scale, which is shown times `shown` in `unit`.

    Raises SettingError for settings that no run can have.
    """

    procedure: str
    setting: str
    target: float
    shown: float
    unit: str
    rest_s: float
    most_positions: int
    wait_s: float

    def __post_init__(self) -> None:
        if (
            self.target <= 0
            or not 0 < self.wait_s <= LONGEST_WAIT_S
            or self.rest_s < 2 * WINDOW_S
            or self.most_positions < FEWEST
        ):
            raise SettingError(
                f"{self.procedure}: {self.setting} and wait_s must be above 0, wait_s at most {LONGEST_WAIT_S:g}, "
                f"rest_s at least {2 * WINDOW_S:g}, most_positions at least {FEWEST}"
            )
        require_possible(self.most_positions, "a smaller most_positions")

    def is_reached(self, course: HandCourse) -> bool:
        """Whether the positions suffice, or are as many as allowed."""
        return course.count >= self.most_positions or course.uncertainty[0] <= self.target

    def progress(self, course: HandCourse) -> str:
        """The uncertainty so far, in words; "" before it is known."""
        worst, parameter = course.uncertainty
        if not parameter:
            return ""
        reached, target = f"{self.shown * worst:.2g} {self.unit}", f"{self.shown * self.target:g} {self.unit}"
        return "; ".join(filter(None, (f"{parameter}: standard uncertainty {reached}, target {target}", course.doubt)))


def outputs_of(samples: Samples, names: Sequence[str]) -> NDArray[np.float64]:
    """The samples of these outputs, in this order, shape (n, names)."""
    return samples.volts[:, [list(samples.channels).index(name) for name in names]]


def require_analysis(rig: Session, procedure: str) -> HandAnalysis:
    """The analysis by hand. Raises SettingError for a session without it."""
    if rig.by_hand is None:
        raise SettingError(f"{procedure}: this session has no analysis of positions; run it with `rig run`")
    return rig.by_hand


def take_positions(rig: Session, outputs: Sequence[str], question: str, course_of: Course, goal: Goal) -> None:
    """Take positions of the sensor with these outputs until the goal is reached. Raises Declined, NoAnswer."""
    analysis = require_analysis(rig, goal.procedure)
    rig = replace(rig, adc=rig.adc.only(*outputs))
    rig.confirm("at-rest", question)
    (noise,) = learn_noise(rig, analysis, goal.wait_s, outputs)
    skipped: list[str] = []
    while not goal.is_reached(course := course_of(rig.measured(), noise, skipped)):
        rig.host.expect(max(1, FEWEST - course.count))
        rig.host.guide(guidance(course, goal))
        next_rest = _find_next_rest(rig, analysis, course, noise, goal)
        if next_rest is None:
            skipped.append(course.words)
            continue
        if course.count >= SIDES:  # the directions are known, so no position has a wrong name any more
            skipped.clear()
        rig.keep(Pose(0.0, 0.0, path=course.words), samples=next_rest, temperature_c=rig.oven.temperature_c())
    rig.host.guide(guidance(course, goal, is_complete=True))


def guidance(course: HandCourse, goal: Goal, *, is_complete: bool = False, remark: str = "") -> Guidance:
    """The next action of the person, in words, and the drawing; `remark` is on the last one."""
    progress = "; ".join(filter(None, (remark, goal.progress(course))))
    if is_complete:
        text = f"{course.count} positions taken; {progress}"
    else:
        turn = f" ({course.turn})" if course.turn else ""
        text = "; ".join(filter(None, (f"position {course.count + 1}: {course.words}{turn}, then let go", progress)))
    taken = tuple(tuple(map(float, direction)) for direction in course.directions)
    return Guidance(text, course.up, taken, not is_complete, course.north, course.wanted if course.north else ())


def learn_noise(rig: Session, analysis: HandAnalysis, wait_s: float, *triads: Sequence[str]) -> list[NoiseAtRest]:
    """The noise of each triad of outputs at rest, from the first stretch of windows that are alike. Raises NoAnswer."""
    rig.host.guide(
        Guidance("leave the sensor on the table for 10 s: the program measures its noise", FLAT, moves=False)
    )
    windows: list[Samples] = []
    for _ in range(max(2 * NOISE_WINDOWS, round(wait_s / WINDOW_S))):
        windows = [*windows, rig.adc.acquire(WINDOW_S)][-NOISE_WINDOWS:]
        learned = [analysis.learn([outputs_of(w, t) for w in windows], windows[-1].rate_hz) for t in triads]
        if all(noise is not None for noise in learned):
            return [noise for noise in learned if noise is not None]
    raise NoAnswer(
        f"the sensor was not at rest for {NOISE_WINDOWS * WINDOW_S:g} s within {wait_s:g} s; "
        "put it on a firm table away from motors, let it go, and resume the run"
    )


def _find_next_rest(
    rig: Session, analysis: HandAnalysis, course: HandCourse, noise: NoiseAtRest, goal: Goal
) -> Samples | None:
    """The next rest at a new position. The first window of a rest is left out: the hand has just let go.

    None after TRIES rests at known positions: an earlier position was not the requested one, but is the one that is
    requested now. Raises NoAnswer after `wait_s` without one.
    """
    windows: list[Samples] = []
    doing, refusals = PresentStep(rig), 0
    for _ in range(round(goal.wait_s / WINDOW_S)):
        windows.append(rig.adc.acquire(WINDOW_S))
        stillness = analysis.judge([w.volts for w in windows], noise)
        if not stillness.still:
            doing.say(
                HandStep.MOVING,
                f"{course.words}: the sensor moves ({stillness.noise:.2g} times the noise at rest, by {stillness.by})",
            )
            windows = windows[1:] if stillness.by == "creep" else []
            if refusals >= TRIES:
                return None
        elif len(windows) * WINDOW_S <= goal.rest_s:
            doing.say(HandStep.AT_REST, f"{course.words}: at rest, wait")
        elif course.is_new((candidate := join_samples(windows[1:])).volts.mean(axis=0)):
            return candidate
        else:
            refusals += doing.step is not HandStep.KNOWN
            doing.say(HandStep.KNOWN, f"this position is measured already; next: {course.words}")
            windows = windows[1:]
    raise NoAnswer(
        f"no new position for {goal.wait_s:g} s; next: {course.words}; {doing.text}; resume the run to continue"
    )


@dataclass
class PresentStep:
    """The present step and its last text; the first text of each step is shown."""

    rig: Session
    step: HandStep | None = None
    text: str = ""

    def say(self, step: HandStep, text: str) -> None:
        if step is not self.step:
            self.rig.host.doing(text)
        self.step, self.text = step, text
