"""A noise model compared with a record: the Allan deviation that it expects, and where it fails.

    sigma^2(m) = int S(f) 2 sin^4(pi f m dt) / (m sin(pi f dt))^2 df        over all frequencies of the sampled process

This is exact at one sample too, where formulas of continuous time are wrong by up to a half. Behind a filter, times
below a few periods of its corner are not compared: there the noise of the converter dominates.

averaging times   Allan deviations at neighbouring times share samples, so their chances are not independent. Each is
                  compared with the limit divided by their number (Bonferroni), which holds for any dependence.
                  Neighbours that fail on the same side are one place.
frequencies       Bands are independent chi-squared variables, and so is a stretch of them. Stretches of all lengths
                  are tested; the chance allows for their number.
parts             The record is cut into parts. The faster ordinates of each part give its noise level, whatever its
                  trend; a likelihood ratio compares the levels.

Source  NIST SP 1065, 3.2; Percival and Walden, Spectral Analysis for Physical Applications, 8.6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy.fft import dct
from scipy.special import chdtr, chdtrc, digamma, polygamma

from calibrations.criteria import FEWEST_LEVEL_ORDINATES, FILTER_PERIODS, NEGLIGIBLE, SIGNIFICANT
from calibrations.discovery.findings import Place
from calibrations.errors import DataError
from calibrations.model import Model
from calibrations.noise.deviations import DeviationCurve
from calibrations.noise.fit import NoiseFit, noise_terms, without_effects
from calibrations.noise.likelihood import ChannelFit, Values, effect_lines, effect_spectrum
from calibrations.noise.lines import SpectralLine, means_without
from calibrations.noise.record import Channel, Still
from calibrations.noise.signal import signal_terms, without_signal
from calibrations.spectrum import Bands, Sampling
from calibrations.table import Array

NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)
SLOWEST = 1e-7  # in cycles to an averaging time
MANY_CYCLES = 8.0  # cycles beyond which a fourth power of a sine is its mean
MEAN = 3 / 8


def steps_of(tau_s: Array, rate_hz: float) -> Array:
    """Averaging times in whole samples, shape of `tau_s`."""
    return np.asarray(np.maximum(1, np.round(tau_s * rate_hz)))


def quadrature(m: float, rate_hz: float, corner_hz: float) -> tuple[Bands, Array]:
    """Frequencies at which spectra are asked, and what to add them up with to a variance at `m` samples, (k,)."""
    cycles, width = _nodes(m / 2)
    f = cycles * rate_hz / m
    sine = np.sin(np.pi * f / rate_hz)
    power = np.where(cycles < MANY_CYCLES, np.sin(np.pi * cycles) ** 4, MEAN)
    none = np.zeros(len(f))
    bands = Bands(f, none, none, Sampling(rate_hz), none, corner_hz)
    return bands, 2 * width * rate_hz / m * 2 * power / (m * sine) ** 2


def line_variance(turns: float, m: Array) -> Array:
    """Variance at `m` samples of a sinusoid of unit amplitude, `turns` of it to a sample."""
    return np.asarray(np.sin(np.pi * turns * m) ** 4 / (m * np.sin(np.pi * turns)) ** 2)


def _nodes(end: float) -> tuple[Array, Array]:
    """Gauss's nodes and weights from 0 to `end` cycles, in panels: fine where the sine turns, else by decades."""
    fine = np.arange(0.25, min(end, MANY_CYCLES) + 0.25, 0.25)
    slow, fast = np.geomspace(SLOWEST, 0.25, 30), np.geomspace(MANY_CYCLES, max(end, MANY_CYCLES), 60)
    edges = np.unique(np.concatenate([[0.0], slow, fine, fast]))
    edges = np.append(edges[edges < end], end)
    half = np.diff(edges)[:, None] / 2
    return ((edges[:-1, None] + half) + half * NODES).ravel(), (half * WEIGHTS).ravel()


