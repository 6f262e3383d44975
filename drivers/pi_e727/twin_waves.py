"""Data recorder, wave tables and generators of the simulated E-727.

Each table of the recorder has one quantity of one axis after a trigger.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from drivers.pi_e727 import parameters as e727
from drivers.pi_e727.twin_axes import CYCLE_S, Axes, Handler
from drivers.transport.gcs_server import (
    OUT_OF_RANGE,
    PARAMETER_COUNT,
    Refusal,
    groups,
    lines,
    number,
    one_of,
    parse_integer,
    table,
)
from drivers.world.kernel import Floats
from drivers.world.positioner import FOREVER_S, Command

TABLES = [str(k + 1) for k in range(8)]
OPTIONS = ("Nothing", "Commanded Position of Axis", "Actual Position of Axis", "Position Error of Axis")
TRIGGERS = (e727.WITH_THE_WAVE, e727.WITH_A_MOTION, e727.WITH_THE_NEXT_COMMAND, e727.AT_ONCE)


class Recorder:
    """The settings of the recorder, and its recordings. Sample i has the time start + i * rate * cycle."""

    def __init__(self, axes: Axes) -> None:
        self._axes = axes
        self._recorded: dict[str, tuple[str, int]] = dict.fromkeys(TABLES, (axes.ids[0], 0))
        self._triggers = dict.fromkeys(TABLES, e727.WITH_THE_WAVE)
        self._rate = 1
        self._start_s = math.inf
        self._data: dict[str, list[Floats]] = {place: [] for place in TABLES}

    def handlers(self) -> dict[str, Handler]:
        return {
            "DRC": self._set_what,
            "DRC?": lambda a, _: table(
                (k, f"{self._recorded[k][0]} {self._recorded[k][1]}") for k in self._answer_tables(a)
            ),
            "DRT": self._set_triggers,
            "DRT?": lambda a, _: table((k, f"{self._triggers[k]} 0") for k in self._answer_tables(a)),
            "RTR": lambda a, _: self._set_rate(a),
            "RTR?": lambda _a, _: f"{self._rate}\n",
            "TNR?": lambda _a, _: f"{len(TABLES)}\n",
            "DRL?": lambda a, _: table((k, self._count(k)) for k in self._answer_tables(a)),
            "DRR?": self._read,
        }

    def state(self) -> dict[str, Any]:
        """The settings. A restart loses the recording, as a loss of power does."""
        return {"what": dict(self._recorded), "triggers": dict(self._triggers), "rate": self._rate}

    def restore(self, state: Mapping[str, Any]) -> None:
        self._recorded = {place: (axis, option) for place, (axis, option) in state["what"].items()}
        self._triggers, self._rate = dict(state["triggers"]), state["rate"]
        self._start_s = math.inf

    def trigger(self, now_s: float, *kinds: int) -> None:
        """Start a new recording if a table waits for one of `kinds`. The next command counts as the next motion."""
        if any(self._triggers[k] in kinds and self._recorded[k][1] for k in TABLES):
            self._start_s = now_s
            self._data = {place: [] for place in TABLES}

    def advance(self, now_s: float) -> None:
        """Record all that is due; the axes have followed their present commands since the last time."""
        if now_s < self._start_s:
            return
        interval_s = self._rate * CYCLE_S
        for place, (axis, option) in self._recorded.items():
            count = self._count(place)
            if option and count < e727.RECORD_POINTS:
                due = min(math.floor((now_s - self._start_s) / interval_s + 1e-7) + 1, e727.RECORD_POINTS)
                if due > count:
                    times_s = self._start_s + interval_s * np.arange(count, due, dtype=np.float64)
                    self._data[place].append(self._values(axis, option, times_s))

    def _values(self, axis: str, option: int, times_s: Floats) -> Floats:
        measured = self._axes.measured_um(axis, times_s)
        if option == e727.ACTUAL_POSITION:
            return measured
        commanded = np.array([self._axes.commanded_um(axis, t_s) for t_s in times_s])
        return commanded if option == OPTIONS.index("Commanded Position of Axis") else commanded - measured

    def _count(self, place: str) -> int:
        return sum(len(values) for values in self._data[place])

    def _answer_tables(self, arguments: Sequence[str]) -> list[str]:
        return [one_of(place, TABLES, OUT_OF_RANGE) for place in arguments] or TABLES

    def _set_what(self, arguments: Sequence[str], _now_s: float) -> None:
        for place, source, option in groups(arguments, 3):
            axis = one_of(source, self._axes.ids, e727.ILLEGAL_AXIS)
            self._recorded[one_of(place, TABLES, OUT_OF_RANGE)] = axis, parse_integer(option, 0, len(OPTIONS) - 1)

    def _set_triggers(self, arguments: Sequence[str], now_s: float) -> None:
        for place, source, _value in groups(arguments, 3):
            trigger = int(one_of(source, map(str, TRIGGERS), OUT_OF_RANGE))
            for place_id in TABLES if place == "0" else [one_of(place, TABLES, OUT_OF_RANGE)]:
                self._triggers[place_id] = trigger
        self.trigger(now_s, e727.AT_ONCE)

    def _set_rate(self, arguments: Sequence[str]) -> None:
        self._rate = parse_integer(groups(arguments, 1)[0][0], 1, 10**6)
        self._start_s = math.inf

    def _read(self, arguments: Sequence[str], _now_s: float) -> str:
        """`DRR? offset count tables`: a header, and a row for each sample."""
        groups(arguments[:3], 3)
        places = self._answer_tables(arguments[2:])
        most = min(self._count(place) for place in places)
        offset = parse_integer(arguments[0], 1, most)
        count = parse_integer(arguments[1], 1, most - offset + 1)
        columns = [np.concatenate(self._data[place])[offset - 1 : offset - 1 + count] for place in places]
        rows = (" ".join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True))
        return lines([*self._header(places, count), *rows])

    def _header(self, places: Sequence[str], count: int) -> list[str]:
        names = [f"{OPTIONS[self._recorded[place][1]]} {self._recorded[place][0]}" for place in places]
        fields = {"TYPE": 1, "SEPARATOR": 32, "DIM": len(places), "SAMPLE_TIME": self._rate * CYCLE_S, "NDATA": count}
        name_fields = {f"NAME{k}": name for k, name in enumerate(names)}
        return [*(f"# {key} = {value}" for key, value in (fields | name_fields).items()), "# END_HEADER"]


# Wave tables and generators: only whole symmetric sines, generated without steps.

MOST_CYCLES = 2**31 - 1  # of the servo for a point, and of a wave


@dataclass(frozen=True)
class Sine:
    """One period in a wave table: points, width and lowest place in um, the point to begin with."""

    points: int = 0
    width_um: float = 0.0
    lowest_um: float = 0.0
    first: int = 0

    def command(self, start_s: float, point_s: float, cycles: int) -> Command:
        """The sine from `start_s` on, with this number of cycles; 0 for endless."""
        period_s = self.points * point_s
        phase = 2 * math.pi * (self.first / self.points - 0.25)
        half_um = self.width_um / 2
        end_s = min(start_s + cycles * period_s, FOREVER_S) if cycles else FOREVER_S
        return Command(start_s, self.lowest_um + half_um, 0.0, half_um, 1 / period_s, phase, end_s)


def parse_sine(shape: Sequence[str]) -> Sine:
    """The wave table for the command `X SIN_P points width lowest period first center`."""
    if len(shape) != 8:
        raise Refusal(PARAMETER_COUNT)
    for text, expected in zip(shape, ("X", e727.SINE), strict=False):
        one_of(text, [expected], OUT_OF_RANGE)
    points, period = (parse_integer(shape[k], 1, e727.WAVE_POINTS) for k in (2, 5))
    first, center = parse_integer(shape[6], 0, points - 1), parse_integer(shape[7], 0, period)
    if points != period or 2 * center != period:
        raise Refusal(OUT_OF_RANGE)
    return Sine(points, number(shape[3]), number(shape[4]), first)


class Waves:
    """Generators, one for each axis and numbered by its place: all that sets axes in motion, and the recorder off."""

    def __init__(self, axes: Axes, recorder: Recorder) -> None:
        self._axes, self._recorder = axes, recorder
        self._axis = {str(k + 1): axis for k, axis in enumerate(axes.ids)}
        self._tables: dict[str, Sine] = {}
        self._selected = dict.fromkeys(self._axis, 0)
        self._rates = {generator: [1, 0] for generator in self._axis}
        self._cycles = dict.fromkeys(self._axis, 0)
        self._until_s = dict.fromkeys(self._axis, 0.0)

    def handlers(self) -> dict[str, Handler]:
        return {
            "WAV": self._write,
            "WAV?": self._lengths,
            "WCL": self._clear,
            "WSL": lambda a, _: self._selected.update(self._values(a, len(TABLES))),
            "WSL?": lambda a, _: table((k, self._selected[k]) for k in self._answer_generators(a)),
            "WTR": self._set_rates,
            "WTR?": lambda a, _: table(
                (k, f"{self._rates[k][0]} {self._rates[k][1]}") for k in self._answer_generators(a)
            ),
            "WGC": lambda a, _: self._cycles.update(self._values(a, MOST_CYCLES)),
            "WGC?": lambda a, _: table((k, self._cycles[k]) for k in self._answer_generators(a)),
            "WGO": self._play,
            "WGO?": lambda a, now_s: table((k, int(now_s < self._until_s[k])) for k in self._answer_generators(a)),
            "MOV": self._move,
        }

    def state(self) -> dict[str, Any]:
        return {
            "tables": {place: asdict(sine) for place, sine in self._tables.items()},
            "selected": dict(self._selected),
            "rates": dict(self._rates),
            "cycles": dict(self._cycles),
            "until_s": dict(self._until_s),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        self._tables = {place: Sine(**sine) for place, sine in state["tables"].items()}
        self._selected, self._rates = dict(state["selected"]), dict(state["rates"])
        self._cycles, self._until_s = dict(state["cycles"]), dict(state["until_s"])

    def running(self, now_s: float) -> list[bool]:
        """For each generator, whether it plays."""
        return [now_s < until_s for until_s in self._until_s.values()]

    def halt(self, now_s: float) -> None:
        """End all waves; where the axes go is not decided here."""
        self._until_s = {generator: min(until_s, now_s) for generator, until_s in self._until_s.items()}

    def _answer_generators(self, arguments: Sequence[str]) -> list[str]:
        return [one_of(k, self._axis, e727.ILLEGAL_AXIS) for k in arguments] or list(self._axis)

    def _values(self, arguments: Sequence[str], high: float) -> dict[str, int]:
        return {
            one_of(k, self._axis, e727.ILLEGAL_AXIS): parse_integer(text, 0, high) for k, text in groups(arguments, 2)
        }

    def _write(self, arguments: Sequence[str], _now_s: float) -> None:
        if not arguments:
            raise Refusal(PARAMETER_COUNT)
        place, sine = one_of(arguments[0], TABLES, OUT_OF_RANGE), parse_sine(arguments[1:])
        tables = self._tables | {place: sine}
        if sum(table.points for table in tables.values()) > e727.WAVE_POINTS:
            raise Refusal(e727.WAVE_MEMORY)
        self._tables = tables

    def _lengths(self, arguments: Sequence[str], _now_s: float) -> str:
        """Parameter 1 of a table, the only one: its number of points."""
        places = [one_of(place, TABLES, OUT_OF_RANGE) for place in arguments[:1]] or TABLES
        return table((f"{place} 1", self._tables.get(place, Sine()).points) for place in places)

    def _clear(self, arguments: Sequence[str], _now_s: float) -> None:
        for place in arguments:
            self._tables.pop(one_of(place, TABLES, OUT_OF_RANGE), None)

    def _set_rates(self, arguments: Sequence[str], _now_s: float) -> None:
        for k, rate, kind in groups(arguments, 3):
            rates = [parse_integer(rate, 1, MOST_CYCLES), parse_integer(kind, 0, 1)]
            for generator in self._axis if k == "0" else [one_of(k, self._axis, e727.ILLEGAL_AXIS)]:
                self._rates[generator] = rates

    def _play(self, arguments: Sequence[str], now_s: float) -> None:
        modes = {
            one_of(k, self._axis, e727.ILLEGAL_AXIS): parse_integer(mode, 0, 1) for k, mode in groups(arguments, 2)
        }
        starting = {k: self._selected_wave(k, now_s) for k, mode in modes.items() if mode}
        for generator, command in starting.items():
            self._axes.follow(self._axis[generator], command, now_s)
            self._until_s[generator] = command.end_s
        for generator in modes.keys() - starting.keys():
            if now_s < self._until_s[generator]:
                self._until_s[generator] = now_s
                self._axes.halt(self._axis[generator], now_s)
        if starting:
            self._recorder.trigger(now_s, e727.WITH_THE_WAVE, e727.WITH_A_MOTION, e727.WITH_THE_NEXT_COMMAND)

    def _selected_wave(self, generator: str, now_s: float) -> Command:
        """The wave of a generator. Refused without a table, without servo, outside the travel."""
        sine = self._tables.get(str(self._selected[generator]))
        if sine is None:
            raise Refusal(e727.NO_WAVE)
        self._axes.require(self._axis[generator], sine.lowest_um, sine.lowest_um + sine.width_um)
        return sine.command(now_s, self._rates[generator][0] * CYCLE_S, self._cycles[generator])

    def _move(self, arguments: Sequence[str], now_s: float) -> None:
        """MOV, which a running wave forbids."""
        targets = self._axes.targets(arguments)
        if any(now_s < self._until_s[k] for k, axis in self._axis.items() if axis in targets):
            raise Refusal(e727.WAVE_RUNS)
        for axis, um in targets.items():
            self._axes.go(axis, um, now_s)
        self._recorder.trigger(now_s, e727.WITH_A_MOTION, e727.WITH_THE_NEXT_COMMAND)
