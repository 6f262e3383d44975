"""hand-positions: a person turns an accelerometer from rest to rest; no stage.

Excites   bias, scale factor and nonorthogonality of three axes; nonlinearity, from more positions than these need.
Blind to  misalignment to the case, because the orientations are not known; hysteresis; warm-up, in so short a time.
Source    Tedaldi, Pretto and Menegatti, ICRA 2014; Skog et al. (2010), detectors of zero velocity.

The program sees when the sensor is at rest, takes the position, and says which orientation it needs next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from procedures.errors import NoAnswer, SettingError
from procedures.instruments import Samples
from procedures.session import Guidance, HandAnalysis, HandCourse, NoiseAtRest, Pose, Session, require_possible

KIND = "positions"
ADAPTIVE = True
OUTPUTS = ("ax", "ay", "az")
WINDOW_S = 0.5  # of a test of rest
LEARNED = 20  # windows of rest that show the noise
LONGEST_WAIT_S = 86_400.0
FEWEST = 12  # positions: nine parameters, and three that check them
TABLE = "Does the sensor lie on a table, and is its cable long enough to turn it upside down? Let it go."
KNOWN = "this position is known already"
SIDES = 6  # the first positions
TRIES = 2  # rests at known positions before another orientation is wanted
FLAT = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class RestWindows:
    """Successive windows of one rest, as one block of samples."""

    volts: NDArray[np.float64]
    channels: Sequence[str]
    rate_hz: float
    start_s: float
    temperature_c: float | None

    @staticmethod
    def of(windows: Sequence[Samples]) -> RestWindows:
        """All `windows` joined."""
        first = windows[0]
        volts = np.concatenate([w.volts for w in windows])
        reported = [w.temperature_c for w in windows if w.temperature_c is not None]
        temperature_c = float(np.mean(reported)) if reported else None
        return RestWindows(volts, first.channels, first.rate_hz, first.start_s, temperature_c)


def hand_positions(
    rig: Session, *, target_g: float = 0.001, rest_s: float = 2.0, most_positions: int = 40, wait_s: float = 120.0
) -> None:
    """Take positions at rest until every parameter is known well enough.

    target_g        The standard uncertainty to reach, as an error at 1 g: 0.001 is 1 mg of bias, 0.1 % of scale factor,
                    0.06 deg of an angle.
    rest_s          How long the sensor must rest in each position.
    most_positions  The run ends after this number of positions, also if the uncertainty is not reached.
    wait_s          The run stops after this time without a new position.
    """
    if target_g <= 0 or not 0 < wait_s <= LONGEST_WAIT_S or rest_s < 2 * WINDOW_S or most_positions < FEWEST:
        raise SettingError(
            f"hand-positions: target_g and wait_s must be above 0, wait_s at most {LONGEST_WAIT_S:g}, rest_s at least "
            f"{2 * WINDOW_S:g}, most_positions at least {FEWEST}"
        )
    require_possible(most_positions, "a smaller most_positions")
    analysis = rig.by_hand
    if analysis is None:
        raise SettingError("hand-positions: this session has no analysis of positions; run it with `rig run`")
    rig = replace(rig, adc=rig.adc.only(*OUTPUTS))
    rig.confirm("at-rest", TABLE)
    noise = _learn_noise(rig, analysis, wait_s)
    skipped: list[str] = []
    while not _suffices(course := analysis.course(rig.measured(), noise, skipped), target_g, most_positions):
        rig.host.expect(max(1, FEWEST - course.count))
        rig.host.guide(_guidance(course, target_g))
        next_rest = _find_next_rest(rig, analysis, course, noise, rest_s, wait_s)
        if next_rest is None:
            skipped.append(course.words)
            continue
        if course.count >= SIDES:  # the directions are known, so no position has a wrong name any more
            skipped.clear()
        rig.keep(Pose(0.0, 0.0, path=course.words), samples=next_rest, temperature_c=rig.oven.temperature_c())
    rig.host.guide(_guidance(course, target_g, is_complete=True))


def _suffices(course: HandCourse, target_g: float, most: int) -> bool:
    return course.count >= most or course.uncertainty_g[0] <= target_g


def _guidance(course: HandCourse, target_g: float, is_complete: bool = False) -> Guidance:
    """The next action of the person, in words, and the drawing."""
    worst_g, parameter = course.uncertainty_g
    progress = f"{parameter} is known to {1e3 * worst_g:.2g} mg, wanted {1e3 * target_g:g} mg" if parameter else ""
    if is_complete:
        text = f"{course.count} positions taken; {progress}"
    else:
        turn = f" ({course.turn})" if course.turn else ""
        text = "; ".join(filter(None, (f"position {course.count + 1}: {course.words}{turn}, then let go", progress)))
    ups = tuple(tuple(map(float, up)) for up in course.ups)
    return Guidance(text, course.up, ups, not is_complete)


def _learn_noise(rig: Session, analysis: HandAnalysis, wait_s: float) -> NoiseAtRest:
    """The noise of the sensor at rest, from the first stretch of windows that are alike. Raises NoAnswer."""
    rig.host.guide(
        Guidance("leave the sensor on the table for 10 s: the program measures its noise", FLAT, moves=False)
    )
    windows: list[NDArray[np.float64]] = []
    for _ in range(max(2 * LEARNED, round(wait_s / WINDOW_S))):
        samples = rig.adc.acquire(WINDOW_S)
        windows = [*windows, samples.volts][-LEARNED:]
        if (noise := analysis.learn(windows, samples.rate_hz)) is not None:
            return noise
    raise NoAnswer(
        f"the sensor was not at rest for {LEARNED * WINDOW_S:g} s within {wait_s:g} s; put it on a firm table away "
        "from motors, let it go, and resume the run"
    )


def _find_next_rest(
    rig: Session, analysis: HandAnalysis, course: HandCourse, noise: NoiseAtRest, rest_s: float, wait_s: float
) -> RestWindows | None:
    """The next rest at a new position. The first window of a rest is left out: the hand has just let go.

    None after TRIES rests at known positions: an earlier position was not the one that the person was told, and is the
    wanted one. Raises NoAnswer after `wait_s` without one.
    """
    windows: list[Samples] = []
    doing, refusals = _Doing(rig), 0
    for _ in range(round(wait_s / WINDOW_S)):
        windows.append(rig.adc.acquire(WINDOW_S))
        stillness = analysis.judge([w.volts for w in windows], noise)
        if not stillness.still:
            doing.say(
                f"{course.words}: the sensor moves ({stillness.noise:.2g} times the noise at rest, by {stillness.by})"
            )
            windows = windows[1:] if stillness.by == "creep" else []
            if refusals >= TRIES:
                return None
        elif len(windows) * WINDOW_S <= rest_s:
            doing.say(f"{course.words}: at rest, wait")
        elif course.is_new((candidate := RestWindows.of(windows[1:])).volts.mean(axis=0)):
            return candidate
        else:
            refusals += not doing.text.startswith(KNOWN)
            doing.say(f"{KNOWN}; needed: {course.words}")
            windows = windows[1:]
    raise NoAnswer(f"no new position for {wait_s:g} s; needed: {course.words}; {doing.text}; resume the run to go on")


@dataclass
class _Doing:
    """The present step, reported once."""

    rig: Session
    text: str = ""

    def say(self, text: str) -> None:
        if text.partition("(")[0] != self.text.partition("(")[0]:
            self.rig.host.doing(text)
        self.text = text