@dataclass(frozen=True)
class DeviationComparison:
    """Measured and expected deviations at the times that are judged (k,), with the chance of each ratio."""

    tau_s: Array
    measured: Array
    low: Array
    high: Array
    modelled: Array
    edf: Array
    chance: Array  # two-sided, of a variance ratio as far from 1

    @property
    def ratio(self) -> Array:
        """Measured over modelled deviation."""
        return self.measured / self.modelled

    @property
    def deviations(self) -> Array:
        """The deviation of the variance from that of the model, in standard deviations."""
        return np.asarray((self.ratio**2 - 1) * np.sqrt(self.edf / 2))

    @property
    def mismatch(self) -> float:
        """Rms of the logarithm of the ratio, each time weighted by its degrees of freedom."""
        return float(np.sqrt(np.average(np.log(self.ratio) ** 2, weights=self.edf)))

    @property
    def by_chance(self) -> float:
        """The mismatch that chance alone leaves: of half the logarithm of chi-square over its degrees of freedom."""
        half = self.edf / 2
        square = (polygamma(1, half) + (digamma(half) - np.log(half)) ** 2) / 4
        return float(np.sqrt(np.average(square, weights=self.edf)))


def compare_deviations(fit: ChannelFit, curve: DeviationCurve) -> DeviationComparison:
    """The measured curve and that of the model. A variance is distributed as chi-square over its degrees of freedom."""
    is_tested = curve.tau_s >= (FILTER_PERIODS / fit.channel.corner_hz if np.isfinite(fit.channel.corner_hz) else 0.0)
    tau_s, measured, edf = curve.tau_s[is_tested], curve.deviation[is_tested], curve.edf[is_tested]
    modelled = deviation(fit, tau_s)
    scaled = edf * (measured / modelled) ** 2
    chance = np.minimum(1.0, 2 * np.minimum(chdtr(edf, scaled), chdtrc(edf, scaled)))
    return DeviationComparison(tau_s, measured, curve.low[is_tested], curve.high[is_tested], modelled, edf, chance)


def compared_deviations(fit: NoiseFit) -> dict[str, DeviationComparison]:
    """The deviations of each channel, by axis, after the removal of the model's signal."""
    return {pair.channel.axis: compare_deviations(pair, fit.still.allan[pair.channel.axis]) for pair in fit.channels}


def mismatch(fit: NoiseFit) -> dict[str, float]:
    """Rms of the logarithm of measured over modelled Allan deviation, by axis."""
    return {axis: curve.mismatch for axis, curve in compared_deviations(fit).items()}


def deviation(fit: ChannelFit, tau_s: Array) -> Array:
    """Allan deviation of all effects and lines, shape of `tau_s`."""
    total = sum(variance_parts(fit, tau_s).values(), np.zeros(len(tau_s)))
    return np.asarray(np.sqrt(np.maximum(total, np.finfo(float).tiny)))


def variance_parts(fit: ChannelFit, tau_s: Array) -> dict[str, Array]:
    """The variance that each effect makes at averaging times (k,), which are taken to whole samples."""
    rate_hz, steps = fit.channel.rate_hz, steps_of(tau_s, fit.channel.rate_hz)
    quadratures = [quadrature(m, rate_hz, fit.channel.corner_hz) for m in steps]
    parts = {
        effect.name: np.array(
            [w @ effect_spectrum(effect, (bands,), fit.values[effect.name]) for bands, w in quadratures]
        )
        for effect in fit.effects
    }
    for line in fit.lines:
        parts[f"{line.frequency_hz:.4g} Hz"] = line.amplitude**2 * line_variance(line.frequency_hz / rate_hz, steps)
    return parts


LENGTHS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96)  # bands to a stretch
PEAK = 0.371  # cycles to an averaging time at which an Allan variance listens most


@dataclass(frozen=True)
class Stretch:
    """A band from `low_hz` to `high_hz` in which the density is `ratio` times that of the model."""

    axis: str
    low_hz: float
    high_hz: float
    ratio: float
    deviations: float
    chance: float

    @property
    def tau_s(self) -> tuple[float, float]:
        """The averaging times at which the difference shows."""
        return PEAK / self.high_hz, PEAK / self.low_hz

    @property
    def text(self) -> str:
        """The band and its ratio, as a sentence."""
        low, high = self.tau_s
        ratio_text = f"{self.ratio:.3g} x" if self.ratio > 1 else f"only {self.ratio:.2g} x"
        band_text = (
            f"{self.low_hz:.3g} to {self.high_hz:.3g} Hz" if self.high_hz > self.low_hz else f"{self.low_hz:.4g} Hz"
        )
        return (
            f"{self.axis} has {ratio_text} the power of the model at {band_text} "
            f"(averaging times of {float(f'{low:.2g}'):g} to {float(f'{high:.2g}'):g} s)"
        )


