"""quantisation: a coarse converter rounds each sample, and too little noise is there to hide it in the mean.

    V <- o + q (m + sum_j Phi((f - 1/2 - j) q / s) - Phi((-f - 1/2 - j) q / s))     q, o, s in {out}; j = 0, 1, 2
                                                     m: the nearest code's number, f: (V - o) / q - m

The mean of rounded samples with normal noise of standard deviation s, exactly; codes stand at o + m q.

Symptom   the residual is a saw over the output itself, of a step's height.
Excited by  outputs that are many parts of a step apart.
Confused with  adc-nonlinearity where a step is as large as the range; finer steps of the angle show the saw.
Source    Widrow and Kollar, Quantization Noise (2008), chapter 4; Book 17.3.3.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from calibrations.effect import Parameter, Values
from calibrations.search.lack_of_fit import smooth_columns
from calibrations.table import Array, Table

KINDS = ("poses",)
LEFT_OUT = "what was rounded off is lost"
AFTER = ("bias", "scale-factor")
ROUNDS = True
PARAMETERS = (
    Parameter("step", "{out}", typical=1e-6, per_axis=False, starts=(1e-3,), low=1e-9, doc="from one code to the next"),
    Parameter("offset", "{out}", typical=1e-4, per_axis=False, doc="where a code stands"),
    Parameter("noise", "{out}", typical=1e-4, per_axis=False, low=0.0, doc="of a sample, before it is rounded"),
)
STARTS = {
    "step": lambda table: _start(table, 0),
    "offset": lambda table: _start(table, 1),
    "noise": lambda table: _start(table, 2),
}
CODES = 3  # to either side, that noise may reach
LEAST_NOISE = 1e-3  # of a step
FINEST = 4.0  # points in a resolved interval of frequency
MOST = 20_000  # frequencies
TOGETHER = 64  # frequencies of one block
VISIBLE = 0.6  # of a step: more noise leaves a thousandth of the saw


def SEARCHED(table: Table) -> float:  # noqa: N802
    """How many steps that look different the start is the best of."""
    return len(_frequencies(table)) / FINEST


def output(v: Array, table: Table, p: Values) -> Array:
    codes = (v - p["offset"]) / p["step"]
    nearest = np.round(codes)
    beyond = codes - nearest
    noise = max(float(p["noise"] / p["step"]), LEAST_NOISE)
    mean = nearest
    for j in range(CODES):
        mean = mean + ndtr((beyond - 0.5 - j) / noise) - ndtr((-beyond - 0.5 - j) / noise)
    return np.asarray(p["offset"] + p["step"] * mean)


def _frequencies(table: Table) -> Array:
    """Codes per {out} that could show: from three in the range up to where the samples' noise hides them."""
    span = float(np.max(np.ptp(table.outputs, axis=0))) or 1.0
    noise = float(np.median(table.optional("vx_std_v", 0.0)))
    most = min(VISIBLE / noise if noise > 0 else np.inf, MOST / FINEST / span)
    return np.arange(3 / span, most, 1 / (FINEST * span))


def _start(table: Table, which: int) -> Array:
    return np.full(len(table.axes), _saw(table)[which])


@lru_cache(maxsize=8)
def _saw(table: Table) -> tuple[float, float, float]:
    """(step, offset, noise) of the saw that what is not smooth in the angles follows best."""
    smooth = smooth_columns(table)
    v = table.outputs
    even = smooth @ (smooth.T @ v) if smooth.size else v
    rest = (v - even).ravel()
    frequencies = _frequencies(table)
    if not len(frequencies):
        return 1e-3, 0.0, 0.0
    turned = _transform(rest, even.ravel(), frequencies)
    best = int(np.argmax(np.abs(turned)))
    f = float(frequencies[best])
    # - q / pi sin(2 pi f (V - o)): its transform is + i times a phase of -2 pi f o
    offset = -np.angle(turned[best] / 1j) / (2 * np.pi * f)
    return 1 / f, float(offset), float(np.median(table.optional("vx_std_v", 0.0))) / 2


def _transform(values: Array, at: Array, frequencies: Array) -> NDArray[np.complex128]:
    """Sum of values exp(-2 pi i f at) at evenly spaced frequencies: a block's first one, and steps from there."""
    steps = np.exp(-2j * np.pi * np.outer(frequencies[:TOGETHER] - frequencies[0], at))
    firsts = np.exp(-2j * np.pi * np.outer(frequencies[::TOGETHER], at))
    return np.asarray(((firsts * values) @ steps.T).ravel()[: len(frequencies)])
