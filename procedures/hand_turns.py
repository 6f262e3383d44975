"""hand-turns: a person turns a gyroscope with an accelerometer from rest to rest; no stage.

Excites   gyroscope: bias, scale factor, misalignment to the axes of the accelerometer; sensitivity to specific force.
Blind to  the part of a turn about the vertical; bandwidth. The earth's rotation is in the bias.
Source    Tedaldi, Pretto and Menegatti, ICRA 2014: the rates between two rests must turn gravity as it was measured.

The program records all the time. It sees when the sensor is at rest, and says which orientation it needs next. Each
rest is a pose, and so is each turn before it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace

from drivers.errors import NotWired
from drivers.recorder import Samples, join_samples
from procedures.at_rest import (
    FEWEST,
    WINDOW_S,
    Goal,
    HandStep,
    PresentStep,
    guidance,
    learn_noise,
    outputs_of,
    require_analysis,
)
from procedures.errors import NoAnswer
from procedures.instruments import Adc
from procedures.session import HandAnalysis, HandCourse, NoiseAtRest, Pose, Session

KIND = "turns"
ADAPTIVE = True
FORCES, RATES = ("ax", "ay", "az"), ("gx", "gy", "gz")
TURN = "turn to "  # the path of a turn begins so; that of one that is not used has a reason before it
STILL_FIRST = "keep the sensor still until this position is taken"
WITHOUT_ACCELEROMETER = (
    "For a gyroscope without an accelerometer, log whole turns on the table, and import the log with `rig import LOG "
    "--kind rates --constant turn_deg=360`"
)
TABLE = "Does the sensor lie on a table, and is its cable long enough to turn it upside down? Let it go."


def hand_turns(
    rig: Session,
    *,
    target_percent: float = 0.2,
    rest_s: float = 2.0,
    most_positions: int = 40,
    wait_s: float = 120.0,
) -> None:
    """Take rests and the turns between them until scale factors and misalignment are known well enough.

    target_percent  The standard uncertainty to reach: 0.2 is 0.2 % of a scale factor, 0.11 deg of misalignment.
    rest_s          How long the sensor must rest before and after each turn.
    most_positions  The run ends after this number of rests, also if the uncertainty is not reached.
    wait_s          The run stops after this time without a new rest.
    """
    goal = Goal("hand-turns", "target_percent", target_percent / 100, 100, "%", rest_s, most_positions, wait_s)
    analysis = require_analysis(rig, goal.procedure)
    rig = replace(rig, adc=_only_both_triads(rig))
    rig.confirm("at-rest", TABLE)
    noises = learn_noise(rig, analysis, wait_s, FORCES, RATES)
    with closing(rig.adc.stream(most_positions * wait_s, WINDOW_S)) as stream:
        watch = Watch(rig, analysis, noises, goal, stream)
        while not goal.is_reached(course := analysis.turn_course(rig.recorded(), noises[0], rest_s)):
            rig.host.expect(max(1, FEWEST - course.count))
            rig.host.guide(guidance(course, goal, remark=watch.remark))
            watch.next_rest(course)
            watch.keep(course.words)
    rig.host.guide(guidance(course, goal, is_complete=True))


def _only_both_triads(rig: Session) -> Adc:
    """The converter with the outputs of both sensors. Raises NotWired, with what to do without an accelerometer."""
    try:
        return rig.adc.only(*FORCES, *RATES)
    except NotWired as error:
        remedies = [error.remedy, *([WITHOUT_ACCELEROMETER] if "ax" in error.what.partition(";")[0] else [])]
        raise NotWired(error.what, ". ".join(remedies)) from None


@dataclass
class Watch:
    """The record in progress: windows of the rest `before`, of the `turn` since then, and of the present rest.

    The first window of a rest belongs to the turn: the hand has just let go. `remark`: why the last turn is not used;
    before the first rest, that the sensor stays still, because a turn begins with a rest.
    """

    rig: Session
    analysis: HandAnalysis
    noises: Sequence[NoiseAtRest]
    goal: Goal
    stream: Iterator[Samples]
    before: list[Samples] = field(default_factory=list)
    turn: list[Samples] = field(default_factory=list)
    rest: list[Samples] = field(default_factory=list)
    remark: str = STILL_FIRST

    @property
    def _count(self) -> int:
        """Windows of a rest."""
        return round(self.goal.rest_s / WINDOW_S)

    def next_rest(self, course: HandCourse) -> None:
        """Wait until the sensor is at rest after a turn. Raises NoAnswer after `wait_s` without one."""
        doing = PresentStep(self.rig)
        for _ in range(round(self.goal.wait_s / WINDOW_S)):
            if (motion := self._take(next(self.stream))) is not None:
                doing.say(HandStep.MOVING, f"{course.words}: the sensor moves ({motion})")
            elif len(self.rest) <= self._count:
                doing.say(HandStep.AT_REST, f"{course.words}: at rest, wait")
            elif course.is_new(outputs_of(join_samples(self.rest[1:]), FORCES).mean(axis=0)):
                return
            else:
                doing.say(HandStep.KNOWN, f"the sensor has the same orientation as before; next: {course.words}")
        raise NoAnswer(
            f"no new position for {self.goal.wait_s:g} s; next: {course.words}; {doing.text}; "
            "resume the run to continue"
        )

    def keep(self, words: str) -> None:
        """Store the turn, if its rest before is known, and the present rest."""
        temperature_c = self.rig.oven.temperature_c()
        self.remark = ""
        if self.before:
            turned = join_samples([*self.before, *self.turn, *self.rest[:1]])
            self.remark = self._fault(turned)
            path = f"{self.remark}: {TURN}{words}" if self.remark else f"{TURN}{words}"
            self.rig.keep(Pose(0.0, 0.0, path=path), samples=turned, temperature_c=temperature_c)
        self.rig.keep(Pose(0.0, 0.0, path=words), samples=join_samples(self.rest[1:]), temperature_c=temperature_c)

    def _take(self, window: Samples) -> str | None:
        """Add a window; None if it is at rest, else by how much it is not, in words."""
        rest = [*self.rest, window]
        parts = zip((FORCES, RATES), self.noises, strict=True)
        recent = rest[-self._count - 1 :]
        tests = [self.analysis.judge([outputs_of(w, names) for w in recent], noise) for names, noise in parts]
        moving = next((test for test in tests if not test.still), None)
        if moving is None:
            self.rest = rest
            return None
        if len(self.rest) > self._count:
            self.before, self.turn = self.rest[-self._count :], [window]
        else:
            self.turn += [*self.rest, window]
        self.rest = []
        return f"{moving.noise:.2g} times the noise at rest, by {moving.by}"

    def _fault(self, turned: Samples) -> str:
        """Why this turn cannot be used, in words; empty if it can."""
        if turned.lost:
            return f"{turned.lost} samples were lost during the turn"
        at_rest = outputs_of(join_samples(self.before), RATES)
        moving = outputs_of(join_samples(self.turn), RATES)
        if (output := self.analysis.clipped(moving, at_rest)) is not None:
            return f"{RATES[output]} reached the end of its range, turn more slowly"
        return ""
