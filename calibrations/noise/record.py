"""A still record, reduced in one pass and in constant memory to what the likelihood of a noise model needs.

A column that is logged with the sensor (temperature, supply) is kept as read and without its reader's own scatter. The
sensor does not feel that scatter, and a regression on the readings underestimates the slope (attenuation). The true
level is modelled as a power-law process, read with white scatter; its best estimate (Wiener filter) is diagonal in the
cosine transform, and a regression on it is not attenuated. If the sensor feels the scatter too, the readings fit
better, and the likelihood decides. The uncertain amount of scatter adds to the uncertainty of a slope (`doubt`).

Source  Carroll et al., Measurement Error in Nonlinear Models, chapter 4: regression calibration.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.fft import dct, idct
from scipy.optimize import minimize_scalar

from calibrations.criteria import FEWEST_ORDINATES, FEWEST_SAMPLES
from calibrations.errors import DataError, TooFewRows
from calibrations.noise.deviations import OCTAVE_KINDS, OVERLAPPING, Curve, Octaves
from calibrations.noise.samples import Ends, Oddity, Outliers, Steps, Stuck, hidden_in, oddities
from calibrations.spectrum import Means, Sampling, Segments, Welch
from calibrations.table import Array

HOUR_S = 3600.0
LOG_RATIOS = (-12.0, 16.0)  # of the variances of scatter and of a level's steps, that are looked through
SLOPES = (0.5, 1.0, 1.5, 2.0)  # of a level's spectrum in powers of the frequency: 1 flickers, 2 walks
NODES = ((-(3**0.5), 1 / 6), (0.0, 2 / 3), (3**0.5, 1 / 6))  # of a normal distribution, and weights (Gauss, Hermite)
CURVATURE_STEP = 0.1  # of the logarithm of a ratio: a step in which the likelihood is a parabola
FLAT = 2.0  # least curvature: a ratio is known to a factor of e, or its likelihood is no parabola


@dataclass(frozen=True, eq=False)
class Logged:
    """Means (m,) of a column, over as many samples as the channel's, less their mean. `level`: without scatter.

    `doubt`: relative standard uncertainty of a slope on the level, as the amount of scatter is uncertain.
    """

    read: Array
    level: Array
    doubt: float

    def part(self, which: slice) -> Logged:
        """Some of the record, which is a record of its own."""
        read, level = (values[which] - values[which].mean() for values in (self.read, self.level))
        return Logged(read, level, self.doubt)


def logged_column(blocks: Sequence[Array], n: int) -> Logged | None:
    """A column read with n samples, in blocks; None where it is constant or of another length."""
    means, readings, last = Means(), 0, np.nan
    for block in blocks:
        means.add(block)
        readings += int(np.count_nonzero(np.diff(block, prepend=last)))
        last = block[-1] if len(block) else last
    read = means.values()
    if sum(map(len, blocks)) != n or np.ptp(read) == 0:
        return None
    return Logged(read, *without_scatter(read, readings))


def without_scatter(read: Array, readings: int) -> tuple[Array, float]:
    """The level beneath the scatter of a column's means (m,), of which each of so many `readings` holds until the next.

    Also the doubt of a slope on it. Frequencies above those of the readings say nothing of their scatter, and are left
    out.
    """
    m = len(read)
    k = np.arange(1, min(m, readings))
    if len(k) < FEWEST_ORDINATES:
        return read, 0.0
    seen = dct(read, type=2, norm="ortho")[k]
    held, turn = max(1.0, m / readings), np.pi * k / (2 * m)
    power = (seen * held * np.sin(turn) / np.sin(held * turn)) ** 2  # as if none had been held
    share, doubt = _level_share(power, 2 * np.sin(turn), seen**2)
    kept = np.zeros(m)
    kept[k] = seen * share
    return np.asarray(idct(kept, type=2, norm="ortho")), doubt


def _level_share(power: Array, frequency: Array, weight: Array) -> tuple[Array, float]:
    """The level's share of each ordinate (k,), the mean over spectra by how likely they are.

    Also by how much the slope of what follows the level would be off where another spectrum is true, relative and rms.
    """
    spectra = [_Spectrum.of(power, frequency**-slope) for slope in SLOPES]
    likeliest = min(each.unlikely for each in spectra)
    odds = [each.std * float(np.exp((likeliest - each.unlikely) / 2)) for each in spectra]  # by Laplace
    chances = np.outer(odds, [chance for _, chance in NODES]).ravel()
    shares = np.array([each.share(stds) for each in spectra for stds, _ in NODES])
    share = np.average(shares, axis=0, weights=chances)
    off = shares @ (share * weight) / (share**2 @ weight) - 1
    return np.asarray(share), float(np.sqrt(np.average(off**2, weights=chances)))


@dataclass(frozen=True, eq=False)
class _Spectrum:
    """A level's spectrum (k,) with scatter beside it, at their likeliest ratio."""

    level: Array
    log_ratio: float  # of the variance of the scatter to that of the level's steps
    std: float  # of the logarithm
    unlikely: float  # twice the negative log-likelihood

    @classmethod
    def of(cls, power: Array, level: Array) -> _Spectrum:
        """By the power that was seen (k,). Where nothing scatters the likelihood is flat, and so is the share."""
        found = minimize_scalar(_deviance_of_ratio, bounds=LOG_RATIOS, args=(power, level), method="bounded")
        beside = sum(_deviance_of_ratio(found.x + step, power, level) for step in (-CURVATURE_STEP, CURVATURE_STEP))
        curvature = (beside - 2 * found.fun) / CURVATURE_STEP**2
        return cls(level, float(found.x), float(np.sqrt(2 / max(curvature, FLAT))), float(found.fun))

    def share(self, stds: float) -> Array:
        """The level's share of each ordinate (k,), where the ratio is so many standard deviations higher."""
        return np.asarray(self.level / (self.level + np.exp(self.log_ratio + stds * self.std)))


