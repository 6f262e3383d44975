"""What no noise process makes: a step, a drift, a settling.

A step looks like a random walk to a spectrum, and so does a drift. In the cosine transform of the means each has a form
of its own, and its coefficients are independent there: the amplitude that fits best, and what it gains, are those of a
matched filter, for a step at every place at once.

Source  Van Trees, Detection, Estimation, and Modulation Theory, part I, 4.3: a known signal in coloured noise.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.fft import dct, dst

from calibrations.still.bands import means_without
from calibrations.still.channel_fit import ChannelFit
from calibrations.still.record import Channel
from calibrations.table import Array

SETTLING = np.geomspace(1 / 50, 1 / 2, 16)  # time constants that are tried, of the record
EDGE = 8  # means from either end within which a step would be one odd value
AMPLITUDE = 14.0  # what the amplitude of a pattern has to gain, before what is searched for


@dataclass(frozen=True)
class Pattern:
    """A part of one channel's means (m,) that is no noise. `gain`: twice the log-likelihood; `price`: of its search."""

    axis: str
    text: str
    gain: float
    price: float
    means: Array

    def taken_off(self, channel: Channel) -> Channel:
        """The record without it."""
        return replace(channel, means=channel.means - self.means) if channel.axis == self.axis else channel


def pattern_of(found: ChannelFit) -> Pattern | None:
    """The pattern that explains most of what one channel does, where it is no chance."""
    spectrum, unit = _Ordinates.of(found), found.channel.unit
    every = [_step(found.channel, spectrum, unit), *_courses(found.channel, spectrum, unit)]
    best = max(every, key=lambda each: each.gain - each.price)
    return best if best.gain > best.price else None


@dataclass(frozen=True)
class _Ordinates:
    """Cosine coefficients of the means below the filter, (k,), and their variances by the model."""

    seen: Array
    variance: Array
    n: int

    @classmethod
    def of(cls, found: ChannelFit) -> _Ordinates:
        channel = found.channel
        n, step_s = len(channel.means), channel.sampling.interval_s
        last = min(n, 2 + int(channel.corner_hz * n * step_s)) if np.isfinite(channel.corner_hz) else n
        f = np.arange(1, last) / (2 * n * step_s)
        seen = dct(means_without(channel, found.lines), type=2, norm="ortho")[1:last]
        return cls(seen, found.level(f) / step_s, n)

    def matched(self, form: Array) -> tuple[float, float, float]:
        """(amplitude, its standard deviation, gain) of a form of the means (n,)."""
        c = dct(form, type=2, norm="ortho")[1 : len(self.seen) + 1]
        weight = float(np.sum(c * c / self.variance))
        amplitude = float(np.sum(c * self.seen / self.variance)) / weight
        return amplitude, weight**-0.5, amplitude**2 * weight


def _step(channel: Channel, by: _Ordinates, unit: str) -> Pattern:
    """The step that explains most, at whatever mean."""
    n, k = by.n, np.arange(1, len(by.seen) + 1)
    per_step = -np.sqrt(2 / n) / (2 * np.sin(np.pi * k / (2 * n)))  # of a step at m: times sin(pi k m / n)
    along, power = np.zeros(n - 1), np.zeros(n + 1)
    along[: min(len(k), n - 1)] = (by.seen * per_step / by.variance)[: n - 1]
    power[1 : len(k) + 1] = per_step**2 / by.variance
    top = dst(along, type=1) / 2
    turned = (dct(power, type=1) + power[0] + (-1.0) ** np.arange(n + 1) * power[-1]) / 2
    twice = 2 * np.arange(1, n)
    bottom = (power.sum() - turned[np.where(twice <= n, twice, 2 * n - twice)]) / 2
    gain = np.where(bottom > 0, top**2 / np.maximum(bottom, np.finfo(float).tiny), 0.0)
    gain[: EDGE - 1] = gain[n - EDGE :] = 0.0
    at = int(np.argmax(gain))
    size = float(top[at] / bottom[at]) if bottom[at] > 0 else 0.0
    text = f"a step of {size:+.3g} {unit} of {channel.axis} at t = {(at + 1) * channel.sampling.interval_s:.6g} s"
    form = size * (np.arange(n) > at)
    return Pattern(channel.axis, text, float(gain[at]), AMPLITUDE + 2 * float(np.log(n)), form - form.mean())


def _courses(channel: Channel, by: _Ordinates, unit: str) -> Iterator[Pattern]:
    """A drift in a straight line, and settlings."""
    u = (np.arange(by.n) + 0.5) / by.n - 0.5
    slope, _, gain = by.matched(u)
    per_hour = 3600 * slope / channel.length_s
    yield Pattern(channel.axis, f"a drift of {channel.axis} by {per_hour:+.3g} {unit}/h", gain, AMPLITUDE, slope * u)
    for share in SETTLING.tolist():
        form = np.exp(-(u + 0.5) / share)
        size, _, gain = by.matched(form)
        text = (
            f"{channel.axis} settles by {-size:+.3g} {unit}, with a time constant of about "
            f"{share * channel.length_s:.2g} s"
        )
        price = AMPLITUDE + 2 * float(np.log(len(SETTLING)))
        yield Pattern(channel.axis, text, gain, price, size * (form - form.mean()))
