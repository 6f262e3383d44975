"""Score tests: how much of a residual a set of columns could take up, and how often noise alone would show as much.

Columns are made white under the fitted noise and freed of what the model already explains (Frisch, Waugh and Lovell);
the statistic is then a sum of squares, chi-squared under the null. The chance that the best of a whole search does as
well on noise is estimated from noise sets drawn under the fitted null, not from a bound.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtrc, fdtrc

from calibrations.criteria import NOT_SHOWN
from calibrations.fitting.fit import Fit
from calibrations.fitting.noise_fit import deviance
from calibrations.table import Array

DRAWS = 300
ROUNDING = 1e-11  # of a column's length: what rounding leaves of a column that the model holds
NEARLY = 1e-6  # least eigenvalue of a Gram matrix of columns of length 1: less has too few digits left for 1e-9


@dataclass(frozen=True)
class Screen:
    """A fitted model's residual, ready to be searched."""

    fit: Fit

    @cached_property
    def explained(self) -> Array:
        """Orthonormal basis of what the model explains, whitened, shape (rows, rank)."""
        return _basis(self.fit.whitened[:, 1:])

    @cached_property
    def residual(self) -> Array:
        """The whitened residual, freed of the model, shape (rows,)."""
        return _freed(self.fit.whitened[:, 0], self.explained)

    def freed(self, residual: Array) -> Array:
        """What the model cannot explain of a residual (channels, n), whitened, shape (rows,)."""
        return _freed(self.fit.noise.whiten(residual[:, :, None])[:, 0], self.explained)

    def basis(self, columns: Array) -> Array:
        """Orthonormal basis of what `columns` (channels, n, k) could add to the model, shape (rows, rank)."""
        return _beside(self.fit.noise.whiten(columns), self.explained, NOT_SHOWN)

    def reductions(self, columns: Sequence[Array]) -> Array:
        """What the residual's sum of squares falls by with each of `columns`, (channels, n, k) each."""
        white = self.fit.noise.whiten(np.concatenate(columns, axis=2))
        ends = np.cumsum([each.shape[2] for each in columns])[:-1]
        return reductions(self.fit.whitened[:, 1:], self.fit.whitened[:, 0], np.split(white, ends, axis=1))

    @property
    def free(self) -> int:
        """Rows that the model leaves free."""
        rows, explained = self.explained.shape
        return max(int(rows - explained), 1)

    def statistic(self, basis: Array) -> float:
        """Sum of squares of the residual along `basis`."""
        return float(np.sum((basis.T @ self.residual) ** 2))


@dataclass(frozen=True)
class Search:
    """Several bases searched together for the best one."""

    screen: Screen
    bases: Sequence[Array]

    @cached_property
    def statistics(self) -> Array:
        """The statistic of each basis."""
        return np.array([self.screen.statistic(b) for b in self.bases])

    @cached_property
    def ranks(self) -> Array:
        """Degrees of freedom of each basis."""
        return np.array([b.shape[1] for b in self.bases], dtype=float)

    @cached_property
    def trials(self) -> float:
        """Effective number of independent tests: the least p-value of the search on noise is Beta(1, trials)."""
        some = [k for k, b in enumerate(self.bases) if b.shape[1]]
        if not some:
            return 1.0
        rng = np.random.default_rng(20031)
        noise = rng.standard_normal((len(self.screen.residual), DRAWS))
        squares = (np.hstack([self.bases[k] for k in some]).T @ noise) ** 2
        edges = np.concatenate([[0], np.cumsum(self.ranks[some])]).astype(int)
        sums = np.add.reduceat(squares, edges[:-1], axis=0)
        least = np.min(chdtrc(self.ranks[some][:, None], sums), axis=0)
        return max(1.0, -DRAWS / float(np.sum(np.log1p(-np.minimum(least, 1 - 1e-12)))))

    @cached_property
    def p_values(self) -> Array:
        """Chance that the best of this search does as well as each basis, on noise alone (F: its level is fitted)."""
        ranks = np.maximum(self.ranks, 1)
        free = min(self.screen.free, self.screen.fit.noise.freedom)
        single = np.where(self.ranks > 0, fdtrc(ranks, free, self.statistics / ranks), 1.0)
        return of_search(single, self.trials)


def of_search(p: Array | float, trials: float) -> Array:
    """1 - (1 - p)^trials, exact for small p."""
    return np.asarray(-np.expm1(trials * np.log1p(-np.minimum(p, 1 - 1e-16))))


