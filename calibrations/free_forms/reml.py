"""Sizes by restricted maximum likelihood, on a matrix of products that is made once for all components.

With the base (flat prior) eliminated, data y = Z u + e, e ~ N(0, phi I) whitened, u_k ~ N(0, tau_k^2 I):

    -2 l = y'y - y'Z H^-1 Z'y + log |H| + sum m_k log tau_k^2,      H = Z'Z + diag(1 / tau_k^2)

Sizes follow from tau_k^2 <- u_k'u_k / (m_k - tr(H^-1)_kk / tau_k^2), the update of Fellner and Schall.

Source  Patterson and Thompson, Biometrika 58 (1971) 545; Wood and Fasiolo, Biometrics 73 (2017) 1071.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs, dtrtri

from calibrations.free_forms.chain import Coefficients, ModelEffects, State, base_jacobian
from calibrations.free_forms.components import Component
from calibrations.table import Array

RANK = 1e-11  # of the largest eigenvalue of the base's products
NOTHING = 1e-9  # of the largest base column: a smaller one is rounding, as the axis out of the plane at one inclination
LEAST_BESIDE = 1e-3  # of a component's squares: less beside the base is not magnified
ROUNDS = 40
SETTLED = 0.02  # of a variance
WHOLE = 64  # rows of a triangular matrix that is inverted at once
REACH = 20.0  # times the gain of a step: a deviance farther away cannot be reached


@dataclass(frozen=True, eq=False)
class Gram:
    """Products of all whitened columns with each other and with the data, the base eliminated.

    products  (p, p), with (p,) and squares ()
    blocks    columns of each component
    """

    products: Array
    with_data: Array
    squares: float
    blocks: Mapping[str, slice]
    scales: Mapping[str, float]
    base_inverse: Array  # (b, b)
    base_products: Array  # (b, p)
    base_with_data: Array  # (b,)
    rows: int
    base_rank: int

    def indices(self, names: Iterable[str]) -> Array:
        """Column numbers of these components in order."""
        parts = [np.arange(self.blocks[name].start, self.blocks[name].stop) for name in names]
        return np.concatenate(parts) if parts else np.zeros(0, dtype=int)


def whiten(
    state: State,
    model_effects: ModelEffects,
    values: Coefficients,
    components: Sequence[Component],
    scales: Mapping[str, float],
    white: Array,
) -> tuple[Array, dict[str, slice], dict[str, float]]:
    """[base, components, data] over the white noise, (channels * n, b + p + 1), blocks, scales."""
    data = state.data
    base = base_jacobian(state, model_effects)
    target = data.outputs - state.predicted + base @ values.base
    blocks, start, parts, column_scales = {}, 0, [base], dict(scales)
    for comp in components:
        J = comp.jacobian(state)
        if comp.name not in column_scales:
            column_scales[comp.name] = float(np.sqrt(np.mean(np.sum(J * J, axis=2)))) or 1.0
        J = J / column_scales[comp.name]
        if comp.name in values.of and not comp.noise:
            target = target + J @ (values.of[comp.name] * column_scales[comp.name])
        parts.append(J)
        blocks[comp.name] = slice(start, start + J.shape[2])
        start += J.shape[2]
    X = np.concatenate([*parts, target[:, :, None]], axis=2)
    X /= white[:, :, None]
    return X.reshape(-1, X.shape[2]), blocks, column_scales


def gram(X: Array, blocks: Mapping[str, slice], scales: Mapping[str, float], b: int, channels: int = 1) -> Gram:
    """Products of whitened columns [base (b), components, data], (channels * rows, ...), the base eliminated."""
    return eliminate_base(_products_by_channel(X, channels), blocks, scales, b, len(X))


def _products_by_channel(X: Array, channels: int) -> Array:
    """X'X for the rows of one channel after another: most columns belong to one channel and are zero in the others."""
    products = np.zeros((X.shape[1], X.shape[1]))
    for rows in X.reshape(channels, -1, X.shape[1]):
        used = np.flatnonzero(rows.any(axis=0))
        part = rows[:, used]
        products[used[:, None], used] += part.T @ part
    return products


