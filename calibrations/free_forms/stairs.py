"""The stairs of a coarse converter: found in the outputs themselves, and removed before any other search.

A finer converter leaves a sawtooth in the means: periodic in the output, found by the spectrum of the residual over it.

Rounded outputs gather at the codes, whatever else acts on the sensor. Once height and place of a step are known, the
output before the rounding is known to within its posterior: sharply at the edge of a step, and hardly on its tread.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, ndtr  # scipy.stats takes 0.4 s to load

from calibrations.effects.signal.quantisation import mean_of_rounded
from calibrations.free_forms.chain import State
from calibrations.free_forms.components import Component, Starts, per_axis
from calibrations.free_forms.poses import PoseData
from calibrations.means.noise import rms, with_white
from calibrations.table import Array, Table

FEWEST_STEPS = 3  # in the range of the outputs
POINTS = 4.0  # in a resolved interval of frequency
MOST_FREQUENCIES = 20_000  # frequencies
GATHERED = 0.28  # more than the linear model's outputs gather at the same codes: |mean of exp(2 pi i V / step)|
BY_CHANCE = 3.0  # times the most that outputs at random gather: sqrt(log(frequencies) / outputs)
AT_END = 3.0  # noises of a mean from a least or greatest output: within, it may lie at a limit of the sensor
SAME_CODE = 1e-9  # of the range: a smaller difference is one of rounded numbers
MOST_IN_GAP = 20  # steps between the nearest two of few means
ROUGH = 0.1  # of what a linear model leaves: where the noise is not known, finer steps are the digits of a file
UNKNOWN_NOISE = 0.15  # of a step: noise before the rounding until the search is done
VISIBLE_ROUNDING = 1.0  # noise of a mean, in a step from which its rounding error is not small beside the noise
REACHED = 3  # codes to either side of the nearest one, that noise may reach
AT_CODE = 0.02  # of a step: how far a mean at a code may be away from it
FINEST = 3.0  # sample noises in a step: the mean of finer steps has no visible error
SAME_REMAINDER = (
    0.4  # of the outputs, beyond an equal share: at codes of one remainder; some lie on the edge between two
)
SAW = "output/quantisation"  # the component that a search without stairs leaves out
GRID = np.linspace(-1.0, 1.0, 401)  # of a step, about a code
LEAST_NOISE = 0.02  # of a step
TREAD = np.linspace(-0.5, 0.5, 400, endpoint=False)  # of a step, about a code
NOISES = tuple(map(float, np.geomspace(LEAST_NOISE, 0.4, 41)))  # of a sample, in steps: with more no stairs are seen
NARROWEST = 3e-3  # standard deviation in steps that the points of a tread resolve
OUTLIER = 1e-6  # least density: one odd output does not decide
SAW_POINTS = 3.0  # frequencies in a resolved interval
SAW_REJECTIONS = 1  # of one saw: its phase may belong to an output that is not right yet
LEAST_OF_SAW = 0.3  # of the first harmonic that a step of this height has
MOST_OF_SAW = 1.5  # of it: a regular grid of poses has waves over the output that are larger
SAW_VISIBLE = 2.0  # steps' frequency times the noise of a sample: beyond, nothing is left of a saw in a mean


@dataclass(frozen=True)
class Stairs:
    """Height of a step and offset of a code, (channels, 1), and the noise before the rounding, in the output's unit.

    Behind a converter, each channel has an offset and a gain of its own.
    `of_means`: whether means were rounded, as in a file with few digits; else samples, of which a mean is taken.
    """

    step: Array
    offset: Array
    noise: float
    of_means: bool = False

    @property
    def rms(self) -> float:
        """Of the rounding error where noise hardly smooths it."""
        return float(np.sqrt(np.mean(self.step**2) / 12))


def find_stairs(table: Table, linear: Array, white: Array | None) -> Stairs | None:
    """The stairs at which the outputs gather, and those of a linear model, (channels, n), do not; None: there are none.

    white   of each mean, (channels, n); None where it is not known: then means that were rounded themselves are found

    A sweep's own regular angles gather outputs as well: the linear model has the same angles and no stairs. Outputs
    at a limit of the sensor gather there, and not at codes: those at either end of the outputs do not count.
    """
    rounded_means = _stairs_of_means(table.outputs.T, linear, white)
    if rounded_means is not None or white is None:
        return rounded_means
    noise_of_mean = float(rms(white.ravel()))
    noise = float(np.median(table.optional(table.std_names[0], 0.0)))
    channels, span = table.outputs.T, float(np.ptp(table.outputs)) or 1.0
    highest = min(1 / (FINEST * noise) if noise > 0 else np.inf, MOST_FREQUENCIES / POINTS / span)
    f = np.arange(FEWEST_STEPS / span, highest, 1 / (POINTS * span))
    if not len(f):
        return None
    width = AT_END * noise_of_mean
    inner = [(values > values.min() + width) & (values < values.max() - width) for values in channels]
    within = [values[kept] for values, kept in zip(channels, inner, strict=True)]
    of_linear = [values[kept] for values, kept in zip(linear, inner, strict=True)]
    if min(map(len, within)) == 0:
        return None
    poses = np.unique(np.round(linear[:, np.any(inner, axis=0)] / span, 6), axis=1).shape[1]  # and not visits
    excess = _measure_concentration(within, f) - _measure_concentration(of_linear, f)
    best = int(np.argmax(excess))
    counts = sum(map(len, within)), len(channels) * poses
    by_chance, by_few_poses = (BY_CHANCE * float(np.sqrt(np.log(len(f)) / count)) for count in counts)
    if excess[best] < max(GATHERED, by_chance) or by_few_poses >= 1.0:  # few poses gather anywhere
        return None
    fine = f[best] + np.linspace(-1, 1, 81) / (POINTS * span)
    frequency = float(fine[int(np.argmax(_measure_concentration(within, fine)))])
    found = [_stairs_of_channel(values, frequency, width) for values in within]
    step, offset = np.array(found).T[:, :, None]
    return Stairs(step, offset, noise or _sample_noise(channels, white, step, offset))


def _stairs_of_channel(values: Array, frequency: float, width: float) -> tuple[float, float]:
    """Step and offset near 1 / frequency at which most outputs of a channel lie within about `width` of a code."""
    middle = float(values.mean())
    phase = float(np.angle(np.mean(np.exp(2j * np.pi * frequency * (values - middle)))))
    step, offset = _with_every_code(values, 1 / frequency, middle + phase / (2 * np.pi * frequency))
    return _sharpen_step(values, step, offset, middle, max(width, 0.01 * step))


def _stairs_of_means(outputs: Array, linear: Array, white: Array | None) -> Stairs | None:
    """The stairs where every mean is at a code itself: means that were logged with few digits; else None.

    outputs, linear   means, and those of a linear model, (channels, n)
    white             noise of a mean, (channels, n), which is then the noise before the rounding; None: not known

    Steps whose rounding error is small beside this noise, or beside all that the linear model leaves, are those of the
    digits of any file.
    """
    found = [_step_of_means(values) for values in outputs]
    steps = [channel for channel in found if channel is not None]
    if len(steps) < len(found):
        return None
    step, offset = np.array(steps).T[:, :, None]
    if white is None:
        noise, least = UNKNOWN_NOISE * float(step.mean()), ROUGH * float(rms((outputs - linear).ravel()))
    else:
        noise = float(rms(white.ravel()))
        least = VISIBLE_ROUNDING * noise
    return Stairs(step, offset, noise, of_means=True) if step.min() >= least else None


def _step_of_means(means: Array) -> tuple[float, float] | None:
    """Step and offset of the codes at which every mean of a channel lies; None if there are none.

    The least gap between two means is one step, or a few where the means are few.
    """
    values = np.unique(means)
    gaps = np.diff(values)
    gaps = gaps[gaps > SAME_CODE * np.ptp(values)]
    for steps in range(1, MOST_IN_GAP + 1) if len(gaps) else ():
        codes = np.concatenate([[0.0], np.cumsum(np.round(np.diff(values) / (gaps.min() / steps)))])
        if codes[-1] < FEWEST_STEPS:
            continue
        step, offset = np.polyfit(codes, values, 1)
        if np.abs(values - offset - step * codes).max() < AT_CODE * step:
            return float(step), float(offset)
    return None


def noise_of_rounded(values: Array, white: Array, stairs: Stairs) -> Array:
    """Standard deviation of a rounded mean about its expectation, and at least the noise before the rounding.

    values, white   expected mean before the rounding, and its noise, (channels, n)
    """
    deviation = (values - stairs.offset) / stairs.step
    deviation, spread = deviation - np.round(deviation), white / stairs.step
    codes = np.arange(-REACHED, REACHED + 1)
    edges = (np.append(codes, REACHED + 1) - 0.5 - deviation[..., None]) / spread[..., None]
    shares = np.diff(ndtr(edges), axis=-1)
    variance = shares @ codes**2 - (shares @ codes) ** 2
    return np.asarray(np.maximum(stairs.step * np.sqrt(np.maximum(variance, 0.0)), white))


def _sample_noise(outputs: Array, white: Array, step: Array, offset: Array) -> float:
    """The noise of a sample with the greatest likelihood, from the positions of the means between the codes.

    outputs, white  means and their standard deviations, (channels, n)
    step, offset    of each channel, (channels, 1)

    If the steps are so coarse that most means have samples of one code only, their standard deviations cannot give it.
    Outputs before the rounding are assumed to be uniform between two codes.
    """
    fraction, std = ((outputs - offset) / step).ravel()[:, None], np.maximum(white / step, NARROWEST).ravel()[:, None]

    def likelihood(share: float) -> float:
        deviation = mean_of_rounded(TREAD, 1.0, 0.0, share) - fraction
        density = np.mean(np.exp(-0.5 * ((deviation - np.round(deviation)) / std) ** 2), axis=1)
        return float(np.sum(np.log(np.maximum(density, OUTLIER))))

    return float(np.mean(step)) * max(NOISES, key=likelihood)


def noise_before_rounding(outputs: Array, unrounded: Array, stairs: Stairs) -> float:
    """The noise before the rounding of means with the greatest likelihood of their codes, in the output's unit.

    outputs, unrounded   means at codes, and expected before the rounding, (channels, n)
    """
    deviation = (unrounded - outputs) / stairs.step  # from the code that was logged

    def likelihood(share: float) -> float:
        chance = ndtr((deviation + 0.5) / share) - ndtr((deviation - 0.5) / share)
        return float(np.sum(np.log(np.maximum(chance, OUTLIER))))

    return float(np.mean(stairs.step)) * max(NOISES, key=likelihood)


def _with_every_code(values: Array, step: float, offset: float) -> tuple[float, float]:
    """Step and offset where every code is used, and not only each second or third of them."""
    for times in (2, 3):
        code = np.round((values - offset) / step).astype(int) % times
        counts = np.bincount(code, minlength=times)
        if counts.max() / len(values) > 1 / times + SAME_REMAINDER * (1 - 1 / times):
            return times * step, offset + step * int(np.argmax(counts))
    return step, offset


def _sharpen_step(values: Array, step: float, offset: float, middle: float, width: float) -> tuple[float, float]:
    """Step and offset near those given at which most outputs lie within `width` of a code: on a tread."""
    spread, best = float(np.ptp(values)), (-np.inf, step, offset)
    for frequency in 1 / step + np.linspace(-0.5, 0.5, 41) / spread:
        cycles = (values - middle) * frequency
        for shift in np.linspace(-0.25, 0.25, 101):
            phase = (offset - middle) * frequency + shift
            deviation = cycles - phase
            deviation = (deviation - np.round(deviation)) / frequency
            score = float(np.sum(np.exp(-0.5 * (deviation / width) ** 2)))
            best = max(best, (score, 1 / frequency, middle + phase / frequency))
    return best[1], best[2]


def _measure_concentration(channels: Sequence[Array], frequencies: Array) -> Array:
    """|mean of exp(2 pi i f V)| of each of the `channels`, rms, at equally spaced frequencies.

    Each frequency is the sum of a coarse and a fine one, so that few exponentials and a product of matrices give all.
    """
    few = int(np.ceil(np.sqrt(len(frequencies))))
    squares = np.zeros(len(frequencies))
    for values in channels:
        coarse, fine = (
            np.exp(2j * np.pi * np.outer(part, values))
            for part in (frequencies[::few], frequencies[:few] - frequencies[0])
        )
        squares += np.abs((coarse @ fine.T).ravel()[: len(frequencies)] / len(values)) ** 2
    return np.asarray(np.sqrt(squares / len(channels)))


def before_stairs(table: Table, white: Array, stairs: Stairs) -> Table:
    """The table with outputs as they were before the rounding, and their standard deviations as its white noise.

    white   of each mean, (channels, n)
    """
    code = np.round((table.outputs.T - stairs.offset) / stairs.step)
    fraction = (table.outputs.T - stairs.offset) / stairs.step - code  # of a step, beyond the code
    means = [mean_of_rounded(GRID, 1.0, 0.0, max(stairs.noise / step, LEAST_NOISE)) for step in stairs.step.ravel()]
    mean = np.array(means)[:, None, :]
    std = np.maximum(white / stairs.step, 1e-3)
    squares = ((mean - fraction[..., None]) / std[..., None]) ** 2
    weights = np.exp(-0.5 * (squares - squares.min(axis=2, keepdims=True)))  # where no point is near, the nearest one
    total = weights.sum(axis=2)
    middle = (weights @ GRID) / total
    spread = np.sqrt(np.maximum((weights @ GRID**2) / total - middle**2, 0.0))
    outputs = stairs.offset + stairs.step * (code + middle)
    columns = {**table.columns, **dict(zip(table.output_names, outputs, strict=True))}
    return with_white(
        replace(table, columns=columns, left_out=(*table.left_out, SAW)), np.maximum(stairs.step * spread, white)
    )


def fit_stairs(table: Table, unrounded: Array, white: Array, stairs: Stairs) -> Stairs:
    """Stairs near those given, fitted to the outputs; `unrounded`: the same before the rounding, (channels, n)."""
    found = [
        _fit_channel(outputs, expected, noise, float(step), float(offset), stairs.noise)
        for outputs, expected, noise, step, offset in zip(
            table.outputs.T, unrounded, white, stairs.step.ravel(), stairs.offset.ravel(), strict=True
        )
    ]
    step, offset = np.array(found).T[:, :, None]
    return replace(stairs, step=step, offset=offset)


def _fit_channel(
    outputs: Array, unrounded: Array, white: Array, step: float, offset: float, noise: float
) -> tuple[float, float]:
    """Step and offset of one channel, near those given, that leave the least of its outputs."""
    begins = float(np.round((float(np.mean(unrounded)) - offset) / step))
    code = offset + begins * step  # the code in the middle: there step and offset are independent

    def at(u: tuple[float, float]) -> tuple[float, float]:
        return step * (1 + u[1] * step / float(np.ptp(outputs))), code + u[0] * step

    def residual(u: tuple[float, float]) -> float:
        fitted_step, middle = at(u)
        rounded = mean_of_rounded(unrounded, fitted_step, middle, max(noise, LEAST_NOISE * fitted_step))
        return float(np.sum(np.abs(outputs - rounded) / white))

    grid = np.linspace(-0.1, 0.1, 21)
    fitted_step, middle = at(min(((a, b) for a in grid for b in grid), key=residual))
    return fitted_step, middle - begins * fitted_step


def find_saw(
    data: PoseData, state: State, white: Array, residual: Array, rejected: Sequence[float], enter: float
) -> Component | None:
    """The significant saw of a quantiser that the residual `residual` (channels, n) shows best.

    rejected  frequencies of rejected saws; one with more than SAW_REJECTIONS is not proposed again
    """
    if {"output", SAW} & set(data.table.left_out):
        return None
    span = float(np.ptp(data.outputs)) or 1.0
    noise = float(np.median(data.spread)) if data.spread is not None else 0.0
    highest = min(SAW_VISIBLE / noise if noise > 0 else np.inf, 20_000 / SAW_POINTS / span)
    step = 1 / (SAW_POINTS * span)
    frequencies = step * np.arange(int(np.ceil(3 / span / step)), int(highest / step))
    if not len(frequencies):
        return None
    count = int(highest / step)
    weights = 1 / white**2
    channels = list(zip(state.response, residual * weights, weights, strict=True))
    powers = np.stack([_spectrum(v, r, step, count)[-len(frequencies) :] * 2 / w.sum() for v, r, w in channels])
    amplitude = np.sqrt(np.mean(2 * powers / weights.sum(axis=1, keepdims=True), axis=0))
    power = powers.sum(axis=0)
    quiet = np.sqrt(np.maximum(noise**2 - 1 / (3 * frequencies**2), 0.0))  # without the rounding's own
    is_saw = amplitude > LEAST_OF_SAW * _fundamental(frequencies, noise)  # a step has a height
    is_saw &= amplitude < MOST_OF_SAW * _fundamental(frequencies, quiet)  # and noise smooths it
    power[~is_saw] = 0.0
    for f in rejected:
        close = np.abs(frequencies - f) * span < 1.0
        if sum(abs(earlier - f) * span < 1.0 for earlier in rejected) > SAW_REJECTIONS:
            power[close] = 0.0
    best = int(np.argmax(power))
    price = _threshold(2 * np.log(len(frequencies) / SAW_POINTS) + enter, len(channels)) - enter
    if power[best] < price + enter:
        return None
    fine = frequencies[best] + np.linspace(-1, 1, 41) / (SAW_POINTS * span)
    power = np.sum([np.abs(np.exp(-2j * np.pi * np.outer(fine, v)) @ r) ** 2 / w.sum() for v, r, w in channels], axis=0)
    return sawtooth(float(fine[int(np.argmax(power))]), 3, price, 0.05 / span, data.table.axes)


def _threshold(gain: float, channels: int) -> float:
    """Of a wave's gain summed over channels, each with a phase of its own: as rare as `gain` of one wave is."""
    return float(chdtri(2 * channels, np.exp(-gain / 2)))