def reductions(model: Array, residual: Array, candidates: Sequence[Array]) -> Array:
    """What the sum of squares of `residual` (rows,) falls by when each of `candidates` (rows, k) joins the model.

    As a least-squares solution each would give it, with `model` (rows, p) worked out once. Gram matrices are enough, of
    the columns as they are, or freed of the model where they are nearly its own; a basis is made where neither has the
    digits.
    """
    Q = _basis(model)
    left = _freed(residual, Q)
    known = np.column_stack([Q, left]).T
    products = [(_gram(columns), known @ columns) for columns in candidates]
    sums, least = _by_gram(products)
    near = list(map(int, np.flatnonzero(least < NEARLY)))
    sizes = [np.sqrt(np.diagonal(products[k][0])) for k in near]
    sums[near] = _near_reductions([_freed(candidates[k], Q) for k in near], left, sizes)
    return sums


def _near_reductions(free: Sequence[Array], left: Array, sizes: Sequence[Array]) -> Array:
    """The same for candidates freed of the model; `sizes` are their columns' lengths before, to know rounding by."""
    products = [(_gram(columns), (left @ columns)[None]) for columns in free]
    sums, least = _by_gram(products)
    for k, (gram, _) in enumerate(products):
        kept = np.sqrt(np.diagonal(gram)) > ROUNDING * sizes[k]
        if least[k] < NEARLY or not kept.all():
            sums[k] = np.sum((_basis(free[k][:, kept]).T @ left) ** 2)
    return sums


def _gram(columns: Array) -> Array:
    """Products of columns with each other. Of a copy: the routine for a matrix with itself is slow on narrow ones."""
    return np.asarray(columns.T @ columns.copy())


def _by_gram(products: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Reductions, and the least eigenvalue of each candidate's Gram matrix freed of the model, columns of length 1.

    Products of each candidate: with itself (k, k), and with the model's basis and, last, the residual (p + 1, k).
    """
    count, wide = len(products), max((len(gram) for gram, _ in products), default=0)
    known = len(products[0][1]) if count else 1
    grams, along = np.tile(np.eye(wide), (count, 1, 1)), np.zeros((count, known, wide))
    for k, (gram, projections) in enumerate(products):
        grams[k, : len(gram), : len(gram)], along[k, :, : len(gram)] = gram, projections
    scale = 1 / np.sqrt(np.maximum(np.diagonal(grams, axis1=1, axis2=2), np.finfo(float).tiny))[:, None]
    along *= scale
    model, sides = along[:, :-1], along[:, -1:]
    values, vectors = np.linalg.eigh(grams * scale * scale.swapaxes(1, 2) - model.swapaxes(1, 2) @ model)
    squares = (sides @ vectors)[:, 0] ** 2 / np.maximum(values, NEARLY)
    return squares.sum(axis=1), np.min(values, axis=1, initial=1.0)


def _beside(columns: Array, basis: Array, least: float) -> Array:
    """Orthonormal basis of what columns add to those of `basis`, without those of which less than `least` is left."""
    size = np.linalg.norm(columns, axis=0)
    free = _freed(columns, basis)
    return _basis(free[:, np.linalg.norm(free, axis=0) > least * np.where(size > 0, size, 1.0)])


def _basis(columns: Array) -> Array:
    if not columns.size:
        return np.zeros((len(columns), 0))
    norm = np.sqrt(np.einsum("ij,ij->j", columns, columns))
    Q, R = np.linalg.qr(columns[:, norm > 0] / norm[norm > 0])
    U, s, _ = np.linalg.svd(R)
    rank = int(np.sum(s > 1e-9 * s[0])) if len(s) else 0
    return Q if rank == Q.shape[1] else Q @ U[:, :rank]


def _freed(columns: Array, basis: Array) -> Array:
    free = columns - basis @ (basis.T @ columns)
    return np.asarray(free - basis @ (basis.T @ free))  # twice is enough: Kahan and Parlett


def chance(statistic: float, rank: int) -> float:
    """Chance that noise alone gives a sum of squares as large, with `rank` degrees of freedom."""
    return float(chdtrc(max(rank, 1), statistic))


def twice_log_likelihood(fit: Fit) -> float:
    """Restricted, up to a constant of the data."""
    return -deviance(fit.noise, fit.residual, fit.jacobian, np.zeros((fit.table.n, 0)))


def likelihood(fit: Fit) -> float:
    """The same, a parameter costing log(rows) (Schwarz)."""
    return twice_log_likelihood(fit) - len(fit.theta) * float(np.log(fit.residual.size))