def _deviance_of_ratio(log_ratio: float, power: Array, level: Array) -> float:
    """Twice the negative log-likelihood of a level with scatter, at its best scale."""
    both = level + np.exp(log_ratio)
    return float(len(power) * np.log(np.mean(power / both)) + np.sum(np.log(both)))


# A still record of any length, reduced in one pass to all that its noise is told from.


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
        """Add the samples, shape (n,) each, in order and without gaps; every block is returned as float64.

        Raises DataError naming the sample that is no number, or where the channel is constant or clipped; TooFewRows.
        """
        odd = self._ends, self._outliers, self._stuck, self._steps
        for block in blocks:
            samples = require_numbers(np.asarray(block), self.n, source)
            for each in (self.octaves, self.means, self.welch, *odd):
                each.add(samples)
            yield samples
        require_length(self.n, self.rate_hz, self.corner_hz, source)
        self._ends.check(source)

    def oddities(self) -> tuple[Oddity, ...]:
        """Samples that are not noise, and noise below the converter's step."""
        curve = self.octaves.curve()
        hidden = self._steps.hidden(curve, self.rate_hz, self.corner_hz)
        between = float(curve.deviation[0] ** 2)
        return oddities(self._outliers.found(), self._stuck.found(), hidden, self.n, self.rate_hz, between)


def require_length(n: int, rate_hz: float, corner_hz: float, source: str) -> None:
    """Raises TooFewRows for a record that is too short to show noise, behind a filter or without one."""
    if n < FEWEST_SAMPLES:
        raise TooFewRows(
            f"{source}: {n} samples; the noise of a record needs {FEWEST_SAMPLES} or more: record for longer"
        )
    if corner_hz * n < FEWEST_SAMPLES * rate_hz:
        raise TooFewRows(
            f"{source}: {n / rate_hz:.3g} s are too short behind a low-pass of {corner_hz:g} Hz, which lets "
            f"through little noise in that time: record for {FEWEST_SAMPLES / corner_hz:.3g} s or more"
        )


def require_numbers(samples: Array, before: int, source: str) -> Array:
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


# A still record, reduced in one pass to what the likelihood of a noise model needs.


