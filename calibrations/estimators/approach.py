"""An exponential approach to a steady state, followed during the measurement.

    value(t) = c + r(t) + room + slow noise + white noise
    r' = -r / tau      the rest of the approach: no exponential, one (hours: a board) or two (minutes: a package)
    room               a daily swing; it keeps its phase for two days

A bank of extended Kalman filters runs side by side. Each has a cell of time constants, within which it estimates them,
its own swing of the room, and its own slow noise: Gauss-Markov processes of many time constants, up to days, of equal
size (flicker) or not, with or without a random walk. The weight of a filter is the likelihood of its predictions. The
bounds are those of the whole bank. So they include values that the data do not determine yet: the time constant of a
drift that is still straight, and the noise of a short record.

Heat that flows through a board makes many exponentials, not two. Therefore the processes of minutes to hours are larger
at the beginning: a process that decays from the beginning on is an exponential.

Values are in units of the white standard error of one of them.

Source  Barshan and Durrant-Whyte, IEEE Trans. Robotics and Automation 11 (1995) 328: the model, and the filter; Magill,
        IEEE Trans. Automatic Control 10 (1965) 434: a bank; Alspach and Sorenson, ibid. 17 (1972) 439: Gaussian sums.
        Solin and Särkkä, AISTATS 33 (2014) 904: a cycle as states. What is likely beforehand: Ang III.B, steady after
        7 h, 2 to 12 h over eight axes, which is within four to five time constants.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calibrations.criteria import LEAST_TAU_RATIO
from calibrations.estimators.kalman import Belief, correct, predict
from calibrations.table import Array

LEVEL, OFFSET, REST, LN_TAU, SLOW, WALK, ROOM = 0, 1, 2, 4, 6, 11, 12  # places in a state: REST, LN_TAU, ROOM: two
SIZE = 14
TAU_STEP = np.array([0.4, 0.8])  # of a logarithm of a time constant, the slower and the faster one
TAUS_S = np.exp(np.arange(np.log(150.0), np.log(100e3), TAU_STEP[0]))
FAST_S = np.exp(np.arange(np.log(60.0), np.log(1300.0), TAU_STEP[1]))
USUAL_S, USUAL_LN_SPREAD = 5400.0, 0.8  # of a slow time constant, prior: its median, and the std of its logarithm
APPROACH_PRIOR = (0.3, 0.4, 0.3)  # prior probability of no exponential, one, two
SLOW_S = np.array([120.0, 800.0, 5e3, 3e4, 1.8e5])  # time constants of slow noise
SLOW_RMS = ((0.5, 0.45), (1.5, 0.3), (3.5, 0.17), (8.0, 0.08))  # of a slow process, in units, and prior probability
SHAPES = (
    (1.0, (1.0, 1.0, 1.0, 1.0, 1.0), 0.0, 0.45),  # flicker
    (0.2, (0.5, 1.0, 2.0, 4.0, 4.0), 0.0, 0.15),  # the slower the larger
    (1.0, (1.0, 0.3, 0.3, 0.3, 0.3), 0.0, 0.15),  # seconds to minutes, with weaker flicker
    (0.0, (1.0, 1.0, 0.5, 0.7, 0.7), 0.0, 0.1),  # minutes, with weaker flicker of hours
    (0.0, (0.0, 1.0, 1.0, 0.8, 0.8), 0.0, 0.1),  # of hours, likewise
    (1.0, (1.0, 1.0, 1.0, 1.0, 1.0), 3.0, 0.05),
)
"""Of slow noise: the scatter within a value, the relative sizes of its processes, random walk per root of an hour, and
prior probability."""
NO_SLOW_NOISE = 0.3  # prior probability of no slow process
LEAST_WEIGHT = 1e-5  # a filter with less weight is removed
HOUR_S = 3600.0
DAY_S, LASTING_S = 24 * HOUR_S, 48 * HOUR_S  # the room's cycle, and how long it keeps its phase
ROOM_SWINGS = ((0.0015, 0.55), (0.005, 0.35), (0.02, 0.1))  # rms of its swing over `most`, and prior probability
SPREAD = 0.015  # of `most`: further exponentials that heat's way through a board adds, rms of each when it begins
SPREAD_S = 1e4  # the slowest of them: slower processes are no part of the warm-up


@dataclass(frozen=True)
class Bank:
    """k filters at `t_s`: the belief of each; rms of its slow processes (k, 5), its scatter of single values, its
    random walk, the rms of its room, log weight, (k,) each.

    `nis` is the sum of the normalised innovations squared so far, of `count` values.
    """

    t_s: float
    belief: Belief
    slow: Array
    scatter: Array
    walk: Array
    room: Array
    log_weight: Array
    nis: float = 0.0
    count: int = 0

    @property
    def weight(self) -> Array:
        """Probability of each filter, (k,)."""
        weight = np.exp(self.log_weight - self.log_weight.max())
        return np.asarray(weight / weight.sum())

    @property
    def noise(self) -> float:
        """Standard deviation of one value about its final value, with slow noise and room temperature."""
        return float(np.sqrt(self.weight @ (1 + np.sum(self.slow**2, axis=1) + self.scatter**2 + self.room**2)))

    @property
    def innovation_ratio(self) -> float:
        """Mean normalised innovation squared: 1 where some filter's model holds, more where none does."""
        return self.nis / max(self.count, 1)

    def at(self, t_s: float) -> Bank:
        """The bank at a later time, with nothing measured since."""
        gap_s, mean = t_s - self.t_s, self.belief.mean.copy()
        time_ratio = gap_s * np.exp(-mean[:, LN_TAU:SLOW])
        decay, slow = np.exp(-time_ratio), np.exp(-gap_s / SLOW_S)
        step = np.tile(np.eye(SIZE), (len(mean), 1, 1))
        noise = np.zeros_like(step)
        for k in range(2):
            step[:, REST + k, REST + k] = decay[:, k]
            step[:, REST + k, LN_TAU + k] = mean[:, REST + k] * decay[:, k] * time_ratio[:, k]
        for k in range(len(SLOW_S)):
            step[:, SLOW + k, SLOW + k] = slow[k]
            noise[:, SLOW + k, SLOW + k] = self.slow[:, k] ** 2 * (1 - slow[k] ** 2)
        noise[:, WALK, WALK] = self.walk**2 * gap_s / HOUR_S
        step[:, ROOM:, ROOM:], room_variance = _room_transition(gap_s)
        noise[:, range(ROOM, SIZE), range(ROOM, SIZE)] = self.room[:, None] ** 2 * room_variance
        mean[:, REST:LN_TAU] *= decay
        mean[:, SLOW:WALK] *= slow
        mean[:, ROOM:] = mean[:, ROOM:] @ step[0, ROOM:, ROOM:].T
        return replace(self, t_s=t_s, belief=Belief(mean, predict(self.belief, step, noise).covariance))

    def after(self, t_s: float, value: float, std: float, *, offset: bool = False) -> Bank:
        """The bank after one more value of white standard error `std`.

        With `offset`, the value is shifted by a constant that the filters estimate.
        """
        matrix = np.zeros((1, SIZE))
        matrix[0, [LEVEL, REST, REST + 1, *range(SLOW, ROOM + 1)]] = 1.0
        matrix[0, OFFSET] = float(offset)
        predicted = self.at(t_s)
        noise = (std**2 + self.scatter**2)[:, None, None]
        corrected = correct(predicted.belief, np.array([value]), matrix, noise)
        weighed = replace(predicted, belief=corrected.belief, log_weight=self.log_weight + corrected.log_likelihood)
        return weighed._prune(self.nis + float(weighed.weight @ corrected.nis))

    def drawn(self, n: int, seed: int = 0) -> Array:
        """States that may be the true one, up to SLOW: shape (n, SLOW). The same bank gives the same."""
        random = np.random.default_rng(seed)
        draws = np.sort(random.choice(len(self.weight), n, p=self.weight))
        members, member = np.unique(draws, return_inverse=True)
        sizes, directions = np.linalg.eigh(self.belief.covariance[members, :SLOW, :SLOW])
        # the symmetric root: the eigenvectors' signs, which differ from processor to processor, do not matter to it
        roots = (directions * np.sqrt(np.maximum(sizes, 0.0))[:, None, :]) @ directions.transpose(0, 2, 1)
        deviations = roots[member] @ random.standard_normal((n, SLOW, 1))
        return np.asarray(self.belief.mean[draws, :SLOW] + deviations[:, :, 0])

    def _prune(self, nis: float) -> Bank:
        likely = self.weight > LEAST_WEIGHT
        belief = Belief(self.belief.mean[likely], self.belief.covariance[likely])
        members = {name: getattr(self, name)[likely] for name in ("slow", "scatter", "walk", "room", "log_weight")}
        return replace(self, belief=belief, nis=nis, count=self.count + 1, **members)


