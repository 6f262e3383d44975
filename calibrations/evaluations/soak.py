"""A soak: bias and scale factor of each axis over hours since power-on, and the still record between reversals.

Its table has a row for each pose of a tumble (path `reversal k`) and for each block of the still record (`hold k`).
A gap is time of which nothing was kept: any within a hold, and more than moves take elsewhere. A tumble that a gap
interrupts is left out, as drift no longer cancels in it.

Source  Ang III.B, Fig. 10.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import TooFewRows
from calibrations.evaluations.steady_state import FEWEST, Quantity, SteadyState, steady_state
from calibrations.evaluations.tumble import Tumble, tumbles
from calibrations.noise import rms
from calibrations.noise_analysis.exact import deviations
from calibrations.table import Array, Table

REVERSAL, HOLD = "reversal", "hold"
AXES = "xy"
HOUR_S = 3600.0
LONGEST_MOVE_S = 120.0  # between poses: more is a gap
REACHED_K = 1.0  # from the set point: an oven that is further away is still heating
GAP_SAMPLES = 2.0  # within a hold: more is a gap


@dataclass(frozen=True)
class Course:
    """One quantity of one axis at each reversal, in V or V/g, with white standard errors; times since power-on, s.

    No `state` where the reversals are too few to tell drift from noise.
    """

    quantity: str  # bias or scale
    axis: str
    t_s: Array
    values: Array
    stds: Array
    state: SteadyState | None

    @property
    def time_s(self) -> Quantity | None:
        """Its steady-state time since power-on; None where it is not reached, or cannot be told."""
        return self.state.time_s if self.state else None


@dataclass(frozen=True)
class Gap:
    """Time of which nothing was kept: its start since power-on and its length, s."""

    start_s: float
    length_s: float
    path: str


@dataclass(frozen=True)
class Soak:
    """What a soak's table comes to. Times since power-on, s."""

    table: Table
    gaps: tuple[Gap, ...]
    courses: Mapping[str, Course]  # bias-x, scale-x, ...

    @cached_property
    def holds(self) -> Table:
        """The blocks of the still record."""
        return self.table.rows(_of(self.table, HOLD))

    @property
    def axes(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(course.axis for course in self.courses.values()))

    @property
    def left_out(self) -> int:
        """How many reversals are in no course."""
        all_of = {path for path in self.table.labels["path"] if path.startswith(REVERSAL)}
        return len(all_of) - len(next(iter(self.courses.values())).t_s)

    def time_s(self, axis: str = "") -> Quantity | None:
        """Steady-state time of an axis, or of all: the latest of its quantities; None where one is not reached."""
        times = [course.time_s for course in self.courses.values() if course.axis.startswith(axis)]
        reached = [time for time in times if time is not None]
        return max(reached) if len(reached) == len(times) else None

    def from_start(self, axis: str = "") -> bool:
        """Whether an axis, or all, were steady at the first reversal already."""
        states = [course.state for course in self.courses.values() if course.axis.startswith(axis)]
        return all(state is not None and state.from_start for state in states)

    @cached_property
    def temperature(self) -> SteadyState | None:
        """The approach of the temperature; None where it is not known."""
        if "temperature_c" not in self.table or not self.courses:
            return None
        course = next(iter(self.courses.values()))
        if course.state is None:
            return None
        values = np.interp(course.t_s, self.table.time_s, self.table.column("temperature_c"))
        return steady_state(course.t_s, values, np.zeros(len(values)))

    @property
    def temperature_wander_k(self) -> float | None:
        """Peak to peak of what the sensor's own warming does not explain of the temperature: the room's, the oven's."""
        if self.temperature is None:
            return None
        t_s = self.holds.time_s
        left = self.holds.column("temperature_c") - self.temperature.at(t_s)
        return float(np.ptp(left[t_s >= self.temperature.span_s[0]]))

    def noise_of_hours(self, axis: str) -> tuple[Array, Array]:
        """(middles of hours, s; rms noise of single samples within blocks, V)."""
        hour = (self.holds.time_s // HOUR_S).astype(int)
        hours = np.unique(hour)
        stds = self.holds.column(f"v{axis}_std_v")
        return (hours + 0.5) * HOUR_S, np.array([rms(stds[hour == h]) for h in hours])

    def allan(self, axis: str) -> tuple[Array, Array]:
        """(times, s; Allan deviation of the still record, V)."""
        paths, step = np.array(self.holds.labels["path"]), _lengths_s(self.holds)
        starts = self.holds.time_s - step / 2
        new = (paths[1:] != paths[:-1]) | (np.abs(np.diff(starts) - step[:-1]) > GAP_SAMPLES / _rate_hz(self.table))
        means = np.split(self.holds.column(f"v{axis}_v"), np.flatnonzero(new) + 1)
        return _pooled(means, float(np.median(step)))


def soak(table: Table, oven_c: float = 0.0) -> Soak:
    """Bias and scale factor over time.

    In an oven at `oven_c` (0: none) the approach begins when that is reached: what is measured while it heats and
    overshoots is left out.

    Raises TooFewRows where it holds no whole tumble.
    """
    gaps = _gaps(table)
    broken = {gap.path for gap in gaps}
    whole = np.array([path.startswith(REVERSAL) and path not in broken for path in table.labels["path"]])
    if oven_c and "temperature_c" in table:
        away = np.flatnonzero(np.abs(table.column("temperature_c") - oven_c) > REACHED_K)
        whole[: away[-1] + 1 if len(away) else 0] = False
    if not whole.any():
        raise TooFewRows(f"{table.source}: holds no reversal; resume the run")
    reversals = table.rows(_complete(table, whole))
    courses: dict[str, Course] = {}
    for axis in (axis for axis in table.axes if axis in AXES):
        done = tumbles(reversals, axis)
        courses |= {f"{quantity}-{axis}": _course(quantity, axis, done) for quantity in ("bias", "scale")}
    return Soak(table, gaps, courses)


def _pooled(stretches: Sequence[Array], step_s: float) -> tuple[Array, Array]:
    """(times, s; Allan deviations) at 1, 2, 4 ... steps of stretches without gaps; empty where all are too short."""
    longest = max((len(each) for each in stretches), default=0)
    steps = np.array([2**k for k in range(longest.bit_length()) if 2 * 2**k <= longest], dtype=int)
    if not len(steps):
        return np.zeros(0), np.zeros(0)
    squares = np.array([np.nan_to_num(deviations(each, steps) ** 2) for each in stretches])
    counts = np.maximum(np.array([len(each) + 1 for each in stretches])[:, None] - 2 * steps, 0)
    return step_s * steps, np.sqrt(np.sum(counts * squares, axis=0) / np.sum(counts, axis=0))


def _complete(table: Table, whole: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The rows of tumbles that have as many poses as the first: the last may still be missing some."""
    paths = np.array(table.labels["path"])
    names, counts = np.unique(paths[whole], return_counts=True)
    return np.isin(paths, names[counts == counts.max()]) & whole


def _course(quantity: str, axis: str, done: list[Tumble]) -> Course:
    t_s = np.array([each.t_s for each in done])
    if quantity == "bias":
        values, stds = np.array([(each.bias_v, each.bias_std_v) for each in done]).T
    else:
        values = np.array([each.scale_v_per_g for each in done])
        stds = values * np.array([each.scale_std for each in done])
    state = steady_state(t_s, values, stds) if len(t_s) >= FEWEST else None
    return Course(quantity, axis, t_s, values, stds, state)


def _gaps(table: Table) -> tuple[Gap, ...]:
    paths, length = table.labels["path"], _lengths_s(table)
    ends, starts = (table.time_s + length / 2)[:-1], (table.time_s - length / 2)[1:]
    within = np.array([a == b and a.startswith(HOLD) for a, b in pairwise(paths)], dtype=bool)
    allowed = np.where(within, GAP_SAMPLES / _rate_hz(table), LONGEST_MOVE_S)
    found = np.flatnonzero(starts - ends > allowed)
    return tuple(
        Gap(float(ends[i]), float(starts[i] - ends[i]), paths[i] if paths[i] == paths[i + 1] else "") for i in found
    )


def _lengths_s(table: Table) -> Array:
    return np.asarray(table.column("n") / _rate_hz(table))


def _rate_hz(table: Table) -> float:
    return table.number("sample_rate_hz", 1.0)


def _of(table: Table, kind: str) -> NDArray[np.bool_]:
    return np.array([path.startswith(kind) for path in table.labels["path"]])
