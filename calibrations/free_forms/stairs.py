"""The stairs of a coarse converter: found in the outputs themselves, and removed before any other search.

Rounded outputs gather at the codes, whatever else acts on the sensor. Once height and place of a step are known, the
output before the rounding is known to within its posterior: sharply at the edge of a step, and hardly on its tread.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from calibrations.effects.signal.quantisation import mean_of_rounded
from calibrations.free_forms.saw import SAW
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
GRID = np.linspace(-1.0, 1.0, 401)  # of a step, about a code
LEAST_NOISE = 0.02  # of a step
TREAD = np.linspace(-0.5, 0.5, 400, endpoint=False)  # of a step, about a code
NOISES = tuple(map(float, np.geomspace(LEAST_NOISE, 0.4, 41)))  # of a sample, in steps: with more no stairs are seen
NARROWEST = 3e-3  # standard deviation in steps that the points of a tread resolve
OUTLIER = 1e-6  # least density: one odd output does not decide


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
