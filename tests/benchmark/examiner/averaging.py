"""The averaging of a bench: number of samples, filter, what its file states of both; and the vibration of the bench.

    full                filter, sample rate, standard deviation and number of samples are stated
    other-filter        the same with another filter
    silent-correlated   standard deviation and number of samples, but no filter: the samples are correlated
    no-n                standard deviation only
    bare                means only
    few-samples         12 to 25 samples at 10 Hz, simulated one by one, so that a converter can round each

The samples of a first-order low-pass filter have the autocorrelation rho^k with rho = exp(-2 pi corner / rate), and

    variance of the mean of n samples = sigma^2 / n (1 + rho) / (1 - rho)

Source: the sum of a first-order autoregressive process; Box and Jenkins, Time Series Analysis (1970), chapter 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tests.benchmark.examiner.layouts import Array
from tests.benchmark.examiner.room import wander

SHARES = {
    "full": 0.34,
    "other-filter": 0.2,
    "silent-correlated": 0.11,
    "no-n": 0.11,
    "bare": 0.14,
    "few-samples": 0.10,
}
OTHER_FILTERS = ((200.0, 5.0, 1200), (400.0, 50.0, 2000), (2000.0, 100.0, 20000), (100.0, 8.0, 800))


@dataclass(frozen=True)
class Averaging:
    """Samples of a mean: rate and corner in Hz, number, and their standard deviation `sigma_v`."""

    kind: str
    rate_hz: float
    corner_hz: float
    n: int
    sigma_v: float

    @property
    def rho(self) -> float:
        """Correlation of neighbouring samples."""
        return _correlation(self.corner_hz, self.rate_hz)

    @property
    def states_filter(self) -> bool:
        """Whether the head of the file has the sample rate and the filter."""
        return self.kind in ("full", "other-filter", "few-samples")

    @property
    def states_std(self) -> bool:
        """Whether the file has standard deviations."""
        return self.kind != "bare"

    @property
    def states_n(self) -> bool:
        """Whether the file has the number of samples."""
        return self.kind not in ("bare", "no-n")


def draw_kind(random: np.random.Generator) -> str:
    """What the file says about the averaging."""
    return str(random.choice(list(SHARES), p=list(SHARES.values())))


def draw_averaging(random: np.random.Generator, kind: str, floor_v: float) -> Averaging:
    """Samples whose mean has the white noise `floor_v`."""
    rate, corner, n = 1000.0, 15.2, 5000
    if kind == "other-filter":
        rate, corner, n = OTHER_FILTERS[int(random.integers(len(OTHER_FILTERS)))]
    elif kind == "few-samples":
        rate, n = 10.0, int(random.integers(12, 26))
    elif kind == "silent-correlated":
        corner, n = float(random.choice([5.0, 15.2])), int(random.choice([2000, 4000]))
    rho = _correlation(corner, rate)
    return Averaging(kind, rate, corner, n, floor_v / math.sqrt((1 + rho) / (1 - rho) / n))


def _correlation(corner_hz: float, rate_hz: float) -> float:
    return math.exp(-2 * math.pi * corner_hz / rate_hz)


@dataclass(frozen=True)
class Vibration:
    """Vibration at each pose, g rms, (n,): a tone of a machine. `q` is its square over the square's deviation."""

    is_on: bool
    rms_g: Array
    q: Array


def draw_vibration(
    random: np.random.Generator, elapsed: Array, averaging: Averaging, scale_v: float, is_needed: bool
) -> Vibration:
    """A machine near some of the benches, whose vibration wanders, or is switched on and off."""
    is_on = is_needed or (random.random() < 0.12 and averaging.kind not in ("bare", "few-samples"))
    rms = np.zeros(len(elapsed))
    if is_on:
        noise_g = max(averaging.sigma_v / scale_v, 4e-4)
        level = _wandering(random, elapsed) if random.random() < 0.5 else _switched(random, elapsed)
        rms = level / level.mean() * noise_g * random.uniform(3, 8)
    square = rms**2
    return Vibration(is_on, rms, square / (square.std() + 1e-30))


def _wandering(random: np.random.Generator, elapsed: Array) -> Array:
    return np.exp(0.6 * wander(random, elapsed, random.uniform(200, 900)))


def _switched(random: np.random.Generator, elapsed: Array) -> Array:
    is_running = np.sin(2 * np.pi * elapsed / random.uniform(700, 1900) + 1) > 0.2
    running = 1.2 * is_running * (1 + 0.3 * wander(random, elapsed, 150.0)).clip(0.2)
    return 0.3 + running + 0.1 * random.random(len(elapsed))


def sampled(
    random: np.random.Generator, mean: Array, averaging: Averaging, vibration: Vibration, scale_v: float
) -> Array:
    """Single samples of few, uncorrelated ones, V, (n, 2, samples). The tone has five periods in a mean."""
    samples = mean[..., None] + averaging.sigma_v * random.normal(size=(*mean.shape, averaging.n))
    if vibration.is_on:
        phase = 2 * np.pi * (np.arange(averaging.n) * 5 / averaging.n)[None, None, :]
        start = random.uniform(0, 6.28, (len(mean), 2, 1))
        samples = samples + scale_v * np.sqrt(2) * vibration.rms_g[:, None, None] * np.sin(phase + start)
    return samples


def averaged(
    random: np.random.Generator, mean: Array, averaging: Averaging, vibration: Vibration, scale_v: float, floor_v: float
) -> tuple[Array, Array]:
    """Means and standard deviations of many samples, V, (n, 2), from their distributions.

    A variance of correlated samples scatters as that of n (1 - rho^2) / (1 + rho^2) independent ones.
    Source: Bayley and Hammersley, The effective number of independent observations (1946).
    """
    observed = mean + floor_v * random.normal(size=mean.shape)
    effective = averaging.n * (1 - averaging.rho**2) / (1 + averaging.rho**2)
    square = averaging.sigma_v**2 * (1 + random.normal(size=mean.shape) / math.sqrt(effective / 2)).clip(0.05)
    shaken = (scale_v * vibration.rms_g[:, None]) ** 2 * (1 + 0.004 * random.normal(size=mean.shape))
    return observed, np.sqrt(square + shaken)
