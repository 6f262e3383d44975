"""Logs of a sensor that a person turned from rest to rest, cut into rests and turns.

A gyroscope with an accelerometer gives a table of turns: the angle of each turn follows from the accelerometer. A
gyroscope alone gives rates, if each turn has a known angle: whole turns on a table.

Source  Tedaldi, Pretto and Menegatti, ICRA 2014: rests and turns in one log. Ferraris, Grimaldi and Parvis, Sensors and
        Materials 7 (1995): a whole turn about each edge.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calibrations.criteria import FEWEST_TURNS_OF_A_GYROSCOPE, LEAST_OF_WHOLE_TURN, MOST_TURN_DEVIATION
from calibrations.errors import DataError
from calibrations.importing.plausible import required_rate_hz
from calibrations.importing.raw_logs import still_intervals
from calibrations.importing.sessions import OUTPUTS, RATE, TURN
from calibrations.means.noise import robust_std
from calibrations.table import AXES, Array, Constant

FORCES = tuple(f"a{axis}" for axis in AXES)
LONGEST_REST_S = 5.0  # next to a turn: the bias of the gyroscope drifts over a longer rest


def cut_turns(columns: Mapping[str, Array], constants: Mapping[str, Constant], source: str) -> dict[str, Array]:
    """The samples of each turn and of its rests, with the columns `turn` and `resting`; a rest between two turns twice.

    A rest is an interval in which both sensors are still. Each turn has the part of the rest before it and of the rest
    after it that is next to it.
    Raises MissingConstant without times and sample rate, DataError for fewer rests than a gyroscope needs.
    """
    rate_hz = required_rate_hz(columns, constants, source)
    rests = still_intervals(np.column_stack([_noise_multiples(columns[name]) for name in (*OUTPUTS, *FORCES)]), rate_hz)
    if len(rests) <= FEWEST_TURNS_OF_A_GYROSCOPE:
        raise DataError(
            f"{source}: found {len(rests)} rests; a gyroscope needs {FEWEST_TURNS_OF_A_GYROSCOPE + 1} or more: keep "
            "the sensor still for 1 s or more before and after each turn"
        )
    longest = round(LONGEST_REST_S * rate_hz)
    rows, turns, resting = list[NDArray[np.intp]](), list[Array](), list[Array]()
    for number, ((begin, rest_ends), (rest_begins, end)) in enumerate(pairwise(rests), start=1):
        first, last = max(begin, rest_ends - longest), min(end, rest_begins + longest)
        own_rows = np.arange(first, last)
        rows.append(own_rows)
        turns.append(np.full(len(own_rows), float(number)))
        resting.append(((own_rows < rest_ends) | (own_rows >= rest_begins)).astype(float))
    chosen = np.concatenate(rows)
    marks = {"turn": np.concatenate(turns), "resting": np.concatenate(resting)}
    times = {} if "t_s" in columns else {"t_s": chosen / rate_hz}
    return {**{name: values[chosen] for name, values in columns.items()}, **times, **marks}


def _noise_multiples(values: Array) -> Array:
    """Samples divided by their noise, so that sensors with different units can be compared."""
    noise = float(robust_std(np.diff(values)))
    return values / noise if noise > 0 else np.zeros_like(values)


# Whole turns of a gyroscope alone. The sensor lies on one of its faces with an edge at a straight edge, rests, is
# turned once on the table until it lies at the straight edge again, and rests. The constant `turn_deg` gives the angle:
# 360 for a turn that is anticlockwise seen from above, for any unsteady hand. The axis is the edge of the sensor whose
# output shows the turn. Its sense is that of the output: nothing shows an inverted one. Other movements between two
# rests, such as from face to face, are much smaller and are left out.

PATH = "path"


@dataclass(frozen=True)
class Movement:
    """First row and end row of a movement between two rests, and the integral of the outputs (3,) without bias."""

    first: int
    end: int
    integral: Array

    @property
    def axis(self) -> int:
        """The axis whose output shows most of the turn."""
        return int(np.argmax(np.abs(self.integral)))

    @property
    def size(self) -> float:
        """The integral of the rate about the axis of the turn."""
        return float(abs(self.integral[self.axis]))


def cut_whole_turns(
    columns: Mapping[str, Array], constants: Mapping[str, Constant], source: str
) -> tuple[dict[str, Array], dict[str, tuple[str, ...]]]:
    """The samples of each rest and turn, with its rate and axis, and the names of the sections in `path`.

    Raises MissingConstant without times and sample rate, DataError without turns, and for a turn of another angle.
    """
    turn_deg = constants[TURN]
    if not isinstance(turn_deg, float | int) or not turn_deg:
        raise DataError(f"{source}: the constant turn_deg is {turn_deg}; give the angle of each turn, such as 360")
    rate_hz = required_rate_hz(columns, constants, source)
    outputs = np.column_stack([columns[name] for name in OUTPUTS])
    rests = still_intervals(outputs, rate_hz)
    turns = _whole_turns([_movement(outputs, *pair, rate_hz) for pair in pairwise(rests)], source)
    _require_alike(turns, rate_hz, source)
    parts: list[tuple[int, int, str, float, Array]] = []
    for number, turn in enumerate(turns, 1):
        axis = np.sign(turn.integral[turn.axis] * turn_deg) * np.eye(3)[turn.axis]
        rate = turn_deg * rate_hz / (turn.end - turn.first)
        beside = [(a, b) for a, b in rests if b == turn.first or a == turn.end]
        parts += [(a, b, f"rest beside turn {number}", 0.0, axis) for a, b in beside if a not in {p[0] for p in parts}]
        parts.append((turn.first, turn.end, f"turn {number}", rate, axis))
    parts.sort(key=lambda part: part[0])
    lengths = [b - a for a, b, *_ in parts]
    rows = np.concatenate([np.arange(a, b) for a, b, *_ in parts])
    axes = np.repeat([axis for *_, axis in parts], lengths, axis=0)
    cut = {name: values[rows] for name, values in columns.items()}
    cut |= {RATE: np.repeat([rate for *_, rate, _ in parts], lengths)}
    cut |= {f"axis_{axis}": axes[:, k] for k, axis in enumerate(AXES)}
    return cut, {PATH: tuple(np.repeat([name for _, _, name, *_ in parts], lengths).tolist())}


def _movement(outputs: Array, before: tuple[int, int], after: tuple[int, int], rate_hz: float) -> Movement:
    first, end = before[1], after[0]
    bias = (outputs[slice(*before)].mean(axis=0) + outputs[slice(*after)].mean(axis=0)) / 2
    return Movement(first, end, (outputs[first:end] - bias).sum(axis=0) / rate_hz)


def _whole_turns(movements: list[Movement], source: str) -> list[Movement]:
    """The movements that are whole turns: about as large as the largest. Raises DataError without any."""
    largest = max((movement.size for movement in movements), default=0.0)
    if not largest > 0:
        raise DataError(
            f"{source}: found no turn between two rests; keep the sensor still for 2 s or more before and after each "
            "turn"
        )
    return [movement for movement in movements if movement.size > LEAST_OF_WHOLE_TURN * largest]


def _require_alike(turns: list[Movement], rate_hz: float, source: str) -> None:
    """Raises DataError for a turn whose angle by the output differs from that of the others about its axis."""
    for axis in range(3):
        same_axis = [turn for turn in turns if turn.axis == axis]
        usual = float(np.median([turn.size for turn in same_axis])) if same_axis else 1.0
        for turn in same_axis:
            if abs(turn.size / usual - 1) > MOST_TURN_DEVIATION:
                raise DataError(
                    f"{source}: by {OUTPUTS[axis]} the turn that begins {turn.first / rate_hz:.1f} s after the first "
                    f"sample has {turn.size / usual:.2f} times the angle of the others about {AXES[axis]}; each must "
                    "be one whole turn on the table, from the straight edge to the straight edge; remove its samples"
                )
