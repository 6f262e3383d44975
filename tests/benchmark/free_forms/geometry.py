"""Geometry: which of misalignment, non-orthogonality, stage zeros and base tilt the linear parts need.

The linear parts of the fit are a vector q of small angles with a covariance. Each cause is a linear map into it. A
place that acts over another axis may have a linear part of its own, as large as its curve: so much is added to the
covariance before anything is asked, so that no mechanism's linear part names a second cause.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tests.benchmark.free_forms.chain import mounted
from tests.benchmark.free_forms.measurement import Array
from tests.benchmark.free_forms.search import SearchResult

CAUSE_PRICE, PARAMETER_PRICE = 12.0, 2.0  # of chi-square
CLOSE = 8.0  # of chi-square: explanations that this data does not tell apart
LINEAR_PART = 1.0  # of a curve's size: the standard deviation of a mechanism's own linear part


@dataclass(frozen=True)
class Geometry:
    """Causes, what else would do, size of each in floors, and the p-value's chi-square."""

    causes: tuple[str, ...]
    alternatives: dict[str, tuple[str, ...]]
    chi_square: float
    size: float


def geometry(result: SearchResult, sizes_v: dict[str, float]) -> Geometry:
    """The geometry that two measured axes show. `sizes_v`: rms of each acting place, in the output's unit."""
    data, c = result.data, result.data.channels
    if c != 2:
        return Geometry((), {}, 0.0, 0.0)
    base = result.values.base
    rows = base[c : 4 * c].reshape(c, 3)
    scale = np.array([rows[0, 0], rows[1, 1]])
    q = np.array(
        [rows[0, 1] / scale[0], rows[0, 2] / scale[0], rows[1, 0] / scale[1], rows[1, 2] / scale[1], *base[4 * c :]]
    )
    J = np.zeros((len(q), len(base)))
    for i, (k, j) in enumerate(((0, 1), (0, 2), (1, 0), (1, 2))):
        J[i, c + 3 * k + j] = 1 / scale[k]
    J[4:, 4 * c :] = np.eye(len(base) - 4 * c)
    active = result.gram.indices(result.sizes.variances)
    cross = result.gram.base_inverse @ result.gram.base_products[:, active]
    C = J @ (result.gram.base_inverse + cross @ result.sizes.inverse @ cross.T) @ J.T
    floor = float(np.sqrt(np.mean(result.white**2)))
    gain = float(np.mean(np.abs(scale)))
    for places, which in (
        (("cross-response", "scale-over-cross", "force"), (0, 2)),
        (("z-response", "scale-over-z", "force", "stage-angle-alpha"), (1, 3)),
    ):
        size = max((sizes_v.get(place, 0.0) for place in places), default=0.0)
        for i in which:
            C[i, i] += (LINEAR_PART * size / gain / 0.5) ** 2
    C += np.diag(np.full(len(q), (0.15 * floor / gain) ** 2))  # less than this is no matter
    maps = _maps(mounted(data))
    white = np.linalg.inv(np.linalg.cholesky(C))
    scored = []
    for count in range(len(maps) + 1):
        for chosen in combinations(maps, count):
            A = np.hstack([maps[name] for name in chosen]) if chosen else np.zeros((len(q), 0))
            left = white @ q
            rank = 0
            if chosen:
                answer, _, rank, _ = np.linalg.lstsq(white @ A, left, rcond=1e-9)
                left = left - white @ A @ answer
            scored.append((float(left @ left) + CAUSE_PRICE * count + PARAMETER_PRICE * rank, chosen))
    scored.sort(key=lambda s: s[0])
    best, chosen = scored[0]
    others = {
        name for score, other in scored[1:] if score < best + CLOSE and len(other) <= len(chosen) for name in other
    }
    alternatives = {name: tuple(sorted(others - set(chosen))) for name in chosen if others - set(chosen)}
    total = float(np.sum((white @ q) ** 2))
    angle = float(np.sqrt(np.sum(q**2) / 4))
    return Geometry(tuple(chosen), alternatives, total, angle * gain * 0.6 / floor)


def _maps(turned: bool) -> dict[str, Array]:
    """Derivatives of q: x over y, x over z, y over x, y over z, alpha offset, tilt about x, beta offset if mounted."""
    rows = 7 if turned else 6

    def map_of(*columns: dict[int, float]) -> Array:
        out = np.zeros((rows, len(columns)))
        for k, column in enumerate(columns):
            for i, value in column.items():
                out[i, k] = value
        return out

    beta = {6: 1.0} if turned else {0: -1.0, 2: 1.0}
    return {
        "axis-nonorthogonality": map_of({2: 1.0}),
        "axis-misalignment": map_of({3: 1.0}, {1: 1.0}, {0: 1.0, 2: -1.0}),
        "stage-zero-offset": map_of({4: 1.0}, beta),
        "base-tilt": map_of({5: 1.0}, {4: 1.0}),
    }
