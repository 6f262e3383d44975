"""The analog side of the converter: channels in turn, input noise, a characteristic in the form of a parabola.

Codes and their rounding belong to the twin of the converter. `step_v` is the size of a code: it gives the mean and the
spread of rounded samples without samples.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.world.kernel import Floats, kernel


@dataclass(frozen=True)
class Converter:
    """A 16-bit converter with a range of +-10 V."""

    skew_s: float = 15e-6  # from one channel of a scan to the next
    noise_v: float = 0.0  # rms of the input noise of one sample
    bow_v: float = 0.0  # deviation from the end-point line at mid-range
    range_v: float = 10.0  # +-
    step_v: float = 20 / 2**16  # one code


@kernel
def bowed_v(converter: Converter, volts: float) -> float:
    """`volts` after the converter's characteristic: a parabola through both ends of the range."""
    if converter.bow_v == 0:
        return volts
    ratio = volts / converter.range_v
    return volts + converter.bow_v * (1 - ratio * ratio)


def bowed_mean_v(converter: Converter, mean_v: Floats, variance: float) -> Floats:
    """Mean of `bowed_v` over samples of this mean and variance (V^2)."""
    return mean_v + converter.bow_v * (1 - (mean_v**2 + variance) / converter.range_v**2)
