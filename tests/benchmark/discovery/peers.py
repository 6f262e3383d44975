"""Four ways in use to find the terms of a model, given the same columns.

Stepwise BIC, F-tests with Bonferroni, the LASSO with stability selection, and PySINDy's thresholded least squares.

Each names effects, ranks them, and says "unexplained" where it names none though the error is beyond noise.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.stats import chi2, f
from sklearn.exceptions import ConvergenceWarning
from sklearn.linear_model import lars_path

from calibrations.table import Array, Table
from tests.benchmark.discovery.cases import Truth
from tests.benchmark.discovery.library import Library

LEVEL = 0.01  # of the F-tests, of the check of what is left
HALVES, STABLE = 50, 0.9  # half samples, and the share of them that must choose an effect
MOST_FALSE = 0.1  # bound on effects expected to be chosen wrongly: Meinshausen and Buhlmann, theorem 1
MOST = 14  # effects
THRESHOLDS = np.geomspace(0.5, 60, 12)  # of coefficients whose columns have length 1: in units of the noise
HELD_OUT = 4  # one row in so many chooses the threshold
Answer = dict[str, Any]
Chosen = list[tuple[str, Array]]


def answers(table: Table, truth: Truth, lib: Library) -> dict[str, Answer]:
    """What each peer says."""
    return {name: peer(table, truth, lib) for name, peer in PEERS.items()}


def stepwise_bic(table: Table, truth: Truth, lib: Library) -> Answer:
    """Forward by BIC, then backward."""
    rows = len(lib.y)

    def worth(chosen: Chosen) -> float:
        columns = sum(group.shape[1] for _, group in chosen)
        return rows * np.log(np.sum(_left(lib, chosen) ** 2) / rows) + columns * np.log(rows)

    chosen, ranking = _forward(lib, lambda found, one: worth(found) - worth([*found, one]))
    while len(chosen) > 1:
        fewer = [[each for each in chosen if each is not one] for one in chosen]
        best = min(fewer, key=worth)
        if worth(best) >= worth(chosen):
            break
        chosen = best
    return _answer(table, truth, lib, ranking, chosen)


def bonferroni(table: Table, truth: Truth, lib: Library) -> Answer:
    """Forward by F-tests, each at 1 % over all candidates."""
    tests = sum(map(len, lib.groups.values()))

    def worth(chosen: Chosen, one: tuple[str, Array]) -> float:
        before, after = (float(np.sum(_left(lib, found) ** 2)) for found in (chosen, [*chosen, one]))
        k = one[1].shape[1]
        free = len(lib.y) - lib.base.shape[1] - sum(group.shape[1] for _, group in chosen) - k
        ratio = (before - after) / k / (after / free)
        return float(np.log(LEVEL / tests) - f.logsf(ratio, k, free))

    chosen, ranking = _forward(lib, worth)
    return _answer(table, truth, lib, ranking, chosen)


def lasso_stability(table: Table, truth: Truth, lib: Library) -> Answer:
    """Effects among the first few columns of the LASSO's path on nearly all half samples."""
    every = [(name, group) for name, groups in lib.groups.items() for group in groups]
    names = [name for name, group in every for _ in range(group.shape[1])]
    X, random = np.hstack([group for _, group in every]), np.random.default_rng(50)
    first = max(1, int(np.sqrt(MOST_FALSE * (2 * STABLE - 1) * X.shape[1])))
    often = dict.fromkeys(lib.groups, 0.0)
    for _ in range(HALVES):
        half = random.permutation(len(X))[: len(X) // 2]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            order = lars_path(X[half], lib.y[half], max_iter=first, method="lasso")[1]
        for name in {names[k] for k in order}:
            often[name] += 1 / HALVES
    # of effects chosen equally often, the one that explains more by itself
    alone = {
        name: max(float(np.sum((group.T @ lib.y) ** 2)) for group in groups) for name, groups in lib.groups.items()
    }
    ranking = sorted(often, key=lambda name: (often[name], alone[name]), reverse=True)
    chosen = [(name, np.hstack(lib.groups[name])) for name in ranking if often[name] >= STABLE]
    return _answer(table, truth, lib, ranking, chosen)


def pysindy_stlsq(table: Table, truth: Truth, lib: Library) -> Answer:
    """Sequentially thresholded least squares on all columns; the threshold with the least error on rows held out."""
    from pysindy.optimizers import STLSQ

    every = [(name, group) for name, groups in lib.groups.items() for group in groups]
    names = [name for name, group in every for _ in range(group.shape[1])]
    X = np.hstack([group for _, group in every])
    held = np.arange(len(X)) % HELD_OUT == 0

    def solved(threshold: float, rows: Array) -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that all coefficients have gone is an answer
            return np.asarray(STLSQ(threshold=threshold, alpha=1e-3).fit(X[rows], lib.y[rows]).coef_[0])

    errors = [float(np.sum((lib.y[held] - X[held] @ solved(t, ~held)) ** 2)) for t in THRESHOLDS]
    coefficients = solved(THRESHOLDS[int(np.argmin(errors))], np.ones(len(X), dtype=bool))
    size = dict.fromkeys(lib.groups, 0.0)
    for name, value in zip(names, coefficients, strict=True):
        size[name] = max(size[name], abs(float(value)))
    alone = {
        name: max(float(np.sum((group.T @ lib.y) ** 2)) for group in groups) for name, groups in lib.groups.items()
    }
    ranking = sorted(size, key=lambda name: (size[name], alone[name]), reverse=True)
    chosen = [(name, np.hstack(lib.groups[name])) for name in ranking if size[name] > 0]
    return _answer(table, truth, lib, ranking, chosen)


PEERS: dict[str, Callable[[Table, Truth, Library], Answer]] = {
    "stepwise BIC": stepwise_bic,
    "Bonferroni F": bonferroni,
    "LASSO stability": lasso_stability,
    "PySINDy": pysindy_stlsq,
}


def _forward(lib: Library, worth: Callable[[Chosen, tuple[str, Array]], float]) -> tuple[Chosen, list[str]]:
    """The best candidate again and again, while its worth is above 0; and the ranking of the first round."""
    chosen: Chosen = []
    ranking: list[str] = []
    while len(chosen) < MOST:
        names = {name for name, _ in chosen}
        every = [(name, group) for name, groups in lib.groups.items() if name not in names for group in groups]
        scored = sorted(((worth(chosen, one), k) for k, one in enumerate(every)), reverse=True)
        ranking = ranking or list(dict.fromkeys(every[k][0] for _, k in scored))
        if not scored or scored[0][0] <= 0:
            break
        chosen.append(every[scored[0][1]])
    return chosen, ranking


def _left(lib: Library, chosen: Chosen) -> Array:
    """What is left of the white residual."""
    if not chosen:
        return lib.y
    columns = np.hstack([group for _, group in chosen])
    return np.asarray(lib.y - columns @ np.linalg.lstsq(columns, lib.y, rcond=1e-9)[0])


def _answer(table: Table, truth: Truth, lib: Library, ranking: list[str], chosen: Chosen) -> Answer:
    rest = _left(lib, chosen)
    misfit = chi2.sf(float(rest @ rest), len(rest) - lib.base.shape[1]) < LEVEL
    return {
        "ranking": ranking[:5],
        "causes": [name for name, _ in chosen],
        "verdict": "unexplained" if misfit and not chosen else "effect-missing" if chosen else "adequate",
        "error": _error(table, truth, lib, rest),
    }


def _error(table: Table, truth: Truth, lib: Library, rest: Array) -> float | None:
    """As for ours, at the table's own poses: what the model misses of the output without noise."""
    if truth.clean_v is None:
        return None
    predicted = table.outputs[table.order].T.ravel() - rest * lib.floor
    missed = predicted - truth.clean_v[table.order].T.ravel()
    return float(np.sqrt(1 + np.mean(missed**2) / truth.floor_v**2))
