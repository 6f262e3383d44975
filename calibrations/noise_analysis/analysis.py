"""Everything about the noise of a still record, in one pass over its blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from calibrations.noise_analysis.bands import Bands, fast_bands, slow_bands
from calibrations.noise_analysis.expected import of_line, steps_of, weighted
from calibrations.noise_analysis.hidden import Hidden
from calibrations.noise_analysis.identify import (
    Mixture,
    Spectrum,
    bounded,
    estimates,
    mixture,
    most_likely_markov,
    settled,
)
from calibrations.noise_analysis.lines import MOST, Line, fast_lines, without_line
from calibrations.noise_analysis.octaves import KINDS, Curve
from calibrations.noise_analysis.oddities import Oddity, hidden_in
from calibrations.noise_analysis.processes import GAUSS_MARKOV, LINEAR, SINUSOIDAL, Sampling
from calibrations.noise_analysis.reduction import Reduction
from calibrations.noise_analysis.welch import LENGTH, Segments
from calibrations.table import Array

Estimates = Mapping[str, tuple[float, float]]
TO_BOUND = 1.96  # standard deviations


@dataclass(frozen=True)
class Coefficient:
    """One process: its most likely value, and the standard uncertainty of that. One that is not identified may as well
    be 0, and is below `upper` with 95 %, infinite where nothing is known of it. A Gauss-Markov process has a
    time constant, a sinusoid a frequency.
    """

    value: float
    std: float
    unit: str
    upper: float | None = None
    time_constant_s: float | None = None
    frequency_hz: float | None = None

    @property
    def identified(self) -> bool:
        return self.upper is None


@dataclass(frozen=True)
class NoiseAnalysis:
    """What a still record shows. `spectrum` is two-sided; lines have been taken off it, strongest first."""

    record: Record
    curves: dict[str, Curve]
    spectrum: Spectrum
    lines: tuple[Line, ...]
    found: Mixture
    line_bound: float

    @property
    def rate_hz(self) -> float:
        """Samples a second."""
        return self.record.rate_hz

    @property
    def n(self) -> int:
        """Samples."""
        return self.record.n

    @property
    def unit(self) -> str:
        """Of the values."""
        return self.record.unit

    @property
    def allan(self) -> Curve:
        """The overlapping Allan deviation."""
        return self.curves["overlapping"]

    @cached_property
    def coefficients(self) -> dict[str, Coefficient]:
        """Every process of the catalogue by its name."""
        known = estimates(self.spectrum, self.found)
        each = {name: self._linear(name, known) for name in LINEAR}
        each |= {SINUSOIDAL: self._sinusoidal(), GAUSS_MARKOV: self._gauss_markov(known)}
        hidden = hidden_in(self.record.oddities)
        return each if hidden is None else {name: _beneath(hidden, name, at) for name, at in each.items()}

    @property
    def misfit(self) -> float:
        """Of the spectrum from that of the processes: 1 where only chance is left."""
        off = self.spectrum.density / self.found.expected(self.spectrum) - 1
        return float(np.sqrt(np.mean(self.spectrum.freedom / 2 * off**2)))

    def modelled(self, tau_s: Array) -> Array:
        """Allan deviation of the processes that were identified, shape of `tau_s`."""
        steps = steps_of(tau_s, self.rate_hz)
        lines = [line.amplitude**2 * of_line(line.frequency_hz / self.rate_hz, steps) for line in self.lines]
        return np.asarray(np.sqrt(np.sum([*self.parts(tau_s).values(), *lines], axis=0)))

    def parts(self, tau_s: Array) -> dict[str, Array]:
        """Allan variance of each process that was identified, at averaging times (k,), taken to whole samples."""
        asked = [weighted(m, self.rate_hz, self.record.corner_hz) for m in steps_of(tau_s, self.rate_hz)]
        return {
            name: power * np.array([w @ at.column(name, self.found.time_constant_s) for at, w in asked])
            for name, power in self.found.power.items()
        }

    def _linear(self, name: str, known: Estimates) -> Coefficient:
        unit = self.unit + LINEAR[name].per
        if name in known:
            return Coefficient(*known[name], unit)
        value, upper = bounded(self.spectrum, self.found, name)
        return Coefficient(value, (upper - value) / TO_BOUND, unit, upper)

    def _gauss_markov(self, known: Estimates) -> Coefficient:
        found = self.found
        if GAUSS_MARKOV in known:
            return Coefficient(*known[GAUSS_MARKOV], self.unit, None, found.time_constant_s)
        time_s = most_likely_markov(self.spectrum, tuple(found.power)).time_constant_s
        value, upper = bounded(self.spectrum, found, GAUSS_MARKOV, time_s)
        return Coefficient(value, (upper - value) / TO_BOUND, self.unit, upper, time_s)

    def _sinusoidal(self) -> Coefficient:
        if not self.lines:
            return Coefficient(0.0, self.line_bound / TO_BOUND, self.unit, self.line_bound)
        line = self.lines[0]
        return Coefficient(line.amplitude, line.std, self.unit, None, None, line.frequency_hz)


def _beneath(hidden: Hidden, name: str, seen: Coefficient) -> Coefficient:
    """What is known of a process where noise is hidden below a converter's steps."""
    if not hidden.hides(name):
        return seen
    upper = hidden.white_below if name == "white-noise" else np.inf
    return Coefficient(0.0, upper / TO_BOUND, seen.unit, upper)