def _fundamental(frequencies: NDArray[np.floating], noise: Array | float) -> Array:
    """Amplitude of the first harmonic that a saw of 1 / frequency has in a mean of samples with such noise."""
    step = 1 / frequencies
    return np.asarray(step / np.pi * np.exp(-2 * (np.pi * noise / step) ** 2))


def _spectrum(positions: Array, values: Array, step: float, count: int) -> Array:
    """|sum of values exp(-2 pi i f at)|^2 at f = 0, step, .. (count,), by a fine histogram and a fast transform."""
    bins = 1 << int(np.ceil(np.log2(8 * count)))
    place = (positions - positions.min()) * step * bins
    lower = np.floor(place).astype(int)
    share = place - lower
    grid = np.bincount(lower % bins, values * (1 - share), bins) + np.bincount((lower + 1) % bins, values * share, bins)
    return np.asarray(np.abs(np.fft.rfft(grid)[:count]) ** 2)


def sawtooth(frequency: float, harmonics: int, price: float, step: float, axes: Sequence[str]) -> Component:
    """Quantisation: harmonics of a saw over each output, codes per unit of output; `step` of the frequency to try.

    Behind a converter each output has an offset of its own, and so has each saw its phase.
    """
    name = f"output/quantisation@{frequency:.6g}"

    def at(shape: tuple[float, ...]) -> Component:
        def waves(s: State, k: int) -> Array:
            turned = 2 * np.pi * shape[0] * s.response[k, :, None] * np.arange(1, harmonics + 1)
            scale = 1.0 / np.arange(1, harmonics + 1)
            return np.concatenate([np.sin(turned) * scale, np.cos(turned) * scale], axis=1)

        def starts(x: Array) -> Starts:
            first = x.reshape(len(axes), 2, harmonics)[:, :, 0]
            return tuple(
                (parameter, axis, value)
                for axis, (sine, cosine) in zip(axes, first, strict=True)
                for parameter, value in _steps(shape[0], float(sine), float(cosine))
            )

        return Component(
            name, "output", "output", "quantisation", "output/quantisation", price, per_axis(waves),
            shape=shape, step=(step,), reshaped=at, starts=starts,
        )  # fmt: skip

    return at((frequency,))


def _steps(frequency: float, sine: float, cosine: float) -> tuple[tuple[str, float], ...]:
    """Step, offset and noise of the quantiser whose saw has this first harmonic.

    The saw of rounding is -(q / pi) exp(-2 (pi s / q)^2) sin(2 pi (V - o) / q) and harmonics (Widrow and Kollar, 2008).
    """
    step = 1 / frequency
    fraction = np.clip(np.pi * np.hypot(sine, cosine) / step, 1e-6, 1.0)
    noise = step / np.pi * np.sqrt(-np.log(fraction) / 2)
    offset = step / (2 * np.pi) * np.arctan2(cosine, -sine)
    return ("step", step), ("offset", float(offset)), ("noise", float(noise))