def eliminate_base(G: Array, blocks: Mapping[str, slice], scales: Mapping[str, float], b: int, rows: int) -> Gram:
    """The same from the products of all columns."""
    size = np.sqrt(np.maximum(np.diag(G)[:b], 1e-300))
    size = np.where(size > NOTHING * size.max(), size, np.inf)
    values, vectors = np.linalg.eigh(G[:b, :b] / np.outer(size, size))
    independent = values > RANK * values[-1]
    inverse = (vectors[:, independent] / values[independent]) @ vectors[:, independent].T / np.outer(size, size)
    cross = G[:b, b:]
    remainder = G[b:, b:] - cross.T @ inverse @ cross
    squares = max(float(remainder[-1, -1]), 1e-300)
    return Gram(
        remainder[:-1, :-1], remainder[:-1, -1], squares, blocks, scales, inverse, cross[:, :-1], cross[:, -1], rows,
        int(independent.sum()),
    )  # fmt: skip


def scale_components(X: Array, g: Gram) -> tuple[Array, Gram]:
    """Columns and products such that the part of each component beside the base has the squares of all of it."""
    b, scales = len(g.base_inverse), dict(g.scales)
    factors = np.ones(X.shape[1])
    for name, block in g.blocks.items():
        columns = X[:, b + block.start : b + block.stop]
        raw = float(np.vdot(columns, columns)) or 1.0
        factor = max(float(np.trace(g.products[block, block])) / raw, LEAST_BESIDE) ** 0.5
        scales[name] = g.scales[name] * factor
        factors[b + block.start : b + block.stop] = factor
    by_component = factors[b:-1]
    scaled = replace(
        g,
        products=g.products / by_component[:, None] / by_component,
        with_data=g.with_data / by_component,
        scales=scales,
        base_products=g.base_products / by_component,
    )
    return X / factors, scaled


@dataclass(frozen=True, eq=False)
class Sizes:
    """Variances of the active components, coefficients and -2 log restricted likelihood."""

    variances: Mapping[str, float]
    coefficients: Array
    inverse: Array  # H^-1
    deviance: float

    def of(self, g: Gram, name: str) -> Array:
        """Coefficients of one active component (of normalised columns)."""
        start = 0
        for component in self.variances:
            m = g.blocks[component].stop - g.blocks[component].start
            if component == name:
                return self.coefficients[start : start + m]
            start += m
        raise KeyError(name)

    def shrinkage(self, g: Gram, name: str) -> float:
        """Coefficients of one active component that its prior determines, in place of the data."""
        part = _part(g, self, name)
        return float(np.trace(self.inverse[part, part])) / self.variances[name]


@dataclass(frozen=True, eq=False)
class _Solved:
    """Coefficients (p,) at some variances, L^-1 of H = L L' in units of `std`, and the deviance."""

    variances: Mapping[str, float]
    coefficients: Array
    inverse_root: Array
    std: Array
    deviance: float

    @property
    def shrunk(self) -> Array:
        """Diagonal of H^-1 in units of the variances, (p,)."""
        return np.asarray(np.einsum("ij,ij->j", self.inverse_root, self.inverse_root))

    @property
    def sizes(self) -> Sizes:
        """The same with the whole inverse."""
        root = self.inverse_root * self.std
        return Sizes(dict(self.variances), self.coefficients, root.T @ root, self.deviance)


@dataclass(frozen=True, eq=False)
class _Products:
    """Products of the columns of the active components with each other, (p, p), and with the data, (p,)."""

    products: Array
    with_data: Array
    squares: float
    widths: tuple[int, ...]

    @staticmethod
    def of(g: Gram, names: Sequence[str]) -> _Products:
        rows = g.indices(names)
        widths = tuple(g.blocks[name].stop - g.blocks[name].start for name in names)
        return _Products(g.products[np.ix_(rows, rows)], g.with_data[rows], g.squares, widths)

    def solved(self, variances: Mapping[str, float]) -> _Solved:
        if not variances:
            return _Solved({}, np.zeros(0), np.zeros((0, 0)), np.zeros(0), self.squares)
        std = np.sqrt(np.repeat(list(variances.values()), self.widths))
        K = self.products * std[:, None]
        K *= std
        K[np.diag_indices_from(K)] += 1.0  # H = D^-1 K D^-1 with D the standard deviations: well conditioned
        root = _root(K)
        logdet = 2 * float(np.sum(np.log(np.diag(root))))
        inverse_root = _inverse_root(root)
        answer = std * (inverse_root.T @ (inverse_root @ (std * self.with_data)))
        return _Solved(variances, answer, inverse_root, std, self.squares - float(self.with_data @ answer) + logdet)


