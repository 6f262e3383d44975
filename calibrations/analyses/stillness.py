"""The test of rest of a sensor in a hand: each window of samples is compared with the noise at rest.

    shake   variance of the samples about the means of short blocks     a trembling hand, a motor
    sway    variance of the block means about the mean of the window    a hand that holds the sensor
    creep   variance of the window means of one rest                    a sensor that slips slowly

Each is divided by its value at rest, axis by axis, and averaged over the axes. At rest the quotient follows an F
distribution. Its degrees of freedom come from the scatter at rest, because a filter correlates the samples. A window
counts as motion where a quotient is beyond the quantile of FALSE_ALARM, which the three tests share.

Source  Skog, Haendel, Nilsson and Rantakokko, IEEE Trans. Biomedical Engineering 57 (2010), 2657-2666, detectors of
        zero velocity; Satterthwaite, Biometrics Bulletin 2 (1946), 110-114, degrees of freedom of a sum of variances.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from calibrations.table import Array

FALSE_ALARM = 1e-3  # probability that a window at rest counts as motion
BLOCK_S = 0.05  # longer than the correlation of the noise behind a filter of 15 Hz
LEARNED_WINDOWS = 20
SUCCESSIVE = 2 / 3  # efficiency of a variance from successive differences (von Neumann, 1941)
EACH_AXIS = 1 / 2  # of the pooled degrees of freedom: each axis is divided by an uncertain variance of its own
LEAST_FREEDOM = 1 / 16  # of the degrees of freedom of independent samples
TESTS = ("shake", "sway", "creep")


@dataclass(frozen=True)
class NoiseAtRest:
    """The noise of a sensor at rest. Variances per axis, shape (3,), in the square of the outputs' unit.

    `freedom`: degrees of freedom of one window's shake and sway. `windows`: number of windows they come from.
    """

    shake: Array
    sway: Array
    creep: Array
    freedom: tuple[float, float]
    windows: int
    rate_hz: float

    @property
    def std(self) -> Array:
        """Standard deviation of the samples of a window, shape (3,)."""
        return np.asarray(np.sqrt(self.shake + self.sway))


@dataclass(frozen=True)
class Stillness:
    """The test of a window: `ratio` is the largest quotient over its limit; above 1 the sensor moves.

    `by`: the test with this quotient, a name of TESTS. `noise`: standard deviation over that at rest.
    """

    ratio: float
    by: str
    noise: float

    @property
    def still(self) -> bool:
        """Whether the window is at rest."""
        return self.ratio <= 1


def learn_noise(windows: Sequence[Array], rate_hz: float) -> NoiseAtRest | None:
    """The noise from `windows` at rest, of shape (n, 3); None if they are too few or differ.

    The sensor must be at rest: a hand that trembles evenly looks like noise.
    """
    if len(windows) < LEARNED_WINDOWS:
        return None
    shakes, sways = (np.array(variances) for variances in zip(*(_variances(w, rate_hz) for w in windows), strict=True))
    means = np.array([w.mean(axis=0) for w in windows])
    creep = np.mean(np.diff(means, axis=0) ** 2, axis=0) / 2
    tiny = np.finfo(float).tiny
    shake, sway, creep = (np.maximum(v, tiny) for v in (shakes.mean(axis=0), sways.mean(axis=0), creep))
    blocks = _blocks(len(windows[0]), rate_hz)
    most = 3.0 * blocks * (len(windows[0]) // blocks - 1), 3.0 * (blocks - 1)
    freedom = tuple(_freedom(v / s, m) for v, s, m in ((shakes, shake, most[0]), (sways, sway, most[1])))
    noise = NoiseAtRest(shake, sway, creep, (freedom[0], freedom[1]), len(windows), rate_hz)
    are_consistent = all(_window_ratio(w, noise, FALSE_ALARM / len(windows))[0] <= 1 for w in windows)
    return noise if are_consistent and _creep_ratio(means, noise, FALSE_ALARM) <= 1 else None


def judge_window(windows: Sequence[Array], noise: NoiseAtRest) -> Stillness:
    """The test of the last of successive `windows`, each (n, 3); creep is that of all together."""
    share = FALSE_ALARM / len(TESTS)
    ratio, cause = _window_ratio(windows[-1], noise, share)
    creep = _creep_ratio(np.array([w.mean(axis=0) for w in windows]), noise, share) if len(windows) > 1 else 0.0
    spread = float(np.sqrt(np.mean(sum(_variances(windows[-1], noise.rate_hz)) / (noise.shake + noise.sway))))
    return Stillness(creep, "creep", spread) if creep > ratio else Stillness(ratio, cause, spread)


def _window_ratio(window: Array, noise: NoiseAtRest, alarm: float) -> tuple[float, str]:
    """The larger quotient of shake and sway over its limit at the probability `alarm`, and its name."""
    ratios = [(0.0, TESTS[0])]
    pairs = zip(TESTS[:2], _variances(window, noise.rate_hz), (noise.shake, noise.sway), noise.freedom, strict=True)
    for name, v, at_rest, freedom in pairs:
        if freedom > 0:
            limit = float(fdtri(freedom, noise.windows * freedom, 1 - alarm))
            ratios.append((float(np.mean(v / at_rest)) / limit, name))
    return max(ratios)


def _creep_ratio(means: Array, noise: NoiseAtRest, alarm: float) -> float:
    """Creep divided by its limit, from window means (k, 3)."""
    quotient = float(np.mean(means.var(axis=0, ddof=1) / noise.creep))
    freedom = 3 * EACH_AXIS * SUCCESSIVE * (noise.windows - 1)
    return quotient / float(fdtri(3.0 * (len(means) - 1), freedom, 1 - alarm))


def _blocks(samples: int, rate_hz: float) -> int:
    """Number of blocks in a window; two at least."""
    return max(2, samples // max(1, round(BLOCK_S * rate_hz)))


def _variances(window: Array, rate_hz: float) -> tuple[Array, Array]:
    """(shake, sway) of a window (n, 3), each (3,). Shake is 0 where a block is one sample."""
    blocks = _blocks(len(window), rate_hz)
    size = len(window) // blocks
    parts = window[: blocks * size].reshape(blocks, size, 3)
    shake = parts.var(axis=1, ddof=1).mean(axis=0) if size > 1 else np.zeros(3)
    return shake, parts.mean(axis=1).var(axis=0, ddof=1)


def _freedom(quotients: Array, most: float) -> float:
    """Degrees of freedom of the mean over the axes of `quotients` (windows, 3): 2 / variance, within limits of `most`.

    The variance is taken at its upper standard uncertainty: too many degrees of freedom would raise false alarms. The
    lower limit is for a touched window, which would else allow any motion.
    """
    variance = float(np.mean(quotients, axis=1).var(ddof=1)) * (1 + np.sqrt(2 / (len(quotients) - 1)))
    return float(np.clip(2 / max(variance, np.finfo(float).tiny), LEAST_FREEDOM * most, most))
