"""A still record, reduced in one pass and in constant memory for the likelihood of a noise model.

A column that is logged with the sensor (temperature, supply) is kept as read and without its reader's own scatter
(`estimators.scatter`). If the sensor feels the scatter too, the readings fit better, and the likelihood decides. The
uncertain amount of scatter adds to the uncertainty of a slope (`doubt`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from calibrations.criteria import FEWEST_SAMPLES
from calibrations.errors import DataError, TooFewRows
from calibrations.estimators.scatter import without_scatter
from calibrations.model import Term
from calibrations.noise.deviations import OCTAVE_KINDS, OVERLAPPING, DeviationCurve, Octaves
from calibrations.noise.samples import Ends, Oddity, Outliers, StepAndRange, Stuck, hidden_in, oddities
from calibrations.spectrum import Means, Sampling, Segments, Welch
from calibrations.table import Array

HOUR_S = 3600.0


@dataclass(frozen=True, eq=False)
class Logged:
    """Means (m,) of a column, over as many samples as the channel's, less their `mean`. `level`: without scatter.

    `doubt`: relative standard uncertainty of a slope on the level, as the amount of scatter is uncertain.
    """

    read: Array
    level: Array
    doubt: float
    mean: float = 0.0

    def part(self, span: slice) -> Logged:
        """A part of the record, as a record of its own."""
        readings, level = (values[span] - values[span].mean() for values in (self.read, self.level))
        return Logged(readings, level, self.doubt, self.mean + float(self.read[span].mean()))


def logged_column(blocks: Sequence[Array], n: int) -> Logged | None:
    """A column read with n samples, in blocks; None where it is constant or of another length."""
    means, readings, last = Means(), 0, np.nan
    for block in blocks:
        means.add(block)
        readings += int(np.count_nonzero(np.diff(block, prepend=last)))
        last = block[-1] if len(block) else last
    means_read = means.values()
    if sum(map(len, blocks)) != n or np.ptp(means_read) == 0:
        return None
    mean = sum(float(np.sum(block)) for block in blocks) / n
    level = without_scatter(means_read, readings)
    return Logged(means_read, level.values, level.doubt, mean)


# A still record of any length, reduced in one pass to the values that determine its noise.


class Reduction:
    """Deviations at octave times, means, spectra of what is faster, and what samples are odd; in constant memory.

    `corner_hz` is that of a first-order filter which the output has passed, infinite where there is none; `third_order`
    is for modified and Hadamard deviations.
    """

    def __init__(self, rate_hz: float, corner_hz: float = np.inf, third_order: bool = True) -> None:
        self.rate_hz, self.corner_hz = rate_hz, corner_hz
        self.octaves, self.means, self.welch = Octaves(rate_hz, third_order), Means(), Welch(rate_hz)
        self._ends, self._outliers, self._stuck, self._steps = Ends(), Outliers(), Stuck(), StepAndRange()

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
            for statistic in (self.octaves, self.means, self.welch, *odd):
                statistic.add(samples)
            yield samples
        require_length(self.n, self.rate_hz, self.corner_hz, source)
        self._ends.check(source)

    def oddities(self) -> tuple[Oddity, ...]:
        """Samples that are not noise, and noise below the converter's step."""
        curve = self.octaves.curve()
        hidden_noise = self._steps.hidden(curve, self.rate_hz, self.corner_hz)
        neighbour_variance = float(curve.deviation[0] ** 2)
        return oddities(
            self._outliers.found(), self._stuck.found(), hidden_noise, self.n, self.rate_hz, neighbour_variance
        )


def require_length(n: int, rate_hz: float, corner_hz: float, source: str) -> None:
    """Raises TooFewRows for a record that is too short to show noise, behind a filter or without one."""
    if n < FEWEST_SAMPLES:
        raise TooFewRows(
            f"{source}: {n} samples; the noise of a record needs {FEWEST_SAMPLES} or more: record for longer"
        )
    if corner_hz * n < FEWEST_SAMPLES * rate_hz:
        raise TooFewRows(
            f"{source}: {n / rate_hz:.3g} s are too short after a low-pass of {corner_hz:g} Hz, which "
            f"passes too little noise in that time: record for {FEWEST_SAMPLES / corner_hz:.3g} s or more"
        )