def _root(K: Array) -> Array:
    """Lower Cholesky factor; where rounding made K indefinite, of K with a little more on its diagonal."""
    if not np.isfinite(K).all():
        raise ArithmeticError("the products of the columns are not finite")
    root, failed = dpotrf(K, lower=1)
    addition = 1e-12 * float(np.max(np.diag(K), initial=0.0))
    while failed:
        root, failed = dpotrf(K + addition * np.eye(len(K)), lower=1)
        addition *= 100
    return np.asarray(root)


def _inverse_root(root: Array) -> Array:
    """Inverse of a lower triangular matrix by halves, because products are faster than substitution."""
    n = len(root)
    if n <= WHOLE:
        return np.asarray(dtrtri(root, lower=1)[0])
    half = n // 2
    first, second = _inverse_root(root[:half, :half]), _inverse_root(root[half:, half:])
    inverse = np.zeros_like(root)
    inverse[:half, :half] = first
    inverse[half:, half:] = second
    inverse[half:, :half] = -second @ (root[half:, :half] @ first)
    return inverse


def estimate(
    g: Gram,
    variances: Mapping[str, float],
    most: Mapping[str, float],
    rounds: int = ROUNDS,
    target: float = np.inf,
) -> Sizes:
    """Variances of greatest restricted likelihood, none above `most`, by Fellner-Schall steps with extrapolation.

    The steps end early where the deviance will not fall to `target`: each gains less than the one before.
    """
    present = {name: min(v, most.get(name, np.inf)) for name, v in variances.items()}
    products = _Products.of(g, list(present))
    fit = products.solved(present)
    for _ in range(rounds):
        updated, start, largest_change = {}, 0, 0.0
        shrunk = fit.shrunk
        for (name, v), m in zip(present.items(), products.widths, strict=True):
            part = slice(start, start + m)
            start += m
            free = m - float(np.sum(shrunk[part]))
            size = float(fit.coefficients[part] @ fit.coefficients[part])
            factor = np.clip(size / max(v * free, 1e-300), 0.05, 20.0) ** 1.4
            updated[name] = float(np.clip(v * factor, 1e-16, most.get(name, 1e8)))
            largest_change = max(largest_change, abs(np.log(updated[name] / v)) * min(1.0, free / 0.01))
        next_fit = products.solved(updated)
        if next_fit.deviance > fit.deviance + 1e-6:  # too far: halfway back
            updated = {k: float(np.sqrt(v * present[k])) for k, v in updated.items()}
            next_fit = products.solved(updated)
        gained = fit.deviance - next_fit.deviance
        if gained < -0.5:
            break
        present, fit = updated, next_fit
        if largest_change < SETTLED or abs(gained) < 0.01 or fit.deviance - REACH * gained > target:
            break
    return fit.sizes


GRID, FINE_GRID = np.exp(np.linspace(-12.0, 6.0, 19)), np.exp(np.linspace(-0.8, 0.8, 9))  # of a variance
NO_PRODUCTS = 1e-9  # share of a component that is independent of the active ones: a smaller one gains nothing
LEAST_VARIANCE = 1e-12  # of a component that gains nothing


def gains(g: Gram, fit: Sizes, names: Sequence[str]) -> dict[str, tuple[float, float]]:
    """By inactive component: gain in -2 log likelihood at its best variance, the others held, and this variance."""
    if not names:
        return {}
    active, inactive = g.indices(fit.variances), g.indices(names)
    cross = g.products[np.ix_(active, inactive)]
    solved = fit.inverse @ cross
    side = g.with_data[inactive] - cross.T @ fit.coefficients
    by_width: dict[int, list[tuple[str, slice]]] = {}
    start = 0
    for name in names:
        m = g.blocks[name].stop - g.blocks[name].start
        by_width.setdefault(m, []).append((name, slice(start, start + m)))
        start += m
    answer: dict[str, tuple[float, float]] = {}
    for members in by_width.values():  # matrices of one size are decomposed together
        blocks = [(g.blocks[name], part) for name, part in members]
        M = np.stack([g.products[block, block] - cross[:, part].T @ solved[:, part] for block, part in blocks])
        values, variances = _gains(M, np.stack([side[part] for _, part in members]))
        answer |= {name: (float(v), float(t)) for (name, _), v, t in zip(members, values, variances, strict=True)}
    return answer


