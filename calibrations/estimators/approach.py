"""An exponential approach to a steady state, followed while it happens.

    value(t) = c + r(t) + slow noise + white noise      r' = -r / tau      what is left to come, slowest first; none,
                                                                           one (a board's hours) or two (and a package's
                                                                           minutes)

A bank of extended Kalman filters runs side by side. Each has its cell of time constants, within which it estimates them,
and its own slow noise: flicker, as a sum of Gauss-Markov processes, or a random walk beside it. How well each foresaw
what came is its weight. So what cannot be known yet, the time constant of a drift that has hardly bent and the noise
of a record that has hardly begun, is in the bounds, which are those of the whole bank.

Units: values in `unit`, the white standard error of one value; amplitudes beforehand within `most` of these.

Source  Barshan and Durrant-Whyte, IEEE Trans. Robotics and Automation 11 (1995) 328: the model, and the filter; Magill,
        IEEE Trans. Automatic Control 10 (1965) 434: a bank; Alspach and Sorenson, ibid. 17 (1972) 439: Gaussian sums.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calibrations.estimators.kalman import Belief, corrected, predicted
from calibrations.table import Array

LEVEL, OFFSET, REST, LN_TAU, SLOW, WALK = 0, 1, 2, 4, 6, 11  # places in the state: REST and LN_TAU have two each
SIZE = 12
CELL = 0.3  # of a logarithm of a time constant
TAUS_S = np.exp(np.arange(np.log(150.0), np.log(100e3), CELL))
FAST_S = np.exp(np.arange(np.log(60.0), np.log(1300.0), 2 * CELL))
APART = 3.0  # nearer than this factor, two time constants are one to any noise
SLOW_S = np.array([20.0, 120.0, 800.0, 5e3, 3e4])  # of flicker noise
FLICKER = (0.0, 0.25, 0.7, 2.0, 6.0)  # rms of each of these processes, in units
SORTS = ((0.0, 0.0, 0.55), (0.4, 0.0, 0.25), (0.0, 1.5, 0.1), (0.0, 6.0, 0.1))  # redness, walk, probability
USUAL_S, USUALLY = 3600.0, 1.2  # of a slow time constant beforehand: its median, and the std of its logarithm
BEFOREHAND = (0.3, 0.4, 0.3)  # probability of no exponential, one, two
UNLIKELY = 1e-7  # a filter of less weight is let go
HOUR_S = 3600.0


@dataclass(frozen=True)
class Bank:
    """k filters at `t_s`: what each believes, its slow noise and walk (k,), its log weight (k,)."""

    t_s: float
    belief: Belief
    flicker: Array
    walk: Array
    log_weight: Array

    @property
    def weight(self) -> Array:
        """Probability of each filter, (k,)."""
        weight = np.exp(self.log_weight - self.log_weight.max())
        return np.asarray(weight / weight.sum())

    def at(self, t_s: float) -> Bank:
        """The bank at a later time, with nothing measured since."""
        gap_s, mean = t_s - self.t_s, self.belief.mean.copy()
        over = gap_s * np.exp(-mean[:, LN_TAU:SLOW])
        kept, slow = np.exp(-over), np.exp(-gap_s / SLOW_S)
        step = np.tile(np.eye(SIZE), (len(mean), 1, 1))
        for k in range(2):
            step[:, REST + k, REST + k] = kept[:, k]
            step[:, REST + k, LN_TAU + k] = mean[:, REST + k] * kept[:, k] * over[:, k]
        noise = np.zeros_like(step)
        for k in range(len(SLOW_S)):
            step[:, SLOW + k, SLOW + k] = slow[k]
            noise[:, SLOW + k, SLOW + k] = self.flicker[:, k] ** 2 * (1 - slow[k] ** 2)
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
        return replace(ahead, belief=done.belief, log_weight=self.log_weight + done.log_likelihood)._pruned()

    def _pruned(self) -> Bank:
        likely = self.weight > UNLIKELY
        belief = Belief(self.belief.mean[likely], self.belief.covariance[likely])
        return Bank(self.t_s, belief, self.flicker[likely], self.walk[likely], self.log_weight[likely])


def bank(t_s: float, value: float, most: float) -> Bank:
    """Before anything is measured: `value` is near the first one, at `t_s`; a drift is seldom beyond `most`."""
    taus = [(0.0, 0.0)], [(tau, 0.0) for tau in TAUS_S], [(s, f) for s, f in product(TAUS_S, FAST_S) if s > APART * f]
    kinds = [(p, prior * w) for pairs, prior in zip(taus, BEFOREHAND, strict=True) for p, w in _usual(pairs)]
    noises = [((f, red, w), p / len(FLICKER)) for f, (red, w, p) in product(FLICKER, SORTS)]
    members = [(pair, noise, np.log(p * q)) for pair, p in kinds for noise, q in noises]
    mean, covariance = np.zeros((len(members), SIZE)), np.zeros((len(members), SIZE, SIZE))
    pairs, flickers = np.array([m[0] for m in members]), np.array([m[1] for m in members])
    mean[:, LEVEL] = value
    mean[:, LN_TAU:SLOW] = np.log(np.where(pairs > 0, pairs, 1.0))
    covariance[:, LEVEL, LEVEL] = covariance[:, OFFSET, OFFSET] = (3 * most) ** 2
    for k, cell in enumerate((CELL, 2 * CELL)):
        covariance[:, REST + k, REST + k] = np.where(pairs[:, k] > 0, most**2, 0.0)
        covariance[:, LN_TAU + k, LN_TAU + k] = np.where(pairs[:, k] > 0, (cell / 2) ** 2, 0.0)
    rms = flickers[:, :1] * (SLOW_S / SLOW_S[2]) ** flickers[:, 1:2]
    for k in range(len(SLOW_S)):
        covariance[:, SLOW + k, SLOW + k] = rms[:, k] ** 2
    return Bank(t_s, Belief(mean, covariance), rms, flickers[:, 2], np.array([m[2] for m in members]))


def _usual(pairs):
    slow = np.array([max(s, 1.0) for s, _ in pairs])
    w = np.exp(-0.5 * (np.log(slow / USUAL_S) / USUALLY) ** 2)
    return list(zip(pairs, w / w.sum()))
