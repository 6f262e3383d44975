"""The stairs of a coarse converter: found in the outputs themselves, and taken off before any other search.

Rounded outputs gather at the codes, whatever else acts on the sensor. Once height and place of a step are known, the
output before the rounding is known to within its posterior: sharply at the edge of a step, and hardly on its tread.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from calibrations.means.noise import with_white
from calibrations.table import Array, Table

FEWEST_STEPS = 3  # in the range of the outputs
POINTS = 4.0  # in a resolved interval of frequency
MOST = 20_000  # frequencies
GATHERED = 0.28  # more than the linear model's outputs gather at the same codes: |mean of exp(2 pi i V / step)|
BY_CHANCE = 3.0  # times the most that outputs at random gather: sqrt(log(frequencies) / outputs)
FINEST = 3.0  # sample noises in a step: finer steps leave nothing in a mean
WHOLE = 0.4  # of the outputs, beyond an equal share: at codes of one remainder; some lie on the edge between two
SAW = "output/quantisation"  # the component that a search without stairs leaves out
GRID = np.linspace(-1.0, 1.0, 401)  # of a step, about a code
REACH = 3  # codes to either side that noise may reach
LEAST_NOISE = 0.02  # of a step


@dataclass(frozen=True)
class Stairs:
    """Height of a step, where a code stands, and the noise of a sample, in the output's unit."""

    step: float
    offset: float
    noise: float

    @property
    def rms(self) -> float:
        """Of the rounding error where noise hardly smooths it."""
        return self.step / float(np.sqrt(12))


def find_stairs(table: Table, linear: Array, white: Array) -> Stairs | None:
    """The stairs at which the outputs gather, and those of a linear model, (channels, n), do not; None: there are none.

    white   of each mean, (channels, n)

    A sweep's own regular angles gather outputs as well: the linear model has the same angles and no stairs.
    """
    noise = float(np.median(table.optional(table.std_names[0], 0.0)))
    values, span = table.outputs.T.ravel(), float(np.ptp(table.outputs)) or 1.0
    highest = min(1 / (FINEST * noise) if noise > 0 else np.inf, MOST / POINTS / span)
    f = np.arange(FEWEST_STEPS / span, highest, 1 / (POINTS * span))
    if not len(f):
        return None
    more = _gathered(values, f) - _gathered(linear.ravel(), f)
    best = int(np.argmax(more))
    if more[best] < max(GATHERED, BY_CHANCE * float(np.sqrt(np.log(len(f)) / len(values)))):
        return None
    fine = f[best] + np.linspace(-1, 1, 81) / (POINTS * span)
    at = float(fine[int(np.argmax(_gathered(values, fine)))])
    middle = float(values.mean())
    phase = float(np.angle(np.mean(np.exp(2j * np.pi * at * (values - middle)))))
    step, offset = _whole(values, 1 / at, middle + phase / (2 * np.pi * at))
    width = max(3 * float(np.sqrt(np.mean(white**2))), 0.01 * step)
    return Stairs(*_sharpened(values, step, offset, middle, width), noise)


def _whole(values: Array, step: float, offset: float) -> tuple[float, float]:
    """Step and offset where every code is used, and not only each second or third of them."""
    for times in (2, 3):
        code = np.round((values - offset) / step).astype(int) % times
        counts = np.bincount(code, minlength=times)
        if counts.max() / len(values) > 1 / times + WHOLE * (1 - 1 / times):
            return times * step, offset + step * int(np.argmax(counts))
    return step, offset


def _sharpened(values: Array, step: float, offset: float, middle: float, width: float) -> tuple[float, float]:
    """Step and offset near those given at which most outputs lie within `width` of a code: on a tread."""
    spread, best = float(np.ptp(values)), (-np.inf, step, offset)
    for at in 1 / step + np.linspace(-0.5, 0.5, 41) / spread:
        turned = (values - middle) * at
        for shift in np.linspace(-0.25, 0.25, 101):
            begins = (offset - middle) * at + shift
            beyond = turned - begins
            beyond = (beyond - np.round(beyond)) / at
            score = float(np.sum(np.exp(-0.5 * (beyond / width) ** 2)))
            best = max(best, (score, 1 / at, middle + begins / at))
    return best[1], best[2]


def _gathered(values: Array, frequencies: Array) -> Array:
    """|mean of exp(2 pi i f V)| at each frequency."""
    parts = [np.exp(2j * np.pi * np.outer(part, values)).mean(axis=1) for part in np.array_split(frequencies, 40)]
    return np.asarray(np.abs(np.concatenate(parts)))


def before_stairs(table: Table, white: Array, stairs: Stairs) -> Table:
    """The table with outputs as they were before the rounding, and their standard deviations as its white noise.

    white   of each mean, (channels, n)
    """
    code = np.round((table.outputs.T - stairs.offset) / stairs.step)
    seen = (table.outputs.T - stairs.offset) / stairs.step - code  # of a step, beyond the code
    mean = _mean_code(GRID, 1.0, 0.0, stairs.noise / stairs.step)
    std = np.maximum(white / stairs.step, 1e-3)
    weights = np.exp(-0.5 * ((mean - seen[..., None]) / std[..., None]) ** 2)
    total = weights.sum(axis=2)
    middle = (weights @ GRID) / total
    spread = np.sqrt(np.maximum((weights @ GRID**2) / total - middle**2, 0.0))
    outputs = stairs.offset + stairs.step * (code + middle)
    columns = {**table.columns, **dict(zip(table.output_names, outputs, strict=True))}
    return with_white(
        replace(table, columns=columns, left_out=(*table.left_out, SAW)), np.maximum(stairs.step * spread, white)
    )


def fitted_stairs(table: Table, before: Array, white: Array, stairs: Stairs) -> Stairs:
    """Stairs near those given, fitted to the outputs; `before`: the same before the rounding, (channels, n)."""
    outputs, middle = table.outputs.T, float(np.mean(before))
    begins = float(np.round((middle - stairs.offset) / stairs.step))
    code = stairs.offset + begins * stairs.step  # the code in the middle: there step and offset are independent

    def left(u: Array) -> Array:
        step, offset = stairs.step * (1 + u[1] * stairs.step / np.ptp(outputs)), code + u[0] * stairs.step
        return ((outputs - _mean_code(before, step, offset, stairs.noise)) / white).ravel()

    grid = np.linspace(-0.1, 0.1, 21)
    start = min(((a, b) for a in grid for b in grid), key=lambda u: float(np.sum(np.abs(left(np.array(u))))))
    step = stairs.step * (1 + start[1] * stairs.step / float(np.ptp(outputs)))
    return Stairs(step, code + start[0] * stairs.step - begins * step, stairs.noise)


def _mean_code(values: Array, step: float, offset: float, noise: float) -> Array:
    """Means of samples of such noise, rounded."""
    codes = (values - offset) / step
    nearest = np.round(codes)
    beyond, share = codes - nearest, max(noise / step, LEAST_NOISE)
    mean = nearest
    for j in range(REACH):
        mean = mean + ndtr((beyond - 0.5 - j) / share) - ndtr((-beyond - 0.5 - j) / share)
    return np.asarray(offset + step * mean)
