"""One channel beside a noise model: what is seen, what is expected, and by how much they differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtri, digamma

from calibrations.effect import Effect
from calibrations.noise_analysis.bands import Bands
from calibrations.noise_analysis.whittle import log_likelihood
from calibrations.still.bands import Lines
from calibrations.still.record import Channel
from calibrations.table import Array

Values = dict[str, float]
LEAST = 1e-18  # of the greatest density: rounding


@dataclass(frozen=True)
class ChannelFit:
    """One channel beside a model: the lines taken off, and the values of every effect. Arrays over all bands (b,)."""

    channel: Channel
    parts: tuple[Bands, ...]
    lines: Lines
    effects: tuple[Effect, ...]  # those with a spectrum
    values: Mapping[str, Values]
    line_bound: float = 0.0  # amplitude that one more line might have

    @cached_property
    def seen(self) -> Array:
        """Density; no band is quite without power."""
        seen = np.concatenate([part.density for part in self.parts])
        return np.asarray(np.maximum(seen, LEAST * seen.max()))

    @cached_property
    def freedom(self) -> Array:
        """Degrees of freedom of each band."""
        return np.concatenate([part.freedom for part in self.parts])

    @cached_property
    def frequency_hz(self) -> Array:
        """Of each band."""
        return np.concatenate([part.frequency_hz for part in self.parts])

    def part_of(self, effect: Effect, values: Values | None = None) -> Array:
        """What is expected of one effect."""
        return spectrum_of(effect, self.parts, self.values[effect.name] if values is None else values)

    @cached_property
    def expected(self) -> Array:
        """The model's density."""
        total = sum((self.part_of(effect) for effect in self.effects), np.zeros(len(self.seen)))
        return np.asarray(np.maximum(total, LEAST * self.seen.max()))

    def interval(self, coverage: float) -> tuple[Array, Array]:
        """(lowest, highest) density: between them the model expects this part of what is seen."""
        low, high = (chdtri(self.freedom, (1 + side * coverage) / 2) for side in (1, -1))
        return self.expected * low / self.freedom, self.expected * high / self.freedom

    def level(self, frequency_hz: Array) -> Array:
        """The model's density of the means, read off between the bands."""
        at, level = self.parts[0].frequency_hz, self.expected[: len(self.parts[0].density)]
        return np.asarray(np.exp(np.interp(np.log(frequency_hz), np.log(at), np.log(level))))

    @cached_property
    def log_likelihood(self) -> float:
        """Up to a constant of the bands."""
        return float(log_likelihood(self.expected, self.seen, self.freedom))

    @cached_property
    def deviance(self) -> float:
        """Twice the log-likelihood that a spectrum of its own in each band would gain."""
        ratio = self.seen / self.expected
        return float(np.sum(self.freedom * (ratio - 1 - np.log(ratio))))

    @cached_property
    def by_chance(self) -> float:
        """The deviance that a complete model is expected to leave."""
        return float(np.sum(self.freedom * (np.log(self.freedom / 2) - digamma(self.freedom / 2))))

    @property
    def excess(self) -> float:
        """Rms mismatch over that which chance alone leaves: 1 for a complete model."""
        return float(np.sqrt(self.deviance / self.by_chance))

    @property
    def mismatch(self) -> float:
        """Rms difference of the spectrum from the model's, as a share of it, bands weighted by what they tell."""
        return float(np.sqrt(2 * self.deviance / np.sum(self.freedom)))

    @property
    def floor(self) -> float:
        """The mismatch that chance alone leaves."""
        return float(np.sqrt(2 * self.by_chance / np.sum(self.freedom)))


def spectrum_of(effect: Effect, parts: Sequence[Bands], values: Values) -> Array:
    """Two-sided density that an effect makes in all bands."""
    made = [np.asarray(effect.spectrum(part, values), dtype=float) for part in parts] if effect.spectrum else []
    return np.concatenate(made)