def require_numbers(samples: Array, count_before: int, source: str) -> Array:
    """Convert the samples to float64. Raises DataError for a value that is not a number."""
    try:
        samples = samples.astype(np.float64, casting="same_kind" if samples.dtype.kind == "f" else "safe")
    except TypeError:
        raise DataError(f"{source}: holds {samples.dtype}, not real numbers; save one column of real numbers") from None
    finite = np.isfinite(samples)
    if not finite.all():
        row = int(np.argmin(finite))
        raise DataError(
            f"{source}: sample {count_before + row + 1} is {samples[row]:g}, not a number; "
            "cut the record there and analyse a part without gaps"
        )
    return samples


# A still record, reduced in one pass for the likelihood of a noise model.


@dataclass(frozen=True, eq=False)
class Channel:
    """One output: its means (m,) less their mean, and the spectra of the faster part.

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
        """Sampling of the means."""
        return Sampling(self.rate_hz, self.size)

    @property
    def length_s(self) -> float:
        """Length of the record."""
        return self.n / self.rate_hz

    @property
    def highest_hz(self) -> float:
        """The highest frequency of the fit: beyond it, a filter leaves only the converter's own noise."""
        return min(self.rate_hz / 2, self.corner_hz / 2)

    def halves(self) -> tuple[Channel, Channel]:
        """The first and the second half of the record, each a record of its own."""
        middle, parts = len(self.means) // 2, len(self.segments.stretches)
        return (
            self._part(slice(None, middle), self.segments.part(0, parts // 2)),
            self._part(slice(middle, None), self.segments.part(parts // 2, parts)),
        )

    def _part(self, span: slice, segments: Segments) -> Channel:
        means = self.means[span]
        logged = {name: column.part(span) for name, column in self.logged.items()}
        return replace(self, n=len(means) * self.size, means=means - means.mean(), segments=segments, logged=logged)


@dataclass(frozen=True)
class Sensed:
    """Conversion of an output to the sensed quantity: output times `factor` is in `unit`, such as 1.02 g for 1 V."""

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
    allan: Mapping[str, DeviationCurve]
    digest: str  # SHA-256 of all samples
    constants: Mapping[str, str | float] = field(default_factory=dict)  # constants of the sensor
    sensed: Mapping[str, Sensed] = field(default_factory=dict)
    deviations: Mapping[str, Mapping[str, DeviationCurve]] = field(default_factory=dict)  # by axis and kind
    signal: tuple[Term, ...] = ()  # of a model, taken off the means

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
        """Time from the first sample to the last."""
        return self.channels[0].length_s

    @property
    def hidden(self) -> bool:
        """Whether the noise of every channel is below its converter's step."""
        hidden_of_channels = [hidden_in(channel.oddities) for channel in self.channels]
        return all(channel_noise is not None and channel_noise.all for channel_noise in hidden_of_channels)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(channel.axis for channel in self.channels)


@dataclass(frozen=True)
class Samples:
    """One channel's samples in blocks (n,) each, in order, and their rate, unit and filter."""

    axis: str
    blocks: Iterable[Any]
    rate_hz: float
    unit: str
    corner_hz: float = np.inf
    logged: Mapping[str, Sequence[Array]] = field(default_factory=dict)  # columns beside it, known when it was read
    name: str = ""  # of the channel in the data, for messages; the axis if empty


def reduce_record(
    records: Iterable[Samples],
    source: str,
    constants: Mapping[str, str | float] | None = None,
    every_deviation: bool = False,
) -> Still:
    """All channels, one after the other, each read once.

    `every_deviation`: with the modified, Hadamard and total deviations, which take as long again.

    Raises DataError naming a sample that is no number, or a channel that is constant or clipped; TooFewRows.
    """
    digest, channels, unit = hashlib.sha256(), [], ""
    curves: dict[str, dict[str, DeviationCurve]] = {}
    for samples in records:
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
    columns = {name: logged_column(block, n) for name, block in blocks.items()}
    return {name: column for name, column in columns.items() if column is not None}


def of_record(still: Still) -> str:
    """The record in words: samples, rate, length."""
    hours = still.length_s / HOUR_S
    length = f"{hours:.3g} h" if hours >= 1 else f"{still.length_s:.4g} s"
    return f"{still.n} samples of {still.source} at {still.rate_hz:.6g} Hz ({length})"
