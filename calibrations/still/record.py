"""A still record, reduced in one pass to what the likelihood of a noise model needs."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from calibrations.noise_analysis.octaves import Curve
from calibrations.noise_analysis.oddities import Oddity, hidden_in
from calibrations.noise_analysis.processes import Sampling
from calibrations.noise_analysis.reduction import Reduction
from calibrations.noise_analysis.welch import Segments
from calibrations.still.logged import Logged, logged
from calibrations.table import Array


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


def reduced(each: Iterable[Samples], source: str, constants: Mapping[str, str | float] | None = None) -> Still:
    """All channels, one after the other, each read once.

    Raises DataError naming a sample that is no number, or a channel that is constant or clipped; TooFewRows.
    """
    digest, channels, curves, unit = hashlib.sha256(), [], {}, ""
    for samples in each:
        reduction = Reduction(samples.rate_hz, samples.corner_hz, third_order=False)
        for values in reduction.read(samples.blocks, f"{source}, channel {samples.axis}"):
            digest.update(np.ascontiguousarray(values).tobytes())
        channels.append(_channel(samples, reduction))
        curves[samples.axis] = reduction.octaves.curve()
        unit = samples.unit
    return Still(source, unit, tuple(channels), curves, digest.hexdigest(), constants or {})


def _channel(samples: Samples, reduction: Reduction) -> Channel:
    means = reduction.means
    return Channel(
        samples.axis, samples.unit, samples.rate_hz, samples.corner_hz, reduction.n, means.values(), means.size,
        reduction.welch.segments(), columns_beside(samples.logged, reduction.n), reduction.oddities(),
    )  # fmt: skip


def columns_beside(blocks: Mapping[str, Sequence[Array]], n: int) -> dict[str, Logged]:
    """What was read beside n samples, in blocks; none of what is constant, which tells nothing."""
    every = {name: logged(each, n) for name, each in blocks.items()}
    return {name: column for name, column in every.items() if column is not None}