def _gains(M: Array, side: Array) -> tuple[Array, Array]:
    """Greatest gains and their variances, (k,), of k components with products M (k, m, m) and `side` (k, m)."""
    d, V = np.linalg.eigh((M + M.transpose(0, 2, 1)) / 2)
    d = np.maximum(d, 0.0)
    q = np.einsum("kij,ki->kj", V, side) ** 2
    acts = d[:, -1] > NO_PRODUCTS
    largest = np.where(acts, d[:, -1], 1.0)

    def best(variances: Array) -> tuple[Array, Array]:
        with_variance = variances[:, :, None] * d[:, None, :]
        values = np.sum(q[:, None, :] * variances[:, :, None] / (1 + with_variance) - np.log1p(with_variance), axis=2)
        rows = np.arange(len(values)), np.argmax(values, axis=1)
        return values[rows], variances[rows]

    usual = np.maximum(q.sum(axis=1) / largest, 1.0) / largest / d.shape[1]
    _, variance = best(usual[:, None] * GRID)
    value, variance = best(variance[:, None] * FINE_GRID)
    return np.where(acts, np.maximum(value, 0.0), 0.0), np.where(acts, variance, LEAST_VARIANCE)


def gain_of_columns(g: Gram, fit: Sizes, X: Array, b: int) -> Callable[[Array], float]:
    """The gain of whitened columns (rows, m) that are not in g; X are the columns that g was made of."""
    active = g.indices(fit.variances)
    active_columns, by_products = X[:, b + active].T, g.base_products[:, active].T  # of all columns that are tried

    def gained(N: Array) -> float:
        with_base = X[:, :b].T @ N
        by_base = g.base_inverse @ with_base
        M = N.T @ N - with_base.T @ by_base
        side = N.T @ X[:, -1] - by_base.T @ g.base_with_data
        cross = active_columns @ N - by_products @ by_base
        M -= cross.T @ fit.inverse @ cross
        return float(_gains(M[None], (side - cross.T @ fit.coefficients)[None])[0][0])

    return gained


def _part(g: Gram, fit: Sizes, name: str) -> slice:
    start = 0
    for component in fit.variances:
        m = g.blocks[component].stop - g.blocks[component].start
        if component == name:
            return slice(start, start + m)
        start += m
    raise KeyError(name)


def loss(g: Gram, fit: Sizes, name: str) -> float:
    """Rise of -2 log likelihood without one active component, the other variances held."""
    part = _part(g, fit, name)
    C, u = fit.inverse[part, part], fit.coefficients[part]
    root = _root(C)
    logdet = 2 * float(np.sum(np.log(np.diag(root))))
    quadratic = float(u @ dpotrs(root, u, lower=1)[0])
    return quadratic + logdet - len(u) * float(np.log(fit.variances[name]))


def without(g: Gram, fit: Sizes, name: str) -> Sizes:
    """The fit without one active component, the other variances held."""
    part = _part(g, fit, name)
    remaining = np.r_[0 : part.start, part.stop : len(fit.coefficients)]
    shared = fit.inverse[part][:, remaining]
    solved = dpotrs(_root(fit.inverse[part, part]), shared, lower=1)[0]
    inverse = fit.inverse[np.ix_(remaining, remaining)] - shared.T @ solved
    answer = fit.coefficients[remaining] - solved.T @ fit.coefficients[part]
    variances = {k: v for k, v in fit.variances.items() if k != name}
    return Sizes(variances, answer, inverse, fit.deviance + loss(g, fit, name))


def coefficients(g: Gram, fit: Sizes) -> Coefficients:
    """Coefficients of base and components in the units of their own columns."""
    rows = g.indices(fit.variances)
    base = g.base_inverse @ (g.base_with_data - g.base_products[:, rows] @ fit.coefficients)
    return Coefficients(base, {name: fit.of(g, name) / g.scales[name] for name in fit.variances})
