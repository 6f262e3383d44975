"""A soak: bias and scale factor of each axis in the hours after power-on, and the record at rest between reversals.

The table has a row for each pose of a tumble (path `reversal k`) and for each block of the still record (`hold k`).
A gap is a time without data: any within a hold, and elsewhere a time longer than a move. A tumble with a gap is left
out, because drift no longer cancels in it.

The approach of a quantity to its steady state is a sum of exponentials. The steady-state time is the first time after
which the remaining drift stays within the expanded uncertainty (k = 2) of one measured value, slow noise included.
After it no measurement separates the remaining drift from noise. It is not reached if it is after the end of the
record, or if the time constant of the noise is as long as the record.

Source  Ang III.B, Fig. 10: about 7 h, 2 to 12 h over eight axes; JCGM 100, 5.1: propagation, 6.2: expanded
        uncertainty.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calibrations.analyses.exponential_approach import Series, model_derivatives, remaining_drift
from calibrations.analyses.tumble import Tumble, estimate_tumbles
from calibrations.criteria import (
    COVERAGE_FACTOR,
    EXPONENTIAL_GAIN,
    FEWEST_APPROACH_VALUES,
    FEWEST_STEADY_VALUES,
    LIKELY_WALK,
    LONGEST_HOLD_GAP,
    LONGEST_MOVE_S,
    MOST_EXPONENTIALS,
    REACHED_K,
    SPARE_VALUES,
)
from calibrations.errors import TooFewRows
from calibrations.means.noise import rms
from calibrations.noise.deviations import deviations
from calibrations.table import Array, Table, std_column

REVERSAL, HOLD = "reversal", "hold"  # first words of the paths
AXES = "xy"
HOUR_S = 3600.0
TIME_POINTS = 4000  # of time among which the steady state is looked for
RELATIVE_STEP = 1e-4  # of a parameter, for a slope

Quantity = tuple[float, float]  # a value and its standard error


@dataclass(frozen=True)
class Exponential:
    """One exponential: amplitude at the first value, in the unit of the values, and time constant, s."""

    amplitude: Quantity
    tau_s: Quantity


@dataclass(frozen=True)
class SteadyState:
    """The approach of one quantity to its steady state.

    parameters   (y_end, A_1 .., ln tau_1 ..), slowest first, and their covariance
    noise        standard deviation of one value, slow noise included
    wanders      the noise is a random walk over the record: there is no final value
    span_s       first and last time of the record, since power-on
    freedom      values beyond the parameters
    """

    parameters: Array
    covariance: Array
    noise: float
    wanders: bool
    span_s: tuple[float, float]
    freedom: int

    @property
    def terms(self) -> tuple[Exponential, ...]:
        """The exponentials, slowest first; none where nothing drifts."""
        k, std = (len(self.parameters) - 1) // 2, np.sqrt(np.diag(self.covariance))
        taus_s = np.exp(self.parameters[1 + k :])
        return tuple(
            Exponential(
                (float(self.parameters[1 + j]), float(std[1 + j])),
                (float(taus_s[j]), float(taus_s[j] * std[1 + k + j])),
            )
            for j in range(k)
        )

    @property
    def final(self) -> Quantity:
        """The final value."""
        return float(self.parameters[0]), float(np.sqrt(self.covariance[0, 0]))

    @property
    def tolerance(self) -> float:
        """The expanded uncertainty of one value."""
        return COVERAGE_FACTOR * self.noise

    @property
    def drift(self) -> Quantity:
        """Change of the fitted value from the first to the last time; 0 without a significant drift."""
        if not self.terms:
            return 0.0, float(np.sqrt(2) * self.noise)
        first, last = model_derivatives(self.parameters, np.array(self.span_s) - self.span_s[0])
        start_value, end_value = self.at(np.array(self.span_s))
        return float(end_value - start_value), float(np.sqrt((last - first) @ self.covariance @ (last - first)))

    @property
    def from_start(self) -> bool:
        """Whether the first value is already steady."""
        return self.time_s is not None and self.time_s[0] == self.span_s[0]

    @property
    def time_s(self) -> Quantity | None:
        """Steady-state time since power-on; None if it is not reached, or if there are too few values for it.

        Its standard error is that of the exponentials, and of the noise that sets the tolerance. Where nothing drifts
        it is the record's start, at the latest: rectangular since power-on.
        """
        ln_tolerance = np.log(self.tolerance)
        value = self._last_time_out_of_tolerance(self.parameters, ln_tolerance)
        too_few = not self.terms and self.freedom + 1 < FEWEST_STEADY_VALUES
        if self.wanders or too_few or value > self.span_s[1]:
            return None
        if value == self.span_s[0]:
            return value, value / np.sqrt(12.0)
        nudges = RELATIVE_STEP * np.diag(np.where(self.parameters == 0, 1.0, np.abs(self.parameters)))
        derivatives = np.array(
            [
                (
                    self._last_time_out_of_tolerance(self.parameters + d, ln_tolerance)
                    - self._last_time_out_of_tolerance(self.parameters - d, ln_tolerance)
                )
                / (2 * d.sum())
                for d in nudges
            ]
        )
        by_noise = (
            self._last_time_out_of_tolerance(self.parameters, ln_tolerance + RELATIVE_STEP)
            - self._last_time_out_of_tolerance(self.parameters, ln_tolerance - RELATIVE_STEP)
        ) / (2 * RELATIVE_STEP)
        return value, float(np.sqrt(derivatives @ self.covariance @ derivatives + by_noise**2 / (2 * self.freedom)))

    def at(self, t_s: Array) -> Array:
        """The fitted value at times since power-on, shape (n,)."""
        return np.asarray(self.parameters[0] + remaining_drift(self.parameters, t_s - self.span_s[0]))

    def std_at(self, t_s: Array) -> Array:
        """Standard error of the fitted value, shape (n,)."""
        derivatives = model_derivatives(self.parameters, t_s - self.span_s[0])
        return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", derivatives, self.covariance, derivatives)))

    def _last_time_out_of_tolerance(self, p: Array, ln_tolerance: float) -> float:
        """The last time at which the remaining drift exceeds the tolerance, else the start of the record."""
        k, (start, end) = (len(p) - 1) // 2, self.span_s
        if not k:
            return start
        lengths = np.exp(p[1 + k :]) * (np.log(k * np.abs(p[1 : 1 + k])) - ln_tolerance)
        t_s = np.linspace(start, max(end, start + float(lengths.max())), TIME_POINTS)
        log_excess = np.log(np.abs(remaining_drift(p, t_s - start)) + 1e-300) - ln_tolerance
        beyond_times = np.flatnonzero(log_excess > 0)
        if not len(beyond_times):
            return start
        i = min(int(beyond_times[-1]), TIME_POINTS - 2)
        return float(t_s[i] + (t_s[i + 1] - t_s[i]) * log_excess[i] / (log_excess[i] - log_excess[i + 1]))


def fit_steady_state(t_s: Array, values: Array, stds: Array) -> SteadyState:
    """The approach of `values` with white standard errors `stds` (0: not known) at times since power-on, shape (n,).

    Each exponential must gain EXPONENTIAL_GAIN. Raises TooFewRows for fewer than FEWEST_APPROACH_VALUES.
    """
    if len(t_s) < FEWEST_APPROACH_VALUES:
        raise TooFewRows(
            f"{len(t_s)} reversals cannot separate drift from noise; at least {FEWEST_APPROACH_VALUES} are needed"
        )
    middle, unit = float(values.mean()), float(values.std()) or 1.0
    series = Series(t_s - t_s[0], (values - middle) / unit, stds / unit)
    most = min(MOST_EXPONENTIALS, (len(t_s) - 1 - SPARE_VALUES) // 2)
    candidates = [series.likeliest(k) for k in range(most + 1)]
    start_values, _ = min(candidates, key=lambda candidate: candidate[1] + EXPONENTIAL_GAIN * (len(candidate[0]) // 2))
    best = series.averaged(start_values)
    k = (len(best.parameters) - 1) // 2
    size = np.array([unit] * (1 + k) + [1.0] * k)
    parameters = best.parameters * size
    parameters[0] += middle
    return SteadyState(
        parameters,
        best.covariance * np.outer(size, size),
        best.noise * unit,
        best.wandering > LIKELY_WALK,
        (float(t_s[0]), float(t_s[-1])),
        len(t_s) - len(parameters),
    )


@dataclass(frozen=True)
class QuantityHistory:
    """One quantity of one axis at each reversal, in V or V/g, with white standard errors; times since power-on, s.

    No `state` if there are too few reversals to separate drift from noise.
    """

    quantity: str  # bias or scale
    axis: str
    t_s: Array
    values: Array
    stds: Array
    state: SteadyState | None

    @property
    def time_s(self) -> Quantity | None:
        """The steady-state time since power-on; None where it is not reached or not known."""
        return self.state.time_s if self.state else None


@dataclass(frozen=True)
class RecordGap:
    """A time without data: its start since power-on and its length, s."""

    start_s: float
    length_s: float
    path: str


@dataclass(frozen=True)
class Soak:
    """Results of a soak's table. Times since power-on, s."""

    table: Table
    gaps: tuple[RecordGap, ...]
    courses: Mapping[str, QuantityHistory]  # bias-x, scale-x, ...

    @cached_property
    def holds(self) -> Table:
        """The blocks of the still record."""
        return self.table.rows(np.array([path.startswith(HOLD) for path in self.table.labels["path"]]))

    @property
    def axes(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(course.axis for course in self.courses.values()))

    @property
    def left_out(self) -> int:
        """Number of reversals in no course."""
        all_of = {path for path in self.table.labels["path"] if path.startswith(REVERSAL)}
        return len(all_of) - len(next(iter(self.courses.values())).t_s)

    def time_s(self, axis: str = "") -> Quantity | None:
        """Steady-state time of an axis, or of all: the latest of its quantities; None where one is not reached."""
        times = [course.time_s for course in self.courses.values() if course.axis.startswith(axis)]
        reached = [time for time in times if time is not None]
        return max(reached) if len(reached) == len(times) else None

    def from_start(self, axis: str = "") -> bool:
        """Whether an axis, or all, is steady from the first reversal."""
        states = [course.state for course in self.courses.values() if course.axis.startswith(axis)]
        return all(state is not None and state.from_start for state in states)

    @cached_property
    def temperature(self) -> SteadyState | None:
        """The approach of the temperature; None where it is unknown."""
        if "temperature_c" not in self.table or not self.courses:
            return None
        course = next(iter(self.courses.values()))
        if course.state is None:
            return None
        values = np.interp(course.t_s, self.table.time_s, self.table.column("temperature_c"))
        return fit_steady_state(course.t_s, values, np.zeros(len(values)))

    @property
    def temperature_wander_k(self) -> float | None:
        """Peak to peak temperature after subtraction of the sensor's warm-up: that of the room or the oven."""
        if self.temperature is None:
            return None
        t_s = self.holds.time_s
        residual = self.holds.column("temperature_c") - self.temperature.at(t_s)
        return float(np.ptp(residual[t_s >= self.temperature.span_s[0]]))

    def noise_of_hours(self, axis: str) -> tuple[Array, Array]:
        """(middles of hours, s; rms noise of single samples within blocks, V)."""
        hour = (self.holds.time_s // HOUR_S).astype(int)
        hours = np.unique(hour)
        stds = self.holds.column(std_column(self.holds.output_name(axis)))
        return (hours + 0.5) * HOUR_S, np.array([rms(stds[hour == h]) for h in hours])

    def allan(self, axis: str) -> tuple[Array, Array]:
        """(times, s; Allan deviation of the still record, V)."""
        paths, step = np.array(self.holds.labels["path"]), _lengths_s(self.holds)
        starts = self.holds.time_s - step / 2
        new = (paths[1:] != paths[:-1]) | (
            np.abs(np.diff(starts) - step[:-1]) > LONGEST_HOLD_GAP / _rate_hz(self.table)
        )
        means = np.split(self.holds.output(axis), np.flatnonzero(new) + 1)
        return _pool_deviations(means, float(np.median(step)))


def analyse_soak(table: Table, oven_c: float = 0.0) -> Soak:
    """Bias and scale factor over time.

    With an oven at `oven_c` (0: none) the approach begins when that temperature is reached; earlier data are left out.

    Raises TooFewRows without a complete tumble.
    """
    gaps = _gaps(table)
    broken = {gap.path for gap in gaps}
    usable = np.array([path.startswith(REVERSAL) and path not in broken for path in table.labels["path"]])
    if oven_c and "temperature_c" in table:
        off_target = np.flatnonzero(np.abs(table.column("temperature_c") - oven_c) > REACHED_K)
        usable[: off_target[-1] + 1 if len(off_target) else 0] = False
    if not usable.any():
        raise TooFewRows(f"{table.source}: has no reversal yet; resume the run")
    reversals = table.rows(_complete(table, usable))
    courses: dict[str, QuantityHistory] = {}
    for axis in (axis for axis in table.axes if axis in AXES):
        tumbles = estimate_tumbles(reversals, axis)
        courses |= {f"{quantity}-{axis}": _course(quantity, axis, tumbles) for quantity in ("bias", "scale")}
    return Soak(table, gaps, courses)


def _pool_deviations(stretches: Sequence[Array], step_s: float) -> tuple[Array, Array]:
    """(times, s; Allan deviations) at 1, 2, 4 ... steps of stretches without gaps; empty where all are too short."""
    longest = max((len(stretch) for stretch in stretches), default=0)
    steps = np.array([2**k for k in range(longest.bit_length()) if 2 * 2**k <= longest], dtype=int)
    if not len(steps):
        return np.zeros(0), np.zeros(0)
    squares = np.array([np.nan_to_num(deviations(stretch, steps) ** 2) for stretch in stretches])
    counts = np.maximum(np.array([len(stretch) + 1 for stretch in stretches])[:, None] - 2 * steps, 0)
    return step_s * steps, np.sqrt(np.sum(counts * squares, axis=0) / np.sum(counts, axis=0))


def _complete(table: Table, usable: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The rows of tumbles that have as many poses as the first: the last may still be missing some."""
    paths = np.array(table.labels["path"])
    names, counts = np.unique(paths[usable], return_counts=True)
    return np.isin(paths, names[counts == counts.max()]) & usable


def _course(quantity: str, axis: str, tumbles: list[Tumble]) -> QuantityHistory:
    t_s = np.array([tumble.t_s for tumble in tumbles])
    if quantity == "bias":
        values, stds = np.array([(tumble.bias_v, tumble.bias_std_v) for tumble in tumbles]).T
    else:
        values = np.array([tumble.scale_v_per_g for tumble in tumbles])
        stds = np.abs(values) * np.array([tumble.scale_std for tumble in tumbles])
    state = fit_steady_state(t_s, values, stds) if len(t_s) >= FEWEST_APPROACH_VALUES else None
    return QuantityHistory(quantity, axis, t_s, values, stds, state)


def _gaps(table: Table) -> tuple[RecordGap, ...]:
    paths, length = table.labels["path"], _lengths_s(table)
    ends, starts = (table.time_s + length / 2)[:-1], (table.time_s - length / 2)[1:]
    same_hold = np.array([a == b and a.startswith(HOLD) for a, b in pairwise(paths)], dtype=bool)
    longest_s = np.where(same_hold, LONGEST_HOLD_GAP / _rate_hz(table), LONGEST_MOVE_S)
    gaps = np.flatnonzero(starts - ends > longest_s)
    return tuple(
        RecordGap(float(ends[i]), float(starts[i] - ends[i]), paths[i] if paths[i] == paths[i + 1] else "")
        for i in gaps
    )


def _lengths_s(table: Table) -> Array:
    return np.asarray(table.column("n") / _rate_hz(table))


def _rate_hz(table: Table) -> float:
    return table.number("sample_rate_hz", 1.0)