def make_bank(t_s: float, value: float, most: float) -> Bank:
    """The bank before the measurement. It expects a value near the first `value`, and a drift up to about `most`."""
    kinds = product(_approaches(), _noises(), ROOM_SWINGS)
    members = [(tau, (*noise, swing * most), p * q * w) for (tau, p), (noise, q), (swing, w) in kinds]
    taus_s, noise = np.array([m[0] for m in members]), np.array([m[1] for m in members])
    scatter, slow, walk, swings = noise[:, 0], noise[:, 1:-2], noise[:, -2], noise[:, -1]
    mean, covariance = np.zeros((len(members), SIZE)), np.zeros((len(members), SIZE, SIZE))
    mean[:, LEVEL] = value
    mean[:, LN_TAU:SLOW] = np.log(np.where(taus_s > 0, taus_s, 1.0))
    begins = (SLOW_S < SPREAD_S) * (SPREAD * most) ** 2
    variances = np.column_stack([
        np.full((len(members), 2), (3 * most) ** 2), (taus_s > 0) * most**2, (taus_s > 0) * (TAU_STEP / 2) ** 2,
        slow**2 + begins, np.zeros(len(members)), swings**2, swings**2,
    ])  # fmt: skip
    covariance[:, range(SIZE), range(SIZE)] = variances
    return Bank(t_s, Belief(mean, covariance), slow, scatter, walk, swings, np.log([m[2] for m in members]))


