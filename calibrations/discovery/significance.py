"""Score tests: the part of a residual that a set of columns can explain, and the chance that noise shows as much.

Columns are whitened under the fitted noise, and projected off the model's columns (Frisch, Waugh and Lovell). The
statistic is then a sum of squares, chi-squared under the null. Noise sets drawn under the fitted null, and not a bound,
give the chance that the best of a whole search reaches the statistic on noise.
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
ROUNDING = 1e-11  # of a column's length: remainder by rounding of a column that the model spans
RANK = 1e-9  # of the largest singular value: a smaller one is no direction
STACKED = 16  # groups of columns that are decomposed together: more do not fit into the cache
NEARLY = 1e-6  # least eigenvalue of a Gram matrix of unit columns: a smaller one has too few digits for 1e-9


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
        """The whitened residual, projected off the model's columns, shape (rows,)."""
        return _project_off(self.fit.whitened[:, 0], self.explained)

    def freed(self, residual: Array) -> Array:
        """The part of a residual (channels, n) that the model cannot explain, whitened, shape (rows,)."""
        return _project_off(self.fit.noise.whiten(residual[:, :, None])[:, 0], self.explained)

    def basis(self, columns: Array) -> Array:
        """Orthonormal basis of the directions that `columns` (channels, n, k) add to the model, shape (rows, rank)."""
        return self.bases([columns])[0]

    def bases(self, columns: Sequence[Array]) -> list[Array]:
        """The same for each of `columns`; many together take a fraction of the time."""
        parts = (columns[i : i + STACKED] for i in range(0, len(columns), STACKED))
        return [basis for part in parts for basis in self._bases_of_part(part)]

    def _bases_of_part(self, columns: Sequence[Array]) -> list[Array]:
        white = self.fit.noise.whiten(np.concatenate(columns, axis=2))
        ends = np.cumsum([block.shape[2] for block in columns])[:-1]
        size = np.linalg.norm(white, axis=0)
        free = _project_off(white, self.explained)
        shown = np.linalg.norm(free, axis=0) > NOT_SHOWN * np.where(size > 0, size, 1.0)
        blocks = zip(np.split(free, ends, axis=1), np.split(shown, ends), strict=True)
        return _bases([block[:, kept] for block, kept in blocks])

    def reductions(self, columns: Sequence[Array]) -> Array:
        """Reduction of the residual's sum of squares by each of `columns`, (channels, n, k) each."""
        white = self.fit.noise.whiten(np.concatenate(columns, axis=2))
        ends = np.cumsum([block.shape[2] for block in columns])[:-1]
        return reductions(self.fit.whitened[:, 1:], self.fit.whitened[:, 0], np.split(white, ends, axis=1))

    @property
    def free(self) -> int:
        """Degrees of freedom of the residual."""
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
        nonempty = [k for k, b in enumerate(self.bases) if b.shape[1]]
        if not nonempty:
            return 1.0
        rng = np.random.default_rng(20031)
        noise = rng.standard_normal((len(self.screen.residual), DRAWS))
        squares = (np.hstack([self.bases[k] for k in nonempty]).T @ noise) ** 2
        edges = np.concatenate([[0], np.cumsum(self.ranks[nonempty])]).astype(int)
        sums = np.add.reduceat(squares, edges[:-1], axis=0)
        lowest_p = np.min(chdtrc(self.ranks[nonempty][:, None], sums), axis=0)
        return max(1.0, -DRAWS / float(np.sum(np.log1p(-np.minimum(lowest_p, 1 - 1e-12)))))

    @cached_property
    def p_values(self) -> Array:
        """Chance that the best of this search reaches each statistic on noise alone (F: its level is fitted)."""
        ranks = np.maximum(self.ranks, 1)
        free = min(self.screen.free, self.screen.fit.noise.freedom)
        single = np.where(self.ranks > 0, fdtrc(ranks, free, self.statistics / ranks), 1.0)
        return of_search(single, self.trials)


def of_search(p: Array | float, trials: float) -> Array:
    """1 - (1 - p)^trials, exact for small p."""
    return np.asarray(-np.expm1(trials * np.log1p(-np.minimum(p, 1 - 1e-16))))