@dataclass(frozen=True, eq=False)
class Channel:
    """One output: its means (m,) less their mean, and the spectra of what is faster.

    `corner_hz` is that of the output's first-order low-pass, infinite where there is none or it is not known.
    """

    axis: str
    unit: str
    rate_hz: float
    corner_hz: float
    n: int
    means: Array
    size: int  # samples to a mean
    segments: Segments
    logged: Mapping[str, Logged] = field(default_factory=dict)  # by column
    oddities: tuple[Oddity, ...] = ()

    @property
    def sampling(self) -> Sampling:
        """Of the means."""
        return Sampling(self.rate_hz, self.size)

    @property
    def length_s(self) -> float:
        """Of the record."""
        return self.n / self.rate_hz

    @property
    def highest_hz(self) -> float:
        """Up to which its spectrum is fitted: behind a filter the converter's own noise begins to show beyond."""
        return min(self.rate_hz / 2, self.corner_hz / 2)

    def halves(self) -> tuple[Channel, Channel]:
        """The first and the second half of the record, each a record of its own."""
        middle, parts = len(self.means) // 2, len(self.segments.stretches)
        return (
            self._part(slice(None, middle), self.segments.part(0, parts // 2)),
            self._part(slice(middle, None), self.segments.part(parts // 2, parts)),
        )

    def _part(self, which: slice, segments: Segments) -> Channel:
        means = self.means[which]
        logged = {name: column.part(which) for name, column in self.logged.items()}
        return replace(self, n=len(means) * self.size, means=means - means.mean(), segments=segments, logged=logged)


@dataclass(frozen=True)
class Sensed:
    """An output as what is sensed: multiplied with `factor` it is in `unit`, such as 1.02 g for a V."""

    factor: float
    unit: str


@dataclass(frozen=True, eq=False)
class Still:
    """A still record of one sensor: its channels, and the overlapping Allan deviation of each by its axis.

    `sensed` is of those axes whose scale factor is known.
    """

    source: str
    unit: str
    channels: tuple[Channel, ...]
    allan: Mapping[str, Curve]
    digest: str  # SHA-256 of all samples
    constants: Mapping[str, str | float] = field(default_factory=dict)  # what is known of the sensor
    sensed: Mapping[str, Sensed] = field(default_factory=dict)
    deviations: Mapping[str, Mapping[str, Curve]] = field(default_factory=dict)  # by axis and kind

    @property
    def n(self) -> int:
        """Samples of a channel."""
        return self.channels[0].n

    @property
    def rate_hz(self) -> float:
        """Samples a second."""
        return self.channels[0].rate_hz

    @property
    def length_s(self) -> float:
        """From the first sample to the last."""
        return self.channels[0].length_s

    @property
    def hidden(self) -> bool:
        """Whether the noise of every channel is below its converter's step."""
        each = [hidden_in(channel.oddities) for channel in self.channels]
        return all(hidden is not None and hidden.all for hidden in each)

    @property
    def axes(self) -> tuple[str, ...]:
        """Of the channels."""
        return tuple(channel.axis for channel in self.channels)


@dataclass(frozen=True)
class Samples:
    """One channel's samples in blocks (n,) each, in order, and what is known of them."""

    axis: str
    blocks: Iterable[Any]
    rate_hz: float
    unit: str
    corner_hz: float = np.inf
    logged: Mapping[str, Sequence[Array]] = field(default_factory=dict)  # columns beside it, known when it was read
    name: str = ""  # of the channel in the data, for messages; the axis if empty


def reduce_record(
    each: Iterable[Samples],
    source: str,
    constants: Mapping[str, str | float] | None = None,
    every_deviation: bool = False,
) -> Still:
    """All channels, one after the other, each read once.

    `every_deviation`: with the modified, Hadamard and total deviations, which take as long again.

    Raises DataError naming a sample that is no number, or a channel that is constant or clipped; TooFewRows.
    """
    digest, channels, unit = hashlib.sha256(), [], ""
    curves: dict[str, dict[str, Curve]] = {}
    for samples in each:
        reduction = Reduction(samples.rate_hz, samples.corner_hz, every_deviation)
        for values in reduction.read(samples.blocks, f"{source}, channel {samples.name or samples.axis}"):
            digest.update(np.ascontiguousarray(values).tobytes())
        channels.append(_channel(samples, reduction))
        kinds = OCTAVE_KINDS if every_deviation else (OVERLAPPING,)
        curves[samples.axis] = {kind: reduction.octaves.curve(kind) for kind in kinds}
        unit = samples.unit
    allan = {axis: kinds[OVERLAPPING] for axis, kinds in curves.items()}
    return Still(source, unit, tuple(channels), allan, digest.hexdigest(), constants or {}, deviations=curves)


def _channel(samples: Samples, reduction: Reduction) -> Channel:
    means = reduction.means
    return Channel(
        samples.axis, samples.unit, samples.rate_hz, samples.corner_hz, reduction.n, means.values(), means.size,
        reduction.welch.segments(), logged_columns(samples.logged, reduction.n), reduction.oddities(),
    )  # fmt: skip


def logged_columns(blocks: Mapping[str, Sequence[Array]], n: int) -> dict[str, Logged]:
    """Columns read with n samples, in blocks, without constant ones."""
    every = {name: logged_column(each, n) for name, each in blocks.items()}
    return {name: column for name, column in every.items() if column is not None}


def of_record(still: Still) -> str:
    """The record in words: samples, rate, length."""
    hours = still.length_s / HOUR_S
    length = f"{hours:.3g} h" if hours >= 1 else f"{still.length_s:.4g} s"
    return f"{still.n} samples of {still.source} at {still.rate_hz:.6g} Hz ({length})"
