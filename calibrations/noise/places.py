"""Where a noise model fails: averaging times, frequencies, and parts of the record.

averaging times   Allan deviations at neighbouring times share samples, so their chances are not independent. Each is
                  compared with the limit divided by their number (Bonferroni), which holds for any dependence.
                  Neighbours that fail on the same side are one place.
frequencies       Bands are independent chi-squared variables, and so is a stretch of them. Stretches of all lengths
                  are tested; the chance allows for their number.
parts             The record is cut into parts. The faster ordinates of each part give its noise level, whatever its
                  trend; a likelihood ratio compares the levels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy.fft import dct
from scipy.special import chdtr, chdtrc

from calibrations.criteria import FEWEST_LEVEL_ORDINATES, NEGLIGIBLE, SIGNIFICANT
from calibrations.discovery.results import Place
from calibrations.errors import DataError
from calibrations.model import Model
from calibrations.noise.allan import DeviationComparison, compare_deviations
from calibrations.noise.channel_spectrum import Line, means_without
from calibrations.noise.fit import NoiseFit, noise_terms, without_effects
from calibrations.noise.likelihood import ChannelFit, Values, effect_lines
from calibrations.noise.record import Channel, Still
from calibrations.table import Array

# Where a spectrum differs from a model's: the stretches of frequency whose power is no chance.
#
# Bands are independent chi-square variables, so a stretch of them is one as well. Stretches of all lengths are looked
# at,
# and their number is allowed for.

LENGTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96)  # bands to a stretch
PEAK = 0.371  # cycles to an averaging time at which an Allan variance listens most


@dataclass(frozen=True)
class Stretch:
    """From `low_hz` to `high_hz` the density is `ratio` times that of the model, by a chance that allows for all."""

    axis: str
    low_hz: float
    high_hz: float
    ratio: float
    deviations: float
    chance: float

    @property
    def tau_s(self) -> tuple[float, float]:
        """The averaging times that it shows at."""
        return PEAK / self.high_hz, PEAK / self.low_hz

    @property
    def text(self) -> str:
        """In words."""
        low, high = self.tau_s
        many = f"{self.ratio:.3g} x" if self.ratio > 1 else f"only {self.ratio:.2g} x"
        where = f"{self.low_hz:.3g} to {self.high_hz:.3g} Hz" if self.high_hz > self.low_hz else f"{self.low_hz:.4g} Hz"
        return (
            f"{self.axis} has {many} the power of the model at {where} (averaging times of {low:.2g} to {high:.2g} s)"
        )


def stretches(found: ChannelFit, most: int = 3) -> list[Stretch]:
    """Those that differ most certainly, none of which overlap, surest first; with chances of 1 where none does."""
    order = np.argsort(found.frequency_hz)
    f, nu = found.frequency_hz[order], found.freedom[order]
    power = nu * (found.seen / found.expected)[order]
    sums = [np.concatenate([[0.0], np.cumsum(x)]) for x in (nu, power)]
    tried = []
    for length in (each for each in LENGTHS if each <= len(f)):
        freedom, got = (x[length:] - x[:-length] for x in sums)
        chance = 2 * np.minimum(chdtr(freedom, got), chdtrc(freedom, got))
        chance = np.where(np.abs(got / freedom - 1) < NEGLIGIBLE, 1.0, chance)
        tried += [
            (float(p), k, k + length, float(g / n))
            for k, (p, g, n) in enumerate(zip(chance, got, freedom, strict=True))
        ]
    tried.sort(key=lambda each: (each[0], -abs(np.log(each[3])) * (sums[0][each[2]] - sums[0][each[1]])))
    chosen: list[tuple[float, int, int, float]] = []
    for each in tried:
        if len(chosen) == most:
            break
        if all(each[2] <= other[1] or each[1] >= other[2] for other in chosen):
            chosen.append(each)
    return [
        Stretch(
            found.channel.axis, float(f[a]), float(f[b - 1]), ratio,
            float((ratio - 1) * np.sqrt((sums[0][b] - sums[0][a]) / 2)), min(1.0, p * len(tried)),
        )
        for p, a, b, ratio in chosen
    ]  # fmt: skip


TIME, FREQUENCY = "averaging time", "frequency"


def places(found: NoiseFit) -> tuple[Place, ...]:
    """Where a noise model fails: surest first, times before frequencies of the same channel."""
    curves = tuple(compare_deviations(each, found.still.allan[each.channel.axis]) for each in found.channels)
    return tuple(_failures(found, curves))


def evaluate(model: Model, still: Still) -> NoiseFit | None:
    """The model with the values that it has; None where it has none. Raises DataError for a channel that it has not."""
    terms = noise_terms(model)
    if not model.params:
        return None
    known = {(term.name, e.axis, e.name): e.value for term in terms for e in term.estimates}
    axes = {axis for _, axis, _ in known}
    if missing := [channel.axis for channel in still.channels if channel.axis not in axes]:
        raise DataError(
            f"{still.source}: {model.name} has values for the axes {', '.join(sorted(axes))}, and none for "
            f"{', '.join(missing)}; fit it to this record, or name a channel with --channel"
        )
    channels = []
    for channel in still.channels:
        values = {
            term.name: {
                name: v for (effect, axis, name), v in known.items() if (effect, axis) == (term.name, channel.axis)
            }
            for term in terms
        }
        lines = tuple(line for term in terms for line in effect_lines(term.effect, values[term.name]))
        channels.append(_with_values(channel, lines, values, model))
    return NoiseFit(still, replace(model, unit=still.unit), tuple(channels), fitted=False)


def _with_values(channel: Channel, lines: tuple[Line, ...], values: dict[str, Values], model: Model) -> ChannelFit:
    effects = tuple(term.effect for term in noise_terms(model) if "spectrum" in term.effect.places)
    given = tuple(effect for effect in effects if all(p.name in values[effect.name] for p in effect.parameters))
    return replace(without_effects(channel, lines), effects=given, values={e.name: values[e.name] for e in given})


def _failures(found: NoiseFit, curves: tuple[DeviationComparison, ...]) -> list[Place]:
    """Surest first, times before frequencies of the same channel."""
    limit = SIGNIFICANT / (2 * len(curves))
    places = [place for each, curve in zip(found.channels, curves, strict=True) for place in _times(each, curve, limit)]
    places += [
        Place(FREQUENCY, each.low_hz, each.high_hz, each.axis, abs(each.deviations), each.text)
        for channel in found.channels
        for each in stretches(channel)
        if each.chance < limit
    ]
    return sorted(places, key=lambda place: -place.excess)


def _times(found: ChannelFit, curve: DeviationComparison, limit: float) -> list[Place]:
    """Stretches of neighbouring averaging times that fail on the same side."""
    off = (curve.chance < limit / len(curve.tau_s)) & (np.abs(curve.ratio - 1) > NEGLIGIBLE)
    side = np.where(off, np.sign(curve.ratio - 1), 0).astype(int)
    places = []
    for sign, group in groupby(range(len(side)), key=lambda k: side[k]):
        rows = list(group)
        if sign:
            worst = max(rows, key=lambda k: abs(float(curve.deviations[k])))
            excess = float(np.sqrt(np.mean(curve.deviations[rows] ** 2)))
            low, high = float(curve.tau_s[rows[0]]), float(curve.tau_s[rows[-1]])
            places.append(Place(TIME, low, high, found.channel.axis, excess, _text(found, curve, low, high, worst)))
    return places


def _text(found: ChannelFit, curve: DeviationComparison, low: float, high: float, worst: int) -> str:
    span = f"{low:.4g} s" if low == high else f"{low:.4g} to {high:.4g} s"
    unit, axis = found.channel.unit, found.channel.axis
    return (
        f"averaging times of {span}: the Allan deviation of {axis} is {curve.ratio[worst]:.3g} x that of the model at "
        f"{curve.tau_s[worst]:.4g} s ({curve.measured[worst]:.3g} {unit} for {curve.modelled[worst]:.3g}), "
        f"{abs(curve.deviations[worst]):.3g} standard deviations off"
    )


# Whether the level of a record's noise is the same all along.
#
# The record is cut into parts. The faster ordinates of each tell its level, whatever its trend; they are compared by
# their likelihood ratio.

PARTS = 8
TREND_SHARE = 0.25  # of a part's ordinates, that tell of its trend


@dataclass(frozen=True)
class Levels:
    """The level of one channel's noise in equal parts of its record, as multiples of their mean, and the chance that
    they differ so."""

    axis: str
    levels: Array
    part_s: float
    chance: float

    @property
    def ratio(self) -> float:
        """Of the highest to the lowest."""
        return float(self.levels.max() / self.levels.min())

    @property
    def text(self) -> str:
        """In words."""
        start_s = int(np.argmax(self.levels)) * self.part_s
        return (
            f"the level of {self.axis} changes with time, by a factor of {self.ratio:.3g}: it is highest from "
            f"{start_s:.4g} to {start_s + self.part_s:.4g} s"
        )


def noise_levels(found: ChannelFit) -> Levels | None:
    """Of one channel; None where its record is too short to tell."""
    channel = found.channel
    means, step_s = means_without(channel, found.lines), channel.sampling.interval_s
    length = len(means) // PARTS
    f = np.arange(1, length) / (2 * max(length, 1) * step_s)
    highest_hz = min(channel.highest_hz, 0.5 / step_s)
    told = (f > TREND_SHARE * highest_hz) & (f < highest_hz)
    if np.count_nonzero(told) < FEWEST_LEVEL_ORDINATES:
        return None
    parts = means[: PARTS * length].reshape(PARTS, length)
    power = dct(parts, type=2, norm="ortho", axis=1)[:, 1:][:, told] ** 2 * step_s
    each = (power / found.level(f[told])).mean(axis=1)
    ratio = each / each.mean()
    gain = float(np.count_nonzero(told) * np.sum(ratio - 1 - np.log(ratio)))
    return Levels(channel.axis, np.sqrt(ratio), length * step_s, float(chdtrc(PARTS - 1, gain)))