def reductions(model: Array, residual: Array, candidates: Sequence[Array]) -> Array:
    """Reduction of the sum of squares of `residual` (rows,) when each of `candidates` (rows, k) joins the model.

    The result is that of one least-squares solution a candidate; `model` (rows, p) is decomposed once. Gram matrices of
    the columns suffice, or of the columns projected off the model where the model nearly spans them. Where neither has
    enough digits, the function makes a basis.
    """
    Q = _basis(model)
    remainder = _project_off(residual, Q)
    basis = np.column_stack([Q, remainder]).T
    products = [(_gram(columns), basis @ columns) for columns in candidates]
    sums, least_eigenvalues = _by_gram(products)
    nearly_spanned = list(map(int, np.flatnonzero(least_eigenvalues < NEARLY)))
    sizes = [np.sqrt(np.diagonal(products[k][0])) for k in nearly_spanned]
    sums[nearly_spanned] = _reductions_off_model(
        [_project_off(candidates[k], Q) for k in nearly_spanned], remainder, sizes
    )
    return sums


def _reductions_off_model(free: Sequence[Array], remainder: Array, sizes: Sequence[Array]) -> Array:
    """The same for candidates projected off the model; `sizes`: column lengths before, which show rounding."""
    products = [(_gram(columns), (remainder @ columns)[None]) for columns in free]
    sums, least_eigenvalues = _by_gram(products)
    for k, (gram, _) in enumerate(products):
        independent = np.sqrt(np.diagonal(gram)) > ROUNDING * sizes[k]
        if least_eigenvalues[k] < NEARLY or not independent.all():
            sums[k] = np.sum((_basis(free[k][:, independent]).T @ remainder) ** 2)
    return sums


def _gram(columns: Array) -> Array:
    """Gram matrix of columns. By a copy: the routine for a matrix with itself is slow on narrow matrices."""
    return np.asarray(columns.T @ columns.copy())


def _by_gram(products: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    """Reductions, and the least eigenvalue of each candidate's Gram matrix off the model, for columns of length 1.

    Products of each candidate: with itself (k, k), and with the model's basis and, last, the residual (p + 1, k).
    """
    count, wide = len(products), max((len(gram) for gram, _ in products), default=0)
    rows = len(products[0][1]) if count else 1
    grams, projected = np.tile(np.eye(wide), (count, 1, 1)), np.zeros((count, rows, wide))
    for k, (gram, projections) in enumerate(products):
        grams[k, : len(gram), : len(gram)], projected[k, :, : len(gram)] = gram, projections
    scale = 1 / np.sqrt(np.maximum(np.diagonal(grams, axis1=1, axis2=2), np.finfo(float).tiny))[:, None]
    projected *= scale
    model, residual_products = projected[:, :-1], projected[:, -1:]
    values, vectors = np.linalg.eigh(grams * scale * scale.swapaxes(1, 2) - model.swapaxes(1, 2) @ model)
    squares = (residual_products @ vectors)[:, 0] ** 2 / np.maximum(values, NEARLY)
    return squares.sum(axis=1), np.min(values, axis=1, initial=1.0)


def _bases(blocks: Sequence[Array]) -> list[Array]:
    """Orthonormal basis of each block (rows, k), in the order of the blocks. Blocks of one shape are one stack."""
    bases = list(blocks)
    for shape in {block.shape for block in blocks}:
        numbers = [i for i, block in enumerate(blocks) if block.shape == shape]
        for i, basis in zip(numbers, _stacked_bases(np.stack([blocks[i] for i in numbers])), strict=True):
            bases[i] = basis
    return bases


def _stacked_bases(stack: Array) -> list[Array]:
    """Orthonormal basis of each of a stack of columns, (blocks, rows, k), of which none is zero."""
    count, rows, k = stack.shape
    if not k:
        return [np.zeros((rows, 0))] * count
    norm = np.linalg.norm(stack, axis=1)
    Q, R = np.linalg.qr(stack / norm[:, None])
    U, s, _ = np.linalg.svd(R)
    ranks = np.sum(s > RANK * s[:, :1], axis=1)
    return [q if rank == k else q @ u[:, :rank] for q, u, rank in zip(Q, U, ranks, strict=True)]


def _basis(columns: Array) -> Array:
    return _stacked_bases(columns[None, :, np.any(columns != 0, axis=0)])[0]


def _project_off(columns: Array, basis: Array) -> Array:
    free = columns - basis @ (basis.T @ columns)
    return np.asarray(free - basis @ (basis.T @ free))  # twice is enough: Kahan and Parlett


def chance(statistic: float, rank: int) -> float:
    """Chance that noise alone gives a sum of squares as large, with `rank` degrees of freedom."""
    return float(chdtrc(max(rank, 1), statistic))


def twice_log_likelihood(fit: Fit) -> float:
    """Twice the restricted log-likelihood, up to a constant of the data."""
    return -deviance(fit.noise, fit.residual, fit.jacobian, np.zeros((fit.table.n, 0)))


def likelihood(fit: Fit) -> float:
    """The same minus log(rows) for each parameter (Schwarz)."""
    return twice_log_likelihood(fit) - len(fit.theta) * float(np.log(fit.residual.size))
