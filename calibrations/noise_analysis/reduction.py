"""A still record of any length, reduced in one pass to all that its noise is told from."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from calibrations.errors import DataError, TooFewRows
from calibrations.noise_analysis.clipping import Ends
from calibrations.noise_analysis.decimated import Means
from calibrations.noise_analysis.hidden import Steps
from calibrations.noise_analysis.octaves import Octaves
from calibrations.noise_analysis.oddities import Oddity, oddities
from calibrations.noise_analysis.outliers import Outliers
from calibrations.noise_analysis.stuck import Stuck
from calibrations.noise_analysis.welch import Welch
from calibrations.table import Array

FEWEST = 64  # samples below which nothing can be said


class Reduction:
    """Deviations at octave times, means, spectra of what is faster, and what samples are odd; in constant memory.

    `corner_hz` is that of a first-order filter which the output has passed, infinite where there is none; `third_order`
    is for modified and Hadamard deviations.
    """

    def __init__(self, rate_hz: float, corner_hz: float = np.inf, third_order: bool = True) -> None:
        self.rate_hz, self.corner_hz = rate_hz, corner_hz
        self.octaves, self.means, self.welch = Octaves(rate_hz, third_order), Means(), Welch(rate_hz)
        self._ends, self._outliers, self._stuck, self._steps = Ends(), Outliers(), Stuck(), Steps()

    @property
    def n(self) -> int:
        """Samples so far."""
        return self.octaves.n

    def read(self, blocks: Iterable[Any], source: str) -> Iterable[Array]:
        """Take in the samples, shape (n,) each, in order and without gaps; every block is handed on as float64.

        Raises DataError naming the sample that is no number, or where the channel is constant or clipped; TooFewRows.
        """
        odd = self._ends, self._outliers, self._stuck, self._steps
        for block in blocks:
            samples = checked(np.asarray(block), self.n, source)
            for each in (self.octaves, self.means, self.welch, *odd):
                each.add(samples)
            yield samples
        check_length(self.n, self.rate_hz, self.corner_hz, source)
        self._ends.check(source)

    def oddities(self) -> tuple[Oddity, ...]:
        """Samples that are no noise, and noise that the samples do not show."""
        curve = self.octaves.curve()
        hidden = self._steps.hidden(curve, self.rate_hz, self.corner_hz)
        between = float(curve.deviation[0] ** 2)
        return oddities(self._outliers.found(), self._stuck.found(), hidden, self.n, self.rate_hz, between)


def check_length(n: int, rate_hz: float, corner_hz: float, source: str) -> None:
    """Raises TooFewRows for a record that is too short to show noise, behind a filter or without one."""
    if n < FEWEST:
        raise TooFewRows(f"{source}: {n} samples; the noise of a record needs {FEWEST} or more: record for longer")
    if corner_hz * n < FEWEST * rate_hz:
        raise TooFewRows(
            f"{source}: {n / rate_hz:.3g} s are too short behind a low-pass of {corner_hz:g} Hz, which lets "
            f"through little noise in that time: record for {FEWEST / corner_hz:.3g} s or more"
        )


def checked(samples: Array, before: int, source: str) -> Array:
    """As float64. Raises DataError where one is no number."""
    try:
        samples = samples.astype(np.float64, casting="same_kind" if samples.dtype.kind == "f" else "safe")
    except TypeError:
        raise DataError(f"{source}: holds {samples.dtype}, not real numbers; save one column of real numbers") from None
    finite = np.isfinite(samples)
    if not finite.all():
        row = int(np.argmin(finite))
        raise DataError(
            f"{source}: sample {before + row + 1} is {samples[row]:g}, not a number; "
            "cut the record there and analyse a part without gaps"
        )
    return samples