def stretches(fit: ChannelFit, most: int = 3) -> list[Stretch]:
    """The bands that differ most from the model, by p-value, without overlaps; p-values of 1 if none differs."""
    order = np.argsort(fit.frequency_hz)
    f, nu = fit.frequency_hz[order], fit.freedom[order]
    power = nu * (fit.density / fit.expected)[order]
    sums = [np.concatenate([[0.0], np.cumsum(x)]) for x in (nu, power)]
    candidates = []
    for length in (size for size in LENGTHS if size <= len(f)):
        freedom, scaled = (x[length:] - x[:-length] for x in sums)
        chance = 2 * np.minimum(chdtr(freedom, scaled), chdtrc(freedom, scaled))
        chance = np.where(np.abs(scaled / freedom - 1) < NEGLIGIBLE, 1.0, chance)
        candidates += [
            (float(p), k, k + length, float(g / n))
            for k, (p, g, n) in enumerate(zip(chance, scaled, freedom, strict=True))
        ]
    candidates.sort(
        key=lambda stretch: (stretch[0], -abs(np.log(stretch[3])) * (sums[0][stretch[2]] - sums[0][stretch[1]]))
    )
    selected: list[tuple[float, int, int, float]] = []
    for stretch in candidates:
        if len(selected) == most:
            break
        if all(stretch[2] <= wider[1] or stretch[1] >= wider[2] for wider in selected):
            selected.append(stretch)
    return [
        Stretch(
            fit.channel.axis, float(f[a]), float(f[b - 1]), ratio,
            float((ratio - 1) * np.sqrt((sums[0][b] - sums[0][a]) / 2)), min(1.0, p * len(candidates)),
        )
        for p, a, b, ratio in selected
    ]  # fmt: skip


TIME, FREQUENCY = "averaging time", "frequency"


def places(fit: NoiseFit) -> tuple[Place, ...]:
    """The places where a noise model fails: surest first, times before frequencies of the same channel."""
    curves = tuple(compared_deviations(fit).values())
    return tuple(_failures(fit, curves))


def evaluate(model: Model, still: Still) -> NoiseFit | None:
    """The model with its own values; None if it has none. Raises DataError for a channel without values."""
    terms = noise_terms(model)
    signal = signal_terms(model)
    if not model.params or not all(term.estimates for term in signal):
        return None
    still = without_signal(still, signal)
    by_key = {(term.name, e.axis, e.name): e.value for term in terms for e in term.estimates}
    axes = {axis for _, axis, _ in by_key}
    if missing := [channel.axis for channel in still.channels if channel.axis not in axes]:
        raise DataError(
            f"{still.source}: {model.name} has values for the axes {', '.join(sorted(axes))}, and none for "
            f"{', '.join(missing)}; fit it to this record, or name a channel with --channel"
        )
    channels = []
    for channel in still.channels:
        values = {
            term.name: {
                name: v for (effect, axis, name), v in by_key.items() if (effect, axis) == (term.name, channel.axis)
            }
            for term in terms
        }
        lines = tuple(line for term in terms for line in effect_lines(term.effect, values[term.name]))
        channels.append(_with_values(channel, lines, values, model))
    return NoiseFit(still, replace(model, unit=still.unit), tuple(channels), fitted=False)


def _with_values(
    channel: Channel, lines: tuple[SpectralLine, ...], values: dict[str, Values], model: Model
) -> ChannelFit:
    effects = tuple(term.effect for term in noise_terms(model) if "spectrum" in term.effect.places)
    complete = tuple(effect for effect in effects if all(p.name in values[effect.name] for p in effect.parameters))
    return replace(without_effects(channel, lines), effects=complete, values={e.name: values[e.name] for e in complete})


