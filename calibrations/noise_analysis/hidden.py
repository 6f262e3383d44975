"""Whether noise is hidden below the steps of the converter that read it.

Rounding adds an error of its own, of a twelfth of a step's square, to noise of half a step or more, whatever the mean;
with less noise what is seen depends on where the mean lies between two steps: nothing, or a step too much. So noise is
hidden where it and that error, as they reach the converter, come to less than those of half a step. Noise that is slow,
and over many samples comes to more, shows nevertheless.

Source  Widrow and Kollar, Quantization Noise: the quantising theorem, and dither of half a step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calibrations.noise_analysis.octaves import Curve
from calibrations.table import Array

HALF = 0.5  # of a step: noise that rounding leaves as it is
LEAST = HALF**2 + 1 / 12  # of a step's square: such noise, and what rounding adds
SOON = 64  # samples within which noise has to come to that
BEHIND = 4.0  # periods of a low-pass after which noise averages as if there were none
FASTEST = ("white-noise", "quantisation-noise")  # what is hidden at least


@dataclass(frozen=True)
class Hidden:
    """Noise below a converter's `step`, over so many `levels`; white noise is below the coefficient `white_below`.

    `all`: whether what is slow is hidden too.
    """

    step: float
    levels: int
    white_below: float
    all: bool

    @property
    def text(self) -> str:
        """In words, with what to do."""
        at = f"{self.levels} values" if self.all else "values"
        slow = "" if self.all else "; what is slow comes to more, and is told"
        fast = "" if self.all else ", from sample to sample,"
        return (
            f"the noise{fast} is below the converter's step: the samples are at {at} {self.step:.4g} apart, and no "
            f"still record that is read so tells its level{slow}: amplify the output, take a smaller range or a finer "
            "converter, or add noise of half a step or more (dither)"
        )

    def hides(self, process: str) -> bool:
        """Whether a process of the catalogue cannot be told."""
        return self.all or process in FASTEST


class Steps:
    """The step and the range of the values so far; blocks are added in order, `hidden` is asked at the end."""

    def __init__(self) -> None:
        self._last, self._step = np.nan, np.inf
        self._low, self._high = np.inf, -np.inf

    def add(self, samples: Array) -> None:
        """The next samples, shape (n,)."""
        if not len(samples):
            return
        between = np.abs(np.diff(samples, prepend=self._last))
        self._step = float(np.min(between, where=between > 0, initial=self._step))
        self._low, self._high = min(self._low, float(samples.min())), max(self._high, float(samples.max()))
        self._last = float(samples[-1])

    def hidden(self, curve: Curve, rate_hz: float, corner_hz: float) -> Hidden | None:
        """By the Allan deviations of the samples, behind a first-order low-pass; None where noise is not hidden."""
        limit = LEAST * self._step**2
        if not np.isfinite(self._step) or _reaching(curve, rate_hz, corner_hz) >= limit:
            return None
        below = HALF * self._step / float(np.sqrt(min(rate_hz, np.pi * corner_hz)))
        levels = round((self._high - self._low) / self._step) + 1
        return Hidden(self._step, levels, below, bool(np.max(curve.deviation**2) < limit))


def hidden_step(values: Array) -> float | None:
    """The step that hides the noise of values (n,), whatever is slow in it; None where none does."""
    between = np.abs(np.diff(values))
    step = float(np.min(between, where=between > 0, initial=np.inf))
    return step if np.isfinite(step) and np.mean(between**2) / 2 < LEAST * step**2 else None


def _reaching(curve: Curve, rate_hz: float, corner_hz: float) -> float:
    """The variance of noise, as it reaches the converter within some samples, or behind its low-pass."""
    variance = curve.deviation**2
    soon = float(np.max(variance[curve.tau_s <= SOON / rate_hz]))
    if not np.isfinite(corner_hz):
        return soon
    at = min(int(np.searchsorted(curve.tau_s, BEHIND / corner_hz)), len(variance) - 1)
    return max(soon, float(variance[at] * curve.tau_s[at]) * min(rate_hz, np.pi * corner_hz))
