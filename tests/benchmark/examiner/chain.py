"""The chain from the stage angles to the output voltage, and the size of a cause in it.

    stage angles -> gravity in the sensor -> sensing axes -> response -> limit -> output voltage -> converter

The contribution of a cause is the output with it alone, less the output without it. Its size is the rms of what a
least-squares fit of its base columns leaves of the contribution, over all poses and both axes, in units of the white
noise of a mean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from tests.benchmark.examiner.cause import Cause, Constants, Stand
from tests.benchmark.examiner.layouts import Array, gravity
from tests.benchmark.examiner.record import Record

NORMAL = np.array([NormalDist().inv_cdf((i + 0.5) / 200) for i in range(200)])  # equally likely values of normal noise
TOLERANCE = 1e-5  # of the logarithm of an amplitude


@dataclass(frozen=True)
class Hidden:
    """A cause in a sensor. `amplitude` in the unit of its law; `size` reached and `target` in white noise of a mean."""

    cause: Cause
    constants: Constants
    amplitude: float
    size: float = math.nan
    target: float = math.nan

    def applied(self, record: Record, value: Array) -> Array:
        """The value that goes on from the stage of the cause."""
        return self.cause.law(record, value, self.amplitude, self.constants)


def rms(values: Array) -> float:
    """Root mean square of all elements."""
    return float(np.sqrt(np.mean(values**2)))


def output(record: Record, hidden: Sequence[Hidden]) -> Array:
    """Noise-free output in front of the converter, V, (n, 2)."""

    def at(stage: str) -> list[Hidden]:
        return [h for h in hidden if h.cause.stage == stage]

    poses, sensor, level = record.poses, record.sensor, np.zeros(record.n)
    stand = Stand(poses.alpha, poses.beta, level, level, np.zeros((record.n, 2)))
    for h in at("pose"):
        stand = h.cause.law(record, stand, h.amplitude, h.constants)
    force = gravity(poses, stand.alpha, stand.beta, stand.tilt_x, stand.tilt_y)
    for h in at("alignment"):
        force = h.applied(record, force)
    own = force[:, :2]
    for h in at("force"):
        own = h.applied(record, own)
    volts = sensor.zero_v + sensor.sensitivity_v * own + stand.added * sensor.scale_v
    for h in at("response"):
        volts = volts + sensor.scale_v * h.applied(record, force)
    for h in at("limit"):
        limited = h.applied(record, (volts - sensor.zero_v) / sensor.sensitivity_v)
        volts = sensor.zero_v + sensor.sensitivity_v * limited
    for h in at("output"):
        volts = h.applied(record, volts)
    return volts


def converted(record: Record, volts: Array, converter: Hidden) -> Array:
    """Expected mean of converted samples, V, (n, 2)."""
    samples = volts[..., None] + record.averaging.sigma_v * NORMAL
    return converter.applied(record, samples).mean(-1)


def contribution(record: Record, hidden: Hidden) -> Array:
    """Contribution of a cause alone, V, (n, 2)."""
    if hidden.cause.stage == "converter":
        return converted(record, record.ideal_v, hidden) - record.ideal_v
    return output(record, [hidden]) - record.ideal_v


def sized(record: Record, cause: Cause, constants: Constants, target: float) -> Hidden:
    """The cause with the amplitude that gives it the size `target`, or the nearest one that it can have."""
    floor = record.sensor.floor_v

    def size_v(amplitude: float) -> float:
        return rms(record.residual(contribution(record, Hidden(cause, constants, amplitude)), cause.base))

    if cause.stage == "converter":  # the size does not grow steadily with the code width
        widths = np.geomspace(floor, 2000 * floor, 140)
        sizes = np.array([size_v(width) for width in widths])
        amplitude = float(widths[np.argmin(np.abs(np.log((sizes + 1e-12) / (target * floor))))])
    else:
        low, high = math.log(cause.low), math.log(cause.high)
        while high - low >= TOLERANCE:
            middle = (low + high) / 2
            low, high = (middle, high) if size_v(math.exp(middle)) < target * floor else (low, middle)
        amplitude = math.exp((low + high) / 2)
    return Hidden(cause, constants, amplitude, size_v(amplitude) / floor, target)
