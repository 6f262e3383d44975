"""quantisation: a coarse converter rounds each sample, and too little noise is there to hide it in the mean.

    V <- V + (q / pi) sum_k (-1)^k / k sin(2 pi k (V - o) / q) exp(-2 (pi k s / q)^2)       q, o, s in {out}

The mean of rounded samples with normal noise of standard deviation s, exactly; codes stand at o + m q.

Symptom   the residual is a saw over the output itself, of a step's height.
Excited by  outputs that are many parts of a step apart.
Confused with  adc-nonlinearity where a step is as large as the range; finer steps of the angle show the saw.
Source    Widrow and Kollar, Quantization Noise (2008), chapter 4; Book 17.3.3.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from calibrations.effect import Parameter, Values
from calibrations.lack_of_fit import smooth_columns
from calibrations.table import Array, Table

KINDS = ("poses",)
AFTER = ("bias", "scale-factor")
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
HARMONICS = 12
FINEST = 4.0  # points in a resolved interval of frequency
MOST = 20_000  # frequencies
TOGETHER = 64  # frequencies of one block
VISIBLE = 0.6  # of a step: more noise leaves a thousandth of the saw


def SEARCHED(table: Table) -> float:  # noqa: N802
    """How many steps that look different the start is the best of."""
    return len(_frequencies(table)) / FINEST


def output(v: Array, table: Table, p: Values) -> Array:
    turns = (v - p["offset"]) / p["step"]
    faded = 2 * (np.pi * p["noise"] / p["step"]) ** 2
    saw = np.zeros_like(v)
    for k in range(1, HARMONICS + 1):
        saw += (-1) ** k / k * np.exp(-faded * k**2) * np.sin(2 * np.pi * k * turns)
    return v + p["step"] / np.pi * saw


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
