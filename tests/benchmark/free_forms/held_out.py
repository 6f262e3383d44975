"""Error on poses that the search has not seen: all rows of one pose are left out together."""

from __future__ import annotations

import numpy as np

from tests.benchmark.free_forms.chain import base_size
from tests.benchmark.free_forms.measurement import Array, Measurement
from tests.benchmark.free_forms.search import SearchResult

FOLDS = 10


def folds(data: Measurement) -> Array:
    """Fold number of each row; rows at the same angles share one."""
    keys = np.round(np.column_stack([data.alpha, data.beta, data.mount, data.flip]), 7)
    _, group = np.unique(keys, axis=0, return_inverse=True)
    count = int(group.max()) + 1
    return np.asarray((np.random.default_rng(0).permutation(count) % min(count, FOLDS))[group.ravel()])


def held_out(result: SearchResult, names: list[str]) -> float:
    """Rms error on unseen poses over the floor with these components (slow noise is not predicted)."""
    data, b = result.data, base_size(result.data)
    noise = [n for n in result.sizes.variances if result.component(n).noise]
    rows = b + result.gram.indices([*noise, *names])
    slow = len(result.gram.indices(noise))
    X = np.hstack([result.columns[:, :b], result.columns[:, rows], result.columns[:, -1:]])
    widths = [result.gram.blocks[n].stop - result.gram.blocks[n].start for n in (*noise, *names)]
    prior = np.concatenate([np.zeros(b), np.repeat([1 / result.sizes.variances[n] for n in (*noise, *names)], widths)])
    total, p = X.T @ X, X.shape[1] - 1
    size = np.sqrt(np.diag(total)[:p] + prior)
    size[size == 0] = 1.0
    fold = np.tile(folds(data), data.channels)
    error = np.empty(len(X))
    for k in range(int(fold.max()) + 1):
        part = X[fold == k]
        G = total - part.T @ part
        A = (G[:p, :p] + np.diag(prior)) / np.outer(size, size) + 1e-11 * np.eye(p)
        answer = np.linalg.solve(A, G[:p, p] / size) / size
        answer[b : b + slow] = 0.0
        error[fold == k] = part[:, p] - part[:, :p] @ answer
    white = result.white / np.sqrt(np.mean(result.white**2))
    return float(np.sqrt(np.mean((error.reshape(white.shape) * white) ** 2)))
