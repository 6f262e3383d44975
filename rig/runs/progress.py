"""Progress of a run: estimates of the sensor from the poses so far, and the remaining time.

The estimates are recursive least squares, updated with each pose:

    poses          v = bias + s . f              specific force along the sensor's edges: its own is the scale factor
    rates          v = bias + s . w + g . f      rate w and specific force f
    positions      mx^2 + my^2 = 2 c . m + k     a turn with z vertical, and so on: c is the hard iron, k of the turn

The uncertainties follow from the scatter about this formula, so they include all effects that it omits. The results at
the end of the run come from the whole model.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from calibrations.estimators.least_squares import Recursive
from calibrations.table import Array
from calibrations.text import estimate_text
from procedures.instruments import OUTPUTS
from procedures.questions import EDGES
from procedures.session import Dwell, Pose
from rig.record import Kept, Record
from rig.record.measured import FIELD, RATE, sensor_from_table, specific_force_g
from rig.record.tables import units_of

AXES = "xyz"
FORCES = tuple(chain(*OUTPUTS))
Row = tuple[str, Array, float]  # name of the least squares, and one measurement


@dataclass(frozen=True)
class Law:
    """The formula of a kind of table: the rows of a dwell, and the parameters with their place and unit.

    In a unit, `{out}` is that of the outputs.
    """

    channels: Sequence[str]
    rows: Callable[[Dwell], Iterator[Row]]
    parameters: Callable[[str], Mapping[str, tuple[int, str]]]


@dataclass
class RunningEstimates:
    """Estimates of the sensor from the poses of a run so far. There are none before `begun`."""

    law: Law | None = None
    known: dict[str, Recursive] = field(default_factory=dict)
    path: str = ""
    units: Mapping[str, str] = field(default_factory=dict)  # of the channels that are not in V

    def begun(self, run: str) -> None:
        """The run begins or continues: take the poses in the record."""
        with Record() as record:
            found = record.run(run)
            self.law, self.known = LAWS.get(found.kind), {}
            self.units = units_of(found, self.law.channels) if self.law and found.bench else {}
            for _, dwell in record.dwells(run) if self.law else ():
                self._take(dwell)

    def kept(self, kept: Kept) -> dict[str, str]:
        """The estimates by name, as text, after one more pose."""
        if self.law is None:
            return {}
        self._take(kept.dwell)
        self.path = kept.pose.path
        return dict(self._estimates(self.law))

    def told(self, kept: Kept) -> str:
        """The estimates in lines, if this pose begins a new path; they do not include this pose."""
        begins, before = self.path not in ("", kept.pose.path), self.path
        known = dict(self._estimates(self.law)) if begins and self.law else {}
        self.kept(kept)
        return "\n".join([f"after {before}", *(f"  {name:<12} {words}" for name, words in known.items())] * bool(known))

    def _take(self, dwell: Dwell) -> None:
        for name, row, value in self.law.rows(dwell) if self.law else ():
            self.known[name] = self.known.get(name, Recursive.of(len(row))).after(row, value)

    def _estimates(self, law: Law) -> Iterator[tuple[str, str]]:
        for name, known in self.known.items():
            estimate, (sensor, _, channel) = known.estimate(), name.rpartition(".")
            out = self.units.get(channel, "V")
            for parameter, (place, unit) in law.parameters(name).items():
                value, std = float(estimate.values[place]), float(estimate.scattered[place])
                if np.isfinite(std):
                    yield f"{sensor} {parameter}".strip(), f"{estimate_text(value, std)} {unit.replace('{out}', out)}"


def _loaded(outputs: Collection[str], load: Callable[[Pose], Array]) -> Callable[[Dwell], Iterator[Row]]:
    """Rows of outputs that are linear in loads."""

    def rows(dwell: Dwell) -> Iterator[Row]:
        row = np.append(1.0, load(dwell.pose))
        yield from ((name, row, v) for name, v in dwell.means.items() if name.rpartition(".")[2] in outputs)

    return rows


def _rate_and_force(pose: Pose) -> Array:
    """Rate in deg/s and specific force in g along the sensor's axes, shape (6,): negative while beta rises."""
    rate_deg_s = np.round(-pose.rate_deg_s * sensor_from_table(pose)[:, 2], 12)
    return np.concatenate([rate_deg_s, specific_force_g(pose)])


