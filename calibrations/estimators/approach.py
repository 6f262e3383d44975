"""An exponential approach to a steady state, followed while it happens.

    value(t) = c + r(t) + slow noise + white noise      r' = -r / tau      what is left to come, slowest first; none,
                                                                           one (a board's hours) or two (and a package's
                                                                           minutes)

A bank of extended Kalman filters runs side by side. Each has its cell of time constants, within which it estimates
them, and its own slow noise: Gauss-Markov processes of many time constants, all alike (flicker) or not, with or without
a random walk. How well each foresaw what came is its weight. So what cannot be known yet, the time constant of a drift
that has hardly bent and the noise of a record that has hardly begun, is in the bounds, which are those of the whole
bank.

Values are in units of the white standard error of one of them.

Source  Barshan and Durrant-Whyte, IEEE Trans. Robotics and Automation 11 (1995) 328: the model, and the filter; Magill,
        IEEE Trans. Automatic Control 10 (1965) 434: a bank; Alspach and Sorenson, ibid. 17 (1972) 439: Gaussian sums.
        What is likely beforehand: Ang III.B, steady after 2 to 12 h over eight axes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calibrations.estimators.kalman import Belief, corrected, predicted
from calibrations.table import Array

LEVEL, OFFSET, REST, LN_TAU, SLOW, WALK = 0, 1, 2, 4, 6, 11  # places in a state: REST and LN_TAU have two each
SIZE = 12
CELL = np.array([0.3, 0.8])  # of a logarithm of a time constant, the slower and the faster one
TAUS_S = np.exp(np.arange(np.log(150.0), np.log(100e3), CELL[0]))
FAST_S = np.exp(np.arange(np.log(60.0), np.log(1300.0), CELL[1]))
APART = 3.0  # nearer than this factor, two time constants are one to any noise
USUAL_S, USUALLY = 3600.0, 1.2  # of a slow time constant beforehand: its median, and the std of its logarithm
COUNTS = (0.3, 0.4, 0.3)  # probability beforehand of no exponential, one, two
SLOW_S = np.array([20.0, 120.0, 800.0, 5e3, 3e4])  # time constants of slow noise
RMS = (0.5, 1.7, 6.0)  # of a slow process, in units
SHAPES = (
    ((1.0, 1.0, 1.0, 1.0, 1.0), 0.0, 0.35),  # flicker
    ((0.2, 0.5, 1.0, 2.0, 4.0), 0.0, 0.15),  # the slower the larger
    ((1.0, 1.0, 0.5, 0.5, 0.7), 0.0, 0.1),  # of seconds to minutes, beside weaker flicker
    ((0.0, 1.0, 1.0, 0.5, 0.7), 0.0, 0.1),  # of minutes, beside weaker flicker of hours
    ((0.0, 0.0, 1.0, 1.0, 0.8), 0.0, 0.1),  # of hours, likewise
    ((1.0, 1.0, 1.0, 1.0, 1.0), 1.5, 0.1),
    ((1.0, 1.0, 1.0, 1.0, 1.0), 6.0, 0.1),
)
"""Of slow noise: how large its processes are beside each other, random walk per root of an hour, probability
beforehand."""
NONE = 0.2  # probability beforehand of no slow process
UNLIKELY = 1e-6  # a filter of less weight is let go
HOUR_S = 3600.0


@dataclass(frozen=True)
class Bank:
    """k filters at `t_s`: what each believes; rms of its slow processes (k, 5), its random walk (k,), log weight (k,).

    `nis` is the sum of the normalised innovations squared so far, of `count` values.
    """

    t_s: float
    belief: Belief
    slow: Array
    walk: Array
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
        """Standard deviation of one value about what it comes to, slow noise included."""
        return float(np.sqrt(self.weight @ (1 + np.sum(self.slow**2, axis=1))))

    @property
    def surprise(self) -> float:
        """Mean normalised innovation squared: 1 where some filter's model holds, more where none does."""
        return self.nis / max(self.count, 1)

    def at(self, t_s: float) -> Bank:
        """The bank at a later time, with nothing measured since."""
        gap_s, mean = t_s - self.t_s, self.belief.mean.copy()
        over = gap_s * np.exp(-mean[:, LN_TAU:SLOW])
        kept, slow = np.exp(-over), np.exp(-gap_s / SLOW_S)
        step = np.tile(np.eye(SIZE), (len(mean), 1, 1))
        noise = np.zeros_like(step)
        for k in range(2):
            step[:, REST + k, REST + k] = kept[:, k]
            step[:, REST + k, LN_TAU + k] = mean[:, REST + k] * kept[:, k] * over[:, k]
        for k in range(len(SLOW_S)):
            step[:, SLOW + k, SLOW + k] = slow[k]
            noise[:, SLOW + k, SLOW + k] = self.slow[:, k] ** 2 * (1 - slow[k] ** 2)
        noise[:, WALK, WALK] = self.walk**2 * gap_s / HOUR_S
        mean[:, REST:LN_TAU] *= kept
        mean[:, SLOW:WALK] *= slow
        return replace(self, t_s=t_s, belief=Belief(mean, predicted(self.belief, step, noise).covariance))

    def after(self, t_s: float, value: float, std: float, *, offset: bool = False) -> Bank:
        """One more value of white standard error `std`; with an `offset`, it is shifted by a constant of its own."""
        matrix = np.zeros((1, SIZE))
        matrix[0, [LEVEL, REST, REST + 1, *range(SLOW, SIZE)]] = 1.0
        matrix[0, OFFSET] = float(offset)
        ahead = self.at(t_s)
        done = corrected(ahead.belief, np.array([value]), matrix, np.array([[std**2]]))
        weighed = replace(ahead, belief=done.belief, log_weight=self.log_weight + done.log_likelihood)
        return weighed._pruned(self.nis + float(weighed.weight @ done.nis))

    def drawn(self, n: int, seed: int = 0) -> Array:
        """States that may be the true one, up to SLOW: shape (n, SLOW). The same bank gives the same."""
        random = np.random.default_rng(seed)
        chosen = np.sort(random.choice(len(self.weight), n, p=self.weight))
        members, which = np.unique(chosen, return_inverse=True)
        sizes, ways = np.linalg.eigh(self.belief.covariance[members, :SLOW, :SLOW])
        roots = ways * np.sqrt(np.maximum(sizes, 0.0))[:, None, :]
        away = roots[which] @ random.standard_normal((n, SLOW, 1))
        return np.asarray(self.belief.mean[chosen, :SLOW] + away[:, :, 0])

    def _pruned(self, nis: float) -> Bank:
        likely = self.weight > UNLIKELY
        belief = Belief(self.belief.mean[likely], self.belief.covariance[likely])
        return Bank(
            self.t_s, belief, self.slow[likely], self.walk[likely], self.log_weight[likely], nis, self.count + 1
        )


