"""Steady state after switching on: when it is reached, how far the output drifts until then, and how fast.

The steady-state time is the first after which what is left to come stays within the expanded uncertainty (k = 2) of one
measured value, slow noise included: from then on no measurement tells the rest of the drift from noise. It is not
reached where it lies beyond the record, or where the noise wanders for as long as the record.

Source  Ang III.B, Fig. 10: about 7 h, 2 to 12 h over eight axes; JCGM 100, 5.1: propagation, 6.2: expanded uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.errors import TooFewRows
from calibrations.evaluations.exponential_approach import Series, decay, slopes
from calibrations.table import Array

COVERAGE = 2.0
FEWEST = 8  # values that tell an approach from noise
FEWEST_AT_REST = 20  # values that show that nothing drifts: fewer take a drift for slow noise
FREE = 4  # values beyond parameters that another exponential needs
GAIN = 24.0  # of twice the log-likelihood that another exponential must bring: a random walk seldom does
MOST = 2  # exponentials
SURE = 0.5  # probability of a random walk above which there is no steady state
POINTS = 4000  # of time among which the steady state is looked for
NUDGE = 1e-4  # of a parameter, for a slope

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
        """The value that it comes to."""
        return float(self.parameters[0]), float(np.sqrt(self.covariance[0, 0]))

    @property
    def tolerance(self) -> float:
        """The expanded uncertainty of one value."""
        return COVERAGE * self.noise

    @property
    def drift(self) -> Quantity:
        """Change of the fitted value from the first time to the last; none, to the noise, where nothing stands out."""
        if not self.terms:
            return 0.0, float(np.sqrt(2) * self.noise)
        first, last = slopes(self.parameters, np.array(self.span_s) - self.span_s[0])
        before, after = self.at(np.array(self.span_s))
        return float(after - before), float(np.sqrt((last - first) @ self.covariance @ (last - first)))

    @property
    def from_start(self) -> bool:
        """Whether nothing is left to come at the first value already."""
        return self.time_s is not None and self.time_s[0] == self.span_s[0]

    @property
    def time_s(self) -> Quantity | None:
        """Steady-state time since power-on; None where it is not reached, or where too few values would show it.

        Its standard error is that of the exponentials, and of the noise that sets the tolerance. Where nothing drifts
        it is the record's start, at the latest: rectangular since power-on.
        """
        at = np.log(self.tolerance)
        value = self._last_beyond(self.parameters, at)
        too_few = not self.terms and self.freedom + 1 < FEWEST_AT_REST
        if self.wanders or too_few or value > self.span_s[1]:
            return None
        if value == self.span_s[0]:
            return value, value / np.sqrt(12.0)
        nudges = NUDGE * np.diag(np.where(self.parameters == 0, 1.0, np.abs(self.parameters)))
        by = np.array(
            [
                (self._last_beyond(self.parameters + d, at) - self._last_beyond(self.parameters - d, at))
                / (2 * d.sum())
                for d in nudges
            ]
        )
        by_noise = (self._last_beyond(self.parameters, at + NUDGE) - self._last_beyond(self.parameters, at - NUDGE)) / (
            2 * NUDGE
        )
        return value, float(np.sqrt(by @ self.covariance @ by + by_noise**2 / (2 * self.freedom)))

    def at(self, t_s: Array) -> Array:
        """The fitted value at times since power-on, shape (n,)."""
        return np.asarray(self.parameters[0] + decay(self.parameters, t_s - self.span_s[0]))

    def std_at(self, t_s: Array) -> Array:
        """Its standard error, shape (n,)."""
        by = slopes(self.parameters, t_s - self.span_s[0])
        return np.asarray(np.sqrt(np.einsum("ni,ij,nj->n", by, self.covariance, by)))

    def _last_beyond(self, p: Array, ln_tolerance: float) -> float:
        """The last time at which what is left to come exceeds the tolerance; the record's start where none does."""
        k, (start, end) = (len(p) - 1) // 2, self.span_s
        if not k:
            return start
        lengths = np.exp(p[1 + k :]) * (np.log(k * np.abs(p[1 : 1 + k])) - ln_tolerance)
        t_s = np.linspace(start, max(end, start + float(lengths.max())), POINTS)
        over = np.log(np.abs(decay(p, t_s - start)) + 1e-300) - ln_tolerance
        above = np.flatnonzero(over > 0)
        if not len(above):
            return start
        i = min(int(above[-1]), POINTS - 2)
        return float(t_s[i] + (t_s[i + 1] - t_s[i]) * over[i] / (over[i] - over[i + 1]))


def steady_state(t_s: Array, values: Array, stds: Array) -> SteadyState:
    """The approach of `values` with white standard errors `stds` (0: not known) at times since power-on, shape (n,).

    Each exponential must bring GAIN. Raises TooFewRows for fewer than FEWEST values.
    """
    if len(t_s) < FEWEST:
        raise TooFewRows(f"{len(t_s)} reversals tell no drift from noise; at least {FEWEST} are needed")
    middle, unit = float(values.mean()), float(values.std()) or 1.0
    series = Series(t_s - t_s[0], (values - middle) / unit, stds / unit)
    most = min(MOST, (len(t_s) - 1 - FREE) // 2)
    candidates = [series.likeliest(k) for k in range(most + 1)]
    chosen, _ = min(candidates, key=lambda each: each[1] + GAIN * (len(each[0]) // 2))
    best = series.averaged(chosen)
    k = (len(best.parameters) - 1) // 2
    size = np.array([unit] * (1 + k) + [1.0] * k)
    parameters = best.parameters * size
    parameters[0] += middle
    return SteadyState(
        parameters,
        best.covariance * np.outer(size, size),
        best.noise * unit,
        best.wandering > SURE,
        (float(t_s[0]), float(t_s[-1])),
        len(t_s) - len(parameters),
    )
