"""The simulated E-727's data recorder: tables that each follow one thing of one axis, from a trigger on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from drivers import pi_e727_table as e727
from drivers.links.gcs_server import OUT_OF_RANGE, groups, lines, one_of, table, whole
from drivers.pi_e727_twin_axes import CYCLE_S, Axes, Handler
from drivers.simulation.kernel import Floats

TABLES = [str(k + 1) for k in range(8)]
OPTIONS = ("Nothing", "Commanded Position of Axis", "Actual Position of Axis", "Position Error of Axis")
TRIGGERS = (e727.WITH_THE_WAVE, e727.WITH_A_MOTION, e727.WITH_THE_NEXT_COMMAND, e727.AT_ONCE)


class Recorder:
    """What is recorded, and what has been: sample i of a recording is that of start + i * rate * cycle."""

    def __init__(self, axes: Axes) -> None:
        self._axes = axes
        self._what: dict[str, tuple[str, int]] = dict.fromkeys(TABLES, (axes.ids[0], 0))
        self._triggers = dict.fromkeys(TABLES, e727.WITH_THE_WAVE)
        self._rate = 1
        self._start_s = math.inf
        self._data: dict[str, list[Floats]] = {place: [] for place in TABLES}

    def handlers(self) -> dict[str, Handler]:
        return {
            "DRC": self._set_what,
            "DRC?": lambda a, _: table((k, f"{self._what[k][0]} {self._what[k][1]}") for k in self._asked(a)),
            "DRT": self._set_triggers,
            "DRT?": lambda a, _: table((k, f"{self._triggers[k]} 0") for k in self._asked(a)),
            "RTR": lambda a, _: self._set_rate(a),
            "RTR?": lambda _a, _: f"{self._rate}\n",
            "TNR?": lambda _a, _: f"{len(TABLES)}\n",
            "DRL?": lambda a, _: table((k, self._count(k)) for k in self._asked(a)),
            "DRR?": self._read,
        }

    def state(self) -> dict[str, Any]:
        """The settings. What was recorded is lost with a restart, as with the power."""
        return {"what": dict(self._what), "triggers": dict(self._triggers), "rate": self._rate}

    def restore(self, state: Mapping[str, Any]) -> None:
        self._what = {place: (axis, option) for place, (axis, option) in state["what"].items()}
        self._triggers, self._rate = dict(state["triggers"]), state["rate"]
        self._start_s = math.inf

    def trigger(self, now_s: float, *kinds: int) -> None:
        """Start a new recording if a table waits for one of `kinds`. The next command is taken for the next motion."""
        if any(self._triggers[k] in kinds and self._what[k][1] for k in TABLES):
            self._start_s = now_s
            self._data = {place: [] for place in TABLES}

    def advance(self, now_s: float) -> None:
        """Record all that is due; the axes have followed their present commands since the last time."""
        interval_s = self._rate * CYCLE_S
        for place, (axis, option) in self._what.items():
            taken = self._count(place)
            if option and now_s >= self._start_s and taken < e727.RECORD_POINTS:
                due = min(math.floor((now_s - self._start_s) / interval_s + 1e-7) + 1, e727.RECORD_POINTS)
                if due > taken:
                    times_s = self._start_s + interval_s * np.arange(taken, due, dtype=np.float64)
                    self._data[place].append(self._values(axis, option, times_s))

    def _values(self, axis: str, option: int, times_s: Floats) -> Floats:
        measured = self._axes.measured_um(axis, times_s)
        if option == e727.ACTUAL_POSITION:
            return measured
        commanded = np.array([self._axes.commanded_um(axis, t_s) for t_s in times_s])
        return commanded if option == OPTIONS.index("Commanded Position of Axis") else commanded - measured

    def _count(self, place: str) -> int:
        return sum(len(values) for values in self._data[place])

    def _asked(self, arguments: Sequence[str]) -> list[str]:
        return [one_of(place, TABLES, OUT_OF_RANGE) for place in arguments] or TABLES

    def _set_what(self, arguments: Sequence[str], _now_s: float) -> None:
        for place, source, option in groups(arguments, 3):
            axis = one_of(source, self._axes.ids, e727.ILLEGAL_AXIS)
            self._what[one_of(place, TABLES, OUT_OF_RANGE)] = axis, whole(option, 0, len(OPTIONS) - 1)

    def _set_triggers(self, arguments: Sequence[str], now_s: float) -> None:
        for place, source, _value in groups(arguments, 3):
            trigger = int(one_of(source, map(str, TRIGGERS), OUT_OF_RANGE))
            for each in TABLES if place == "0" else [one_of(place, TABLES, OUT_OF_RANGE)]:
                self._triggers[each] = trigger
        self.trigger(now_s, e727.AT_ONCE)

    def _set_rate(self, arguments: Sequence[str]) -> None:
        self._rate = whole(groups(arguments, 1)[0][0], 1, 10**6)
        self._start_s = math.inf

    def _read(self, arguments: Sequence[str], _now_s: float) -> str:
        """`DRR? offset count tables`: a header, and a row for each sample."""
        groups(arguments[:3], 3)
        places = self._asked(arguments[2:])
        most = min(self._count(place) for place in places)
        offset = whole(arguments[0], 1, most)
        count = whole(arguments[1], 1, most - offset + 1)
        columns = [np.concatenate(self._data[place])[offset - 1 : offset - 1 + count] for place in places]
        rows = (" ".join(f"{value:.6f}" for value in row) for row in zip(*columns, strict=True))
        return lines([*self._header(places, count), *rows])

    def _header(self, places: Sequence[str], count: int) -> list[str]:
        names = [f"{OPTIONS[self._what[place][1]]} {self._what[place][0]}" for place in places]
        fields = {"TYPE": 1, "SEPARATOR": 32, "DIM": len(places), "SAMPLE_TIME": self._rate * CYCLE_S, "NDATA": count}
        named = {f"NAME{k}": name for k, name in enumerate(names)}
        return [*(f"# {key} = {value}" for key, value in (fields | named).items()), "# END_HEADER"]
