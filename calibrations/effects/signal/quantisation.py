from functools import lru_cache

import numpy as np
import scipy  # loads its special functions at the first use
from numpy.typing import NDArray

from calibrations.effects import Effect, Parameter, Values
from calibrations.geometry.smooth import smooth_columns
from calibrations.table import Array, Table

LEAST_NOISE = 1e-3  # of a step
FINEST = 4.0  # points in a resolved interval of frequency
MOST = 20_000  # frequencies
CODES = 3  # to either side of the nearest one, that noise may reach
UNREACHED = 9.0  # standard deviations of the noise: codes beyond have a share below rounding
TOGETHER = 64  # frequencies of one block
MOST_NOISE = 1.5  # of the scatter of the samples: the poses may lie where codes are seldom changed
VISIBLE = 0.6  # of a step: more noise leaves a thousandth of the saw


class Quantisation(Effect):
    """quantisation: a coarse converter rounds each sample, and the noise is too small to average the rounding out.

        V <- o + q (m + sum_j Phi((f - 1/2 - j) q / s) - Phi((-f - 1/2 - j) q / s))     q, o, s in {out}; j = 0, 1, 2
                                                         m: the nearest code's number, f: (V - o) / q - m

    The mean of rounded samples with normal noise of standard deviation s, exactly. The codes are at o + m q. Behind a
    converter each output has its own offset and gain, so that each axis has its own q, o and s.

    Symptom   the residual is a sawtooth over the output, as high as one step.
    Excited by  outputs that differ by many fractions of a step.
    Confused with  adc-nonlinearity, if one step is as large as the range. To separate them, use smaller steps of the
              angle.
    Source    Widrow and Kollar, Quantization Noise (2008), chapter 4; Book 17.3.3.
    """

    kinds = ("poses",)
    left_out = "what was rounded off is lost"
    after = ("bias", "scale-factor")
    rounds = True
    converts = True

    step = Parameter(
        "{out}",
        typical=1e-6,
        starts=(1e-3,),
        low=1e-9,
        guess=lambda table: _start(table, 0),
        doc="from one code to the next",
    )
    offset = Parameter("{out}", typical=1e-3, guess=lambda table: _start(table, 1), doc="of a code")
    noise = Parameter(
        "{out}",
        typical=1e-3,
        low=0.0,
        most=lambda table: MOST_NOISE * _scatter(table),
        guess=lambda table: _start(table, 2),
        doc="of a sample, before it is rounded",
    )

    def searched(self, table: Table) -> float:
        """The number of different steps of which the start is the best."""
        return max(len(_frequencies(table)) / FINEST, 1.0)

    def output(self, v: Array, table: Table, p: Values) -> Array:
        rounded = v.copy()
        for k in np.flatnonzero(p.step):  # an axis that is not measured has no step
            noise = max(float(p.noise[k]), LEAST_NOISE * float(p.step[k]))
            rounded[:, k] = mean_of_rounded(v[:, k], float(p.step[k]), float(p.offset[k]), noise)
        return rounded


def mean_of_rounded(values: Array, step: float, offset: float, noise: float) -> Array:
    """Means of rounded samples about `values`, exactly. The codes are at offset + m step. All in the output's unit.

    noise   standard deviation of a normal sample before it is rounded, > 0 and at most half a step
    """
    codes = (values - offset) / step
    nearest = np.round(codes)
    deviation, spread = codes - nearest, noise / step
    mean = nearest
    for j in range(CODES):
        if j > UNREACHED * spread:
            break
        above, below = (deviation - 0.5 - j) / spread, (-deviation - 0.5 - j) / spread
        mean = mean + scipy.special.ndtr(above) - scipy.special.ndtr(below)
    return np.asarray(offset + step * mean)


def _frequencies(table: Table) -> Array:
    """Codes per {out} that could show: from three in the range up to where the samples' noise hides them."""
    span = float(np.max(np.ptp(table.outputs, axis=0))) or 1.0
    noise = float(np.median(table.optional(table.std_names[0], 0.0)))
    most = min(VISIBLE / noise if noise > 0 else np.inf, MOST / FINEST / span)
    return np.arange(3 / span, most, 1 / (FINEST * span))


def _scatter(table: Table) -> float:
    """Standard deviation of a sample of the noisiest output, {out}; inf where the table does not say, or says 0.

    On average over all values, rounded samples scatter more than they did before.
    """
    if not all(name in table for name in (*table.std_names, "n")) or np.all(table.column("n") < 2):
        return np.inf
    squares = [np.mean(table.column(name) ** 2) for name in table.std_names]
    return float(np.sqrt(max(squares))) or np.inf


def _start(table: Table, k: int) -> Array:
    return np.broadcast_to(_sawtooth(table)[k], len(table.axes))


@lru_cache(maxsize=8)
def _sawtooth(table: Table) -> tuple[float, tuple[float, ...], float]:
    """(step, offset of each axis, noise) of the saw that fits best to the part that is not smooth over the angles."""
    smooth = smooth_columns(table)
    v = table.outputs
    even = smooth @ (smooth.T @ v) if smooth.size else v
    uneven = v - even
    frequencies = _frequencies(table)
    if not len(frequencies):
        return 1e-3, (0.0,) * len(table.axes), 0.0
    turned = np.stack([_transform(u, e, frequencies) for u, e in zip(uneven.T, even.T, strict=True)])
    best = int(np.argmax(np.sum(np.abs(turned) ** 2, axis=0)))
    f = float(frequencies[best])
    # - q / pi sin(2 pi f (V - o)): its transform is + i times a phase of -2 pi f o
    offsets = -np.angle(turned[:, best] / 1j) / (2 * np.pi * f)
    return 1 / f, tuple(map(float, offsets)), float(np.median(table.optional(table.std_names[0], 0.0))) / 2


def _transform(values: Array, positions: Array, frequencies: Array) -> NDArray[np.complex128]:
    """Sum of values exp(-2 pi i f at) at evenly spaced frequencies: a block's first one, and steps from there."""
    steps = np.exp(-2j * np.pi * np.outer(frequencies[:TOGETHER] - frequencies[0], positions))
    firsts = np.exp(-2j * np.pi * np.outer(frequencies[::TOGETHER], positions))
    return np.asarray(((firsts * values) @ steps.T).ravel()[: len(frequencies)])
