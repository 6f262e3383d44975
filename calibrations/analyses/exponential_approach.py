"""Exponentials towards a final value, fitted under noise that may be slow.

    y(t) = y_end + sum A_k exp(-(t - t_0) / tau_k) + noise      none, one (a board's hours) or two (also a package's
                                                              minutes); t_0 is the first time

The noise is white; or white and one Gauss-Markov process (the slowest is a random walk); or white and flicker; all on a
grid. The likelihood, averaged over the noise, decides the number of exponentials, so that a drift that a random walk
explains is not an exponential. Estimates and standard errors are averaged over the noise by its restricted likelihood:
they contain the uncertainty about the noise in a short record.

Source  Barshan and Durrant-Whyte, IEEE Trans. Robotics and Automation 11 (1995) 328: the model; Patterson and Thompson
        (1971): restricted likelihood; JCGM 101, 6.4.9: few values; Hoeting et al., Statistical Science 14 (1999) 382:
        averaging over models.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calibrations.criteria import LEAST_TAU_RATIO, WALK_RATIO
from calibrations.means.noise import rms, whiten_columns
from calibrations.table import Array

TAUS = 40  # time constants on the grid
PROCESSES = 6  # in flicker noise; also the number of time constants of the single process
RATIOS = tuple(np.geomspace(0.5, 60.0, 8).tolist())  # slow noise over fast noise
PRIOR = (0.2, 0.2, 0.6)  # probability of white noise, of one process, and of flicker, which electronics has
STEPS = 30
LONGEST_STEP = 0.5  # in the logarithm of a time constant
CONVERGED = 1e-6  # change of -2 log likelihood
LEAST_LIKELIHOOD = 0.01  # share of the total likelihood: less likely noise is left out of the average

Point = tuple[float, tuple[float, ...]]  # slow noise over fast, and its time constants


@dataclass(frozen=True)
class Exponentials:
    """Fitted exponentials.

    parameters   (y_end, A_1 .., ln tau_1 ..), slowest first, the amplitudes at the first value; their covariance
    noise        standard deviation of one value, slow noise included
    wandering    probability that the noise is a random walk over the record
    """

    parameters: Array
    covariance: Array
    noise: float
    wandering: float


def remaining_drift(p: Array, t_s: Array) -> Array:
    """The remaining drift at times since the first value, s: shape (n,); `p` as in `Exponentials`."""
    k = (len(p) - 1) // 2
    return np.asarray(np.exp(-t_s[:, None] / np.exp(p[1 + k :])) @ p[1 : 1 + k])


def model_derivatives(p: Array, t_s: Array) -> Array:
    """Derivatives of the model by its parameters, shape (n, p)."""
    k = (len(p) - 1) // 2
    time_ratio = t_s[:, None] / np.exp(p[1 + k :])
    return np.column_stack([np.ones(len(t_s)), np.exp(-time_ratio), p[1 : 1 + k] * np.exp(-time_ratio) * time_ratio])


@dataclass(frozen=True)
class Series:
    """Values at times from 0, s, with white standard errors (0: unknown), in units of their scatter; (n,) each."""

    t_s: Array
    values: Array
    stds: Array

    def likeliest(self, k: int) -> tuple[Array, float]:
        """The most likely `k` exponentials, and their -2 log likelihood averaged over the noise."""
        taus_s, point = self._best_on_grid(k)
        p = self._descend(self._start(taus_s, point), point)
        likelihood = [np.log(prior) - self._score(p, noise)[0] / 2 for noise, prior in self.points.items()]
        return _slowest_first(p), -2 * float(np.logaddexp.reduce(likelihood))

    def averaged(self, p: Array) -> Exponentials:
        """Parameters from the start `p`, covariance and noise, averaged over the noise by restricted likelihood."""
        p = self._descend(p, min(self.points, key=lambda point: self._score(p, point)[1]))
        restricted = np.array([self._score(p, point)[1] for point in self.points])
        weight = np.exp((restricted.min() - restricted) / 2) * np.array(list(self.points.values()))
        likely_points = np.flatnonzero(weight > LEAST_LIKELIHOOD * weight.sum())
        likely = [list(self.points)[i] for i in likely_points]
        weight = weight[likely_points] / weight[likely_points].sum()
        fits = np.array([self._descend(p, point) for point in likely])
        _, _, covariances, noise = zip(*map(self._score, fits, likely), strict=True)
        mean = weight @ fits
        covariance = np.einsum("i,ijk->jk", weight, np.array(covariances))
        covariance += np.einsum("i,ij,ik->jk", weight, fits - mean, fits - mean)
        half = float(np.sum(self.gap_s)) / 2
        walks = [len(taus) == 1 and ratio > WALK_RATIO and taus[0] > half for ratio, taus in likely]
        return Exponentials(
            mean, covariance, float(np.sqrt(weight @ np.square(noise))), float(weight @ np.array(walks))
        )

    @cached_property
    def gap_s(self) -> Array:
        return np.diff(self.t_s, prepend=self.t_s[0])

    @cached_property
    def known(self) -> bool:
        """Whether the white noise is known; it is then the least noise."""
        return bool(np.all(self.stds > 0))

    @cached_property
    def points(self) -> dict[Point, float]:
        """Noise on the grid, with its prior probability."""
        span, gap = float(np.sum(self.gap_s)), float(np.median(self.gap_s[1:]))
        single = [(float(tau),) for tau in np.geomspace(gap, 3 * span, PROCESSES)]
        flicker = tuple(np.geomspace(gap / 2, 3 * span, PROCESSES).tolist())
        kinds = ([(0.0, (1.0,))], [(r, taus) for taus in single for r in RATIOS], [(r, flicker) for r in RATIOS])
        return {point: w / len(kind) for kind, w in zip(kinds, PRIOR, strict=True) for point in kind}

    @cached_property
    def _ln_taus(self) -> Array:
        """Logarithms of the time constants on the grid, s: from half of the shortest gap to three records."""
        return np.linspace(np.log(float(self.gap_s[1:].min()) / 2), np.log(3 * float(np.sum(self.gap_s))), TAUS)

    def _whiten(self, columns: Array, point: Point) -> tuple[Array, float]:
        fast = self.stds if self.known else np.ones(len(self.t_s))
        return whiten_columns(columns, self.gap_s, fast, point[0] * float(rms(fast)), point[1])

    def _factor(self, square: float | Array, free: int) -> Array:
        """Variance of the noise over that of the grid point."""
        return np.maximum(np.asarray(square) / free, 1.0 if self.known else 1e-30)

    def _best_on_grid(self, k: int) -> tuple[tuple[float, ...], Point]:
        """Time constants and noise of greatest likelihood on the grid."""
        taus, points = np.exp(self._ln_taus), list(self.points)
        sets = [s for s in combinations(range(TAUS), k) if k < 2 or taus[s[1]] >= LEAST_TAU_RATIO * taus[s[0]]]
        column_sets = np.array([[0, *(1 + i for i in s)] for s in sets])
        columns = np.column_stack([np.ones(len(self.t_s)), np.exp(-self.t_s[:, None] / taus), self.values])
        scores = np.array([self._deviances(columns, point, column_sets) for point in points])
        best, best_set = np.unravel_index(int(np.argmin(scores)), scores.shape)
        return tuple(float(taus[i]) for i in sets[best_set]), points[best]

    def _deviances(self, columns: Array, point: Point, column_sets: NDArray[np.intp]) -> Array:
        """-2 log likelihood of each choice of columns, shape (choices,); the last column is the values."""
        whitened, logdet = self._whiten(columns, point)
        gram, n = whitened.T @ whitened, len(whitened)
        normal, products = gram[column_sets[:, :, None], column_sets[:, None, :]], gram[column_sets, -1]
        ridge = 1e-10 * gram[0, 0] * np.eye(column_sets.shape[1])
        solved = np.linalg.solve(normal + ridge, products[:, :, None])[:, :, 0]
        square = np.maximum(gram[-1, -1] - np.sum(products * solved, axis=1), 0.0)
        factor = self._factor(square, n)
        return np.asarray(square / factor + n * np.log(factor) + logdet)

    def _start(self, taus_s: tuple[float, ...], point: Point) -> Array:
        columns = [np.ones(len(self.t_s)), *(np.exp(-self.t_s / tau) for tau in taus_s), self.values]
        whitened, _ = self._whiten(np.column_stack(columns), point)
        return np.concatenate([np.linalg.lstsq(whitened[:, :-1], whitened[:, -1], rcond=None)[0], np.log(taus_s)])

    def _linearise(self, p: Array, point: Point) -> tuple[Array, Array, float]:
        """Whitened derivatives (n, p) and residual (n,) at `p`, and log det of the noise."""
        columns = np.column_stack([model_derivatives(p, self.t_s), self.values - p[0] - remaining_drift(p, self.t_s)])
        whitened, logdet = self._whiten(columns, point)
        return whitened[:, :-1], whitened[:, -1], logdet

    def _descend(self, p: Array, point: Point) -> Array:
        """The best parameters under the noise of `point` from a start nearby (Levenberg and Marquardt)."""
        damping, k = 1e-3, (len(p) - 1) // 2
        J, r, _ = self._linearise(p, point)
        for _ in range(STEPS):
            normal = J.T @ J
            step = np.linalg.lstsq(normal + damping * np.diag(np.diag(normal)), J.T @ r, rcond=None)[0]
            step[1 + k :] = (
                self._clip_to_bounds(p[1 + k :] + np.clip(step[1 + k :], -LONGEST_STEP, LONGEST_STEP)) - p[1 + k :]
            )
            trial = self._linearise(p + step, point)
            gain = float(r @ r - trial[1] @ trial[1])
            damping = damping / 10 if gain >= 0 else damping * 10
            if gain >= 0:
                p, (J, r, _) = p + step, trial
            if 0 <= gain < CONVERGED:
                break
        return p

    def _score(self, p: Array, point: Point) -> tuple[float, float, Array, float]:
        """-2 log likelihood, its restricted form, the covariance of `p`, and the noise of a value; to first order."""
        J, r, logdet = self._linearise(p, point)
        n, free = len(r), len(r) - len(p)
        inverse = np.linalg.pinv(J.T @ J, hermitian=True)
        square = max(float(r @ r - (J.T @ r) @ inverse @ (J.T @ r)), 0.0)
        factor_of_all, part = float(self._factor(square, n)), float(self._factor(square, free))
        likelihood = square / factor_of_all + n * np.log(factor_of_all) + logdet
        information = float(np.linalg.slogdet(J.T @ J + 1e-12 * np.eye(len(p)))[1])
        restricted = square / part + free * np.log(part) + logdet + information
        widened = part * free / max(free - 2, 1)  # Student's t
        fast = float(rms(self.stds)) if self.known else 1.0
        return (
            likelihood,
            restricted,
            np.asarray(widened * inverse),
            float(np.sqrt(part) * fast * np.hypot(1.0, point[0])),
        )

    def _clip_to_bounds(self, ln_taus: Array) -> Array:
        return np.clip(ln_taus, self._ln_taus[0], self._ln_taus[-1])


def _slowest_first(p: Array) -> Array:
    k = (len(p) - 1) // 2
    order = np.argsort(-p[1 + k :])
    return np.concatenate([p[:1], p[1 : 1 + k][order], p[1 + k :][order]])