def _room_transition(gap_s: float) -> tuple[Array, float]:
    """The transition matrix (2, 2) of the room's daily swing over a gap, and the share of its variance that is new."""
    angle, decay = 2 * np.pi * gap_s / DAY_S, np.exp(-gap_s / LASTING_S)
    c, s = np.cos(angle), np.sin(angle)
    return decay * np.array([[c, s], [-s, c]]), 1 - decay**2


def _approaches() -> list[tuple[tuple[float, float], float]]:
    """Slow and fast time constant, s, 0 for none; and their prior probability."""
    pairs = [(s, f) for s, f in product(TAUS_S.tolist(), FAST_S.tolist()) if s > LEAST_TAU_RATIO * f]
    kinds = [(0.0, 0.0)], [(s, 0.0) for s in TAUS_S.tolist()], pairs
    result: list[tuple[tuple[float, float], float]] = []
    for kind, probability in zip(kinds, APPROACH_PRIOR, strict=True):
        slow = np.array([max(s, 1.0) for s, _ in kind])
        usual = np.exp(-((np.log(slow / USUAL_S) / USUAL_LN_SPREAD) ** 2) / 2)
        result += zip(kind, (probability * usual / usual.sum()).tolist(), strict=True)
    return result


def _noises() -> list[tuple[tuple[float, ...], float]]:
    """Scatter, rms of each slow process, and the random walk; and their prior probability."""
    none = np.zeros(1 + len(SLOW_S))
    quiet = [((*none, walk), NO_SLOW_NOISE * p) for walk, p in ((0.0, 0.95), (3.0, 0.05))]
    return quiet + [
        ((rms * scatter, *(rms * np.array(shape)), walk), (1 - NO_SLOW_NOISE) * p * q)
        for (rms, q), (scatter, shape, walk, p) in product(SLOW_RMS, SHAPES)
    ]
