"""What a run's poses tell so far of the sensor, told live: recursive least squares, a pose at a time.

    poses          V = bias + s . f              specific force along the sensor's edges: its own is the scale factor
    rates          V = bias + s . w + g . f      rate likewise, beside specific force
    positions      mx^2 + my^2 = 2 c . m + k     a turn with z upright, and so on: c the hard iron, k of the turn

Uncertainties are from the scatter about that, so all that it leaves out is in them. The results at the end are those of
the whole model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from calibrations.estimators.recursive import Recursive
from calibrations.numerals import measured
from calibrations.table import Array
from procedures.questions import EDGES
from procedures.session import Dwell, Pose
from rig.record import Kept, Record
from rig.record.turned import sensor_from_table, specific_force_g

AXES = "xyz"
Row = tuple[str, Array, float]  # which of several least squares, and one measurement of it


@dataclass(frozen=True)
class Law:
    """What a kind of table tells: the rows of a dwell, and names and units of what they determine, by place."""

    rows: Callable[[Dwell], Iterator[Row]]
    told: Callable[[str], Mapping[str, tuple[int, str]]]


@dataclass
class SoFar:
    """Follows a run as it is kept. Nothing is told before `begun`."""

    law: Law | None = None
    known: dict[str, Recursive] = field(default_factory=dict)
    path: str = ""

    def begun(self, run: str) -> None:
        """The run begins, or goes on: what the record holds of it counts."""
        with Record() as record:
            self.law, self.known = LAWS.get(record.run(run).kind), {}
            for _, dwell in record.dwells(run) if self.law else ():
                self._take(dwell)

    def kept(self, kept: Kept) -> dict[str, str]:
        """What is known by name, in words, after one more pose."""
        if self.law is None:
            return {}
        self._take(kept.dwell)
        self.path = kept.pose.path
        return dict(self._told(self.law))

    def told(self, kept: Kept) -> str:
        """The same in lines, of all before this pose where it begins another path."""
        begins, before = self.path not in ("", kept.pose.path), self.path
        known = dict(self._told(self.law)) if begins and self.law else {}
        self.kept(kept)
        return "\n".join([f"after {before}", *(f"  {name:<12} {words}" for name, words in known.items())] * bool(known))

    def _take(self, dwell: Dwell) -> None:
        for name, row, value in self.law.rows(dwell) if self.law else ():
            self.known[name] = self.known.get(name, Recursive.of(len(row))).after(row, value)

    def _told(self, law: Law) -> Iterator[tuple[str, str]]:
        for name, known in self.known.items():
            found, sensor = known.estimate(), name.rpartition(".")[0]
            for what, (place, unit) in law.told(name).items():
                value, std = float(found.values[place]), float(found.scattered[place])
                if np.isfinite(std):
                    yield f"{sensor} {what}".strip(), f"{measured(value, std)} {unit}"


def _loaded(letter: str, load: Callable[[Pose], Array]) -> Callable[[Dwell], Iterator[Row]]:
    """Rows of outputs that follow loads: those of the channels vx, vy, vz, say."""
    outputs = [f"{letter}{axis}" for axis in AXES]

    def rows(dwell: Dwell) -> Iterator[Row]:
        row = np.append(1.0, load(dwell.pose))
        yield from ((name, row, v) for name, v in dwell.means.items() if name.rpartition(".")[2] in outputs)

    return rows


def _rate_and_force(pose: Pose) -> Array:
    """Along the sensor's edges, deg/s and g, shape (6,): negative about the normal while beta grows."""
    rate_deg_s = np.round(-pose.rate_deg_s * sensor_from_table(pose)[:, 2], 12)
    return np.concatenate([rate_deg_s, specific_force_g(pose)])


def _levelled(dwell: Dwell) -> Iterator[Row]:
    """The two level edges of a magnetometer, for hard iron and the square of the circle of this turn."""
    pose, m = dwell.pose, np.array([dwell.means[f"m{axis}"] for axis in AXES])
    level = np.array([axis != pose.up for axis in AXES], dtype=float)
    turns = np.zeros(2 * len(EDGES))
    turns[2 * EDGES.index(pose.up) + (pose.alpha_deg > 0)] = 1.0
    yield "m", np.concatenate([2 * level * m, turns]), float(np.sum(level * m**2))


def _line(prefix: str, unit: str) -> Callable[[str], Mapping[str, tuple[int, str]]]:
    def told(output: str) -> Mapping[str, tuple[int, str]]:
        axis = output[-1]
        return {f"{prefix}bias-{axis}": (0, "V"), f"{prefix}scale-{axis}": (1 + AXES.index(axis), unit)}

    return told


LAWS = {
    "poses": Law(_loaded("v", specific_force_g), _line("", "V/g")),
    "rates": Law(_loaded("g", _rate_and_force), _line("gyro-", "V/(deg/s)")),
    "positions": Law(_levelled, lambda _: {f"hard-iron-{axis}": (k, "V") for k, axis in enumerate(AXES)}),
}