def analyse(blocks: Iterable[Any], rate_hz: float, unit: str, source: str, corner_hz: float = np.inf) -> NoiseAnalysis:
    """Of samples that come in blocks, shape (n,) each, in order and without gaps.

    `corner_hz` is that of a first-order filter which the output has passed, where it is known: what is faster than half
    of it is left out of the fit.

    Raises DataError naming the sample that is no number, or where all are the same; TooFewRows.
    """
    reduction = Reduction(rate_hz, corner_hz)
    for _ in reduction.read(blocks, source):
        pass
    means, segments = reduction.means, reduction.welch.segments()
    record = Record(rate_hz, reduction.n, unit, corner_hz, means.values(), means.size, segments, reduction.oddities())
    return analysed(record, {kind: reduction.octaves.curve(kind) for kind in KINDS})


@dataclass(frozen=True, eq=False)
class Record:
    """What is kept of a record: means (m,) over `size` samples each, less their mean; spectra of what is faster."""

    rate_hz: float
    n: int
    unit: str
    corner_hz: float
    means: Array
    size: int
    segments: Segments
    oddities: tuple[Oddity, ...] = ()


def analysed(record: Record, curves: dict[str, Curve]) -> NoiseAnalysis:
    """The processes of a record, and the lines in it."""
    sampling = Sampling(record.rate_hz, record.size)
    fast: list[Bands] = []
    lines: list[Line] = []
    slow_hz = 0.5 / sampling.interval_s  # what the means show; lines are looked for there where no filter is
    above_hz = min(slow_hz, record.corner_hz / 2)
    if above_hz < record.rate_hz / 2 and record.n >= 2 * LENGTH:
        seen = record.segments
        f, density, freedom = seen.frequency_hz, seen.density, seen.freedom
        density, lines = fast_lines(f, density, freedom, above_hz, record.n / record.rate_hz)
        chosen = f > slow_hz
        fast = [fast_bands(f[chosen], density[chosen], freedom, record.rate_hz, record.corner_hz)]
    spectrum, found, slow, bound = _without_lines(record.means, sampling, fast, record.corner_hz)
    strongest = sorted([*lines, *slow], key=lambda line: -line.amplitude)
    return NoiseAnalysis(record, curves, spectrum, tuple(strongest), settled(found), bound)


def _without_lines(
    values: Array, sampling: Sampling, fast: list[Bands], corner_hz: float
) -> tuple[Spectrum, Mixture, list[Line], float]:
    """(spectrum, its processes, the lines taken off, the amplitude that one more could have)."""
    lines: list[Line] = []
    while True:
        slow = slow_bands(values, sampling, corner_hz)
        spectrum = Spectrum((slow, *(part for part in fast if len(part.density))))
        found = mixture(spectrum)
        seen = without_line(values, sampling, _between(slow, found), corner_hz / 2)
        if isinstance(seen, float):
            return spectrum, found, lines, seen
        values, line = seen
        lines.append(line)
        if len(lines) == MOST:
            return spectrum, found, lines, line.amplitude


def _between(slow: Bands, found: Mixture) -> Callable[[Array], Array]:
    """The spectrum of the processes, read off at any frequency between the bands."""
    at, level = np.log(slow.frequency_hz), np.log(found.expected(slow))
    return lambda f: np.asarray(np.exp(np.interp(np.log(f), at, level)))
