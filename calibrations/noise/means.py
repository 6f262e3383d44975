"""Noise of a table's means, as a value: white, whose level is known from the samples, scatter, and slow noise.

    Sigma = W + k^2 I + (rho w)^2 G + sum s_j^2 G_j

per channel. W: the white variances of the means. k: scatter from row to row beyond the white noise. G: a Gauss-Markov
process, or flicker noise as a sum of them with time constants evenly spaced on a logarithmic scale; w the rms of white
noise and scatter. Where the white noise is not known, W is zero and k
takes its place. `noise_fit` estimates these. s_j, G_j: Gauss-Markov processes that are known from elsewhere, as from a
still record of the same sensor (`known_noise`); then no G is guessed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibrations.kernels import whiten
from calibrations.table import Array

Processes = tuple[tuple[float, float], ...]  # (standard deviation, time constant in s) of Gauss-Markov processes

BEYOND = 10.0  # lengths of a record: the longest times at which it is said to flicker
SLOW_FREEDOM = 60.0  # as a process has whose time constant is a hundredth of the record


@dataclass(frozen=True)
class Noise:
    """Noise of each mean, in the residual's unit. `white` has shape (channels, n), the others are per channel."""

    white: Array
    gap_s: Array
    scatter: Array
    ratio: Array
    taus_s: tuple[tuple[float, ...], ...]  # time constants, per channel: one, or several for flicker noise
    given: tuple[Processes, ...] = ()  # per channel, known beforehand; none where nothing is
    reference: Array | None = None  # (channels,), what errors are counted in where the white noise is not known

    @property
    def known(self) -> bool:
        """Whether the white noise is known from the samples."""
        return bool(self.white.any())

    @cached_property
    def fast(self) -> Array:
        """White noise and scatter of each mean, shape (channels, n)."""
        return np.asarray(np.hypot(self.white, self.scatter[:, None]))

    @property
    def floor(self) -> Array:
        """The noise floor: the white noise of one mean, rms over rows; the reference or scatter where not known."""
        if self.known:
            return rms(self.white)
        return self.scatter if self.reference is None else self.reference

    @property
    def tau_s(self) -> Array:
        """The longest time constant of the slow noise, s."""
        return np.array([max(taus) for taus in self.taus_s])

    @cached_property
    def slow(self) -> Array:
        """Standard deviation of the slow noise that was estimated."""
        return self.ratio * rms(self.fast)

    @property
    def known_slow(self) -> Array:
        """That of the slow noise known beforehand, about its mean over these rows."""
        return np.array(
            [_about_mean(each, float(np.sum(self.gap_s))) for each in self.given] or [0.0] * len(self.ratio)
        )

    @property
    def wander(self) -> Array:
        """Standard deviation of all slow noise, estimated and known."""
        return np.asarray(np.hypot(self.slow, self.known_slow))

    @property
    def freedom(self) -> float:
        """Degrees of freedom with which the noise is known: few where it is slow, as a record holds few long times."""
        return SLOW_FREEDOM if np.any(self.slow > 0.1 * rms(self.fast)) else float(self.white.size)

    def is_like(self, other: Noise) -> bool:
        """Whether both weigh the rows alike, scatter within 1 % of the noise."""
        same = np.array_equal(self.ratio, other.ratio) and self.taus_s == other.taus_s
        return same and bool(np.all(np.abs(rms(self.fast) / rms(other.fast) - 1) < 1e-2))

    def prolonged(self) -> Noise:
        """Flicker noise goes on at times longer than a record: with time constants up to BEYOND times its length.

        What wanders so slowly looks like a bias in the record, which is then known no better than it wanders.
        """
        taus_s, ratio = list(self.taus_s), self.ratio.copy()
        for c, taus in enumerate(self.taus_s):
            if len(taus) > 1:
                step = taus[1] / taus[0]
                more = int(np.log(BEYOND * float(np.sum(self.gap_s)) / taus[-1]) / np.log(step))
                taus_s[c] = (*taus, *(taus[-1] * step**k for k in range(1, more + 1)))
                ratio[c] *= np.sqrt(len(taus_s[c]) / len(taus))
        return replace(self, ratio=ratio, taus_s=tuple(taus_s))

    def whiten(self, columns: Array) -> Array:
        """(channels, n, k) -> (channels * n, k), each row of unit variance and independent of the others."""
        return np.concatenate([self._whiten_channel(c, columns[c])[0] for c in range(len(columns))])

    def _whiten_channel(self, c: int, columns: Array) -> tuple[Array, float]:
        given = self.given[c] if self.given else ()
        return correlated(columns, self.gap_s, self.fast[c], float(self.slow[c]), self.taus_s[c], given)

    @cached_property
    def logdet(self) -> float:
        """log det Sigma over all channels."""
        empty = np.zeros((self.white.shape[1], 0))
        return sum(self._whiten_channel(c, empty)[1] for c in range(len(self.white)))


def correlated(
    columns: Array, gap_s: Array, fast: Array, slow: float, taus_s: tuple[float, ...], given: Processes = ()
) -> tuple[Array, float]:
    """Columns (n, k) of one channel made white, and log det Sigma."""
    stds, times_s = (np.array(values) for values in zip(*processes(slow, taus_s, given), strict=True))
    out, logdet = whiten(np.ascontiguousarray(columns), gap_s, fast, stds, times_s)
    return out, float(logdet)


def processes(slow: float, taus_s: tuple[float, ...], given: Processes = ()) -> Processes:
    """Those that make up slow noise of a standard deviation, evenly shared, and those that are given."""
    std = slow / len(taus_s) ** 0.5
    return (*((std, tau_s) for tau_s in taus_s if slow or not given), *given)


def _about_mean(processes: Processes, span_s: float) -> float:
    """Standard deviation of processes about their mean over a time."""
    if not span_s:
        return 0.0
    shares = [(std**2, tau_s / span_s) for std, tau_s in processes]
    return float(np.sqrt(sum(v * (1 - 2 * x + 2 * x * x * -np.expm1(-1 / x)) for v, x in shares)))


def rms(x: Array) -> Array:
    """Root mean square along the last axis."""
    return np.asarray(np.sqrt(np.mean(x * x, axis=-1)))


def white_only(white: Array | None, gap_s: Array, channels: int, given: tuple[Processes, ...] = ()) -> Noise:
    """The noise before anything is fitted."""
    ones = np.ones(channels)
    if white is None:
        return Noise(np.zeros((channels, len(gap_s))), gap_s, ones, 0 * ones, ((1.0,),) * channels, given)
    return Noise(white, gap_s, 0 * ones, 0 * ones, ((1.0,),) * channels, given)