def _levelled(dwell: Dwell) -> Iterator[Row]:
    """The two horizontal axes of a magnetometer, for hard iron and the square of the circle of this turn.

    Positions by hand have no such turns, and no rows.
    """
    if FIELD[0] not in dwell.means:
        return
    pose, m = dwell.pose, np.array([dwell.means[name] for name in FIELD])
    level = np.array([axis != pose.up for axis in AXES], dtype=float)
    turns = np.zeros(2 * len(EDGES))
    turns[2 * EDGES.index(pose.up) + (pose.alpha_deg > 0)] = 1.0
    yield FIELD[0], np.concatenate([2 * level * m, turns]), float(np.sum(level * m**2))


def _line(prefix: str, unit: str) -> Callable[[str], Mapping[str, tuple[int, str]]]:
    def parameters(output: str) -> Mapping[str, tuple[int, str]]:
        axis = output[-1]
        return {f"{prefix}bias-{axis}": (0, "{out}"), f"{prefix}scale-{axis}": (1 + AXES.index(axis), unit)}

    return parameters


LAWS = {
    "poses": Law(FORCES, _loaded(FORCES, specific_force_g), _line("", "{out}/g")),
    "rates": Law(RATE, _loaded(RATE, _rate_and_force), _line("gyro-", "{out}/(deg/s)")),
    "positions": Law(FIELD, _levelled, lambda _: {f"hard-iron-{axis}": (k, "{out}") for k, axis in enumerate(AXES)}),
}


@dataclass(frozen=True)
class Progress:
    """Progress and remaining time of a run: at first from the plan, later from the pace of the run.

    `at_s`: time of each pose in the plan, s; empty without a plan. `end_s`: end of the plan. `total`: number of poses.
    `first`: poses that were recorded when this process began, at `began_s` of the wall clock. `done`: recorded poses;
    the last one was recorded at `kept_s`.
    """

    at_s: tuple[float, ...] = ()
    end_s: float = 0.0
    total: int = 0
    first: int = 0
    done: int = 0
    began_s: float = 0.0
    kept_s: float = 0.0

    def begin(self, now_s: float) -> Progress:
        """This process begins or continues the run."""
        return replace(self, total=0, first=0, done=0, began_s=now_s, kept_s=now_s)

    def expect(self, total: int, done: int) -> Progress:
        """The number of poses of the procedure and of the record, for the whole run or for its next part."""
        first = done if not self.total else self.first
        return replace(self, total=max(total, len(self.at_s)), first=first, done=done)

    def step(self, now_s: float) -> Progress:
        """One more pose is recorded."""
        return replace(self, done=self.done + 1, kept_s=now_s)

    def planned_left_s(self) -> float | None:
        """Remaining time of the plan, s of the rig's time; None without a plan."""
        return self.end_s - self._work(self.done) if self.at_s else None

    def left_s(self, now_s: float) -> float | None:
        """Remaining time by the wall clock, s; None before the first pose."""
        gone = self._work(self.done) - self._work(self.first)
        if gone <= 0 or self.done == self.first:
            return None
        end = self.end_s if self.at_s else float(self.total)
        left = (end - self._work(self.done)) * (self.kept_s - self.began_s) / gone
        return max(0.0, left - (now_s - self.kept_s))

    def _work(self, done: int) -> float:
        """The work of `done` poses: seconds of the plan, or poses without a plan."""
        if not self.at_s:
            return float(done)
        return self.at_s[done] if done < len(self.at_s) else self.end_s