def _failures(fit: NoiseFit, curves: tuple[DeviationComparison, ...]) -> list[Place]:
    """Surest first, times before frequencies of the same channel."""
    limit = SIGNIFICANT / (2 * len(curves))
    places = [
        place for channel, curve in zip(fit.channels, curves, strict=True) for place in _times(channel, curve, limit)
    ]
    places += [
        Place(FREQUENCY, stretch.low_hz, stretch.high_hz, stretch.axis, abs(stretch.deviations), stretch.text)
        for channel in fit.channels
        for stretch in stretches(channel)
        if stretch.chance < limit
    ]
    return sorted(places, key=lambda place: -place.excess)


def _times(fit: ChannelFit, curve: DeviationComparison, limit: float) -> list[Place]:
    """Groups of neighbouring averaging times at which the model fails in the same direction."""
    off = (curve.chance < limit / len(curve.tau_s)) & (np.abs(curve.ratio - 1) > NEGLIGIBLE)
    side = np.where(off, np.sign(curve.ratio - 1), 0).astype(int)
    places = []
    for sign, group in groupby(range(len(side)), key=lambda k: side[k]):
        rows = list(group)
        if sign:
            worst = max(rows, key=lambda k: abs(float(curve.deviations[k])))
            excess = float(np.sqrt(np.mean(curve.deviations[rows] ** 2)))
            low, high = float(curve.tau_s[rows[0]]), float(curve.tau_s[rows[-1]])
            places.append(Place(TIME, low, high, fit.channel.axis, excess, _text(fit, curve, low, high, worst)))
    return places


def _text(fit: ChannelFit, curve: DeviationComparison, low: float, high: float, worst: int) -> str:
    span = f"{low:.4g} s" if low == high else f"{low:.4g} to {high:.4g} s"
    unit, axis = fit.channel.unit, fit.channel.axis
    return (
        f"averaging times of {span}: the Allan deviation of {axis} is {curve.ratio[worst]:.3g} x that of the model at "
        f"{curve.tau_s[worst]:.4g} s ({curve.measured[worst]:.3g} {unit} for {curve.modelled[worst]:.3g}), "
        f"{abs(curve.deviations[worst]):.3g} standard deviations off"
    )


PARTS = 8
TREND_SHARE = 0.25  # of a part's ordinates, that tell of its trend


@dataclass(frozen=True)
class Levels:
    """The level of one channel's noise in equal parts of its record, as multiples of their mean, and the p-value of
    their differences."""

    axis: str
    levels: Array
    part_s: float
    chance: float

    @property
    def ratio(self) -> float:
        """Ratio of the highest level to the lowest."""
        return float(self.levels.max() / self.levels.min())

    @property
    def text(self) -> str:
        """The change of the level, as a sentence."""
        start_s = int(np.argmax(self.levels)) * self.part_s
        return (
            f"the level of {self.axis} changes with time, by a factor of {self.ratio:.3g}: it is highest from "
            f"{start_s:.4g} to {start_s + self.part_s:.4g} s"
        )


def noise_levels(fit: ChannelFit) -> Levels | None:
    """Levels of one channel's noise over its record; None if the record is too short."""
    channel = fit.channel
    means, step_s = means_without(channel, fit.lines), channel.sampling.interval_s
    length = len(means) // PARTS
    f = np.arange(1, length) / (2 * max(length, 1) * step_s)
    highest_hz = min(channel.highest_hz, 0.5 / step_s)
    in_band = (f > TREND_SHARE * highest_hz) & (f < highest_hz)
    if np.count_nonzero(in_band) < FEWEST_LEVEL_ORDINATES:
        return None
    parts = means[: PARTS * length].reshape(PARTS, length)
    power = dct(parts, type=2, norm="ortho", axis=1)[:, 1:][:, in_band] ** 2 * step_s
    levels = (power / fit.level(f[in_band])).mean(axis=1)
    ratio = levels / levels.mean()
    gain = float(np.count_nonzero(in_band) * np.sum(ratio - 1 - np.log(ratio)))
    return Levels(channel.axis, np.sqrt(ratio), length * step_s, float(chdtrc(PARTS - 1, gain)))