def bank(t_s: float, value: float, most: float) -> Bank:
    """Before anything is measured: the first `value`, at `t_s`, is near; a drift is seldom much beyond `most`."""
    members = [(tau, noise, p * q) for (tau, p), (noise, q) in product(_approaches(), _noises())]
    taus_s, noise = np.array([m[0] for m in members]), np.array([m[1] for m in members])
    slow, walk = noise[:, :-1], noise[:, -1]
    mean, covariance = np.zeros((len(members), SIZE)), np.zeros((len(members), SIZE, SIZE))
    mean[:, LEVEL] = value
    mean[:, LN_TAU:SLOW] = np.log(np.where(taus_s > 0, taus_s, 1.0))
    variances = np.column_stack([np.full((len(members), 2), (3 * most) ** 2), (taus_s > 0) * most**2,
                                 (taus_s > 0) * (CELL / 2) ** 2, slow**2, np.zeros(len(members))])  # fmt: skip
    covariance[:, range(SIZE), range(SIZE)] = variances
    return Bank(t_s, Belief(mean, covariance), slow, walk, np.log([m[2] for m in members]))


def _approaches() -> list[tuple[tuple[float, float], float]]:
    """Slow and fast time constant, s, 0 where there is none; and their probability beforehand."""
    pairs = [(s, f) for s, f in product(TAUS_S.tolist(), FAST_S.tolist()) if s > APART * f]
    kinds = [(0.0, 0.0)], [(s, 0.0) for s in TAUS_S.tolist()], pairs
    found: list[tuple[tuple[float, float], float]] = []
    for kind, probability in zip(kinds, COUNTS, strict=True):
        slow = np.array([max(s, 1.0) for s, _ in kind])
        usual = np.exp(-((np.log(slow / USUAL_S) / USUALLY) ** 2) / 2)
        found += zip(kind, (probability * usual / usual.sum()).tolist(), strict=True)
    return found


def _noises() -> list[tuple[tuple[float, ...], float]]:
    """Rms of each slow process, and the random walk; and their probability beforehand."""
    quiet = [((*np.zeros(len(SLOW_S)), walk), NONE * p) for walk, p in ((0.0, 0.8), (1.5, 0.1), (6.0, 0.1))]
    share = (1 - NONE) / len(RMS)
    return quiet + [((*(rms * np.array(shape)), walk), share * p) for rms, (shape, walk, p) in product(RMS, SHAPES)]
