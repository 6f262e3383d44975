"""What could be reached: a search among the exact traces of all mechanisms on this very record, under the true noise.

The oracle knows every form, shape and noise, and is left to find which, and how large. It is asked on this folder's own
rigs, where all this is known. Where it fails too, no analysis of this data can do better.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import solve_triangular
from scipy.stats import chi2

from calibrations.table import Array, Table
from tests.benchmark.discovery.cases import Truth
from tests.benchmark.discovery.mechanisms import MECHANISMS
from tests.benchmark.discovery.rig import NotShown, Run, gravity, sized, volts

LEVEL = 0.003  # of naming anything where there is nothing, over the whole search


def answer(table: Table, truth: Truth) -> dict[str, Any] | None:
    """The oracle's answer; None where the generator is another."""
    run = truth.run
    if run is None:
        return None
    traces = _traces(run, truth)
    base = _base(run, truth)
    y = _white(truth, table.outputs[:, :, None])[:, 0]
    chosen: list[str] = []
    ranking: list[str] = []
    while len(chosen) < len(traces):
        Q = np.linalg.qr(np.hstack([base, *(traces[name] for name in chosen)]))[0]
        rest = y - Q @ (Q.T @ y)
        gain = {name: _gain(traces[name] - Q @ (Q.T @ traces[name]), rest) for name in traces if name not in chosen}
        best = max(gain, key=lambda name: gain[name])
        ranking = ranking or sorted(gain, key=lambda name: gain[name], reverse=True)
        if chi2.sf(gain[best], 2) * len(gain) > LEVEL:
            break
        chosen.append(best)
    misfit = chi2.sf(float(rest @ rest), len(rest) - Q.shape[1]) < LEVEL
    return {
        "ranking": _names(ranking)[:5],
        "causes": _names(chosen),
        "verdict": "unexplained" if misfit else "effect-missing" if chosen else "adequate",
        "error": _error(truth, y, Q),
    }


def _names(mechanisms: list[str]) -> list[str]:
    """What the catalogue calls them."""
    return list(dict.fromkeys(min(MECHANISMS[name].names) for name in mechanisms))


def _traces(run: Run, truth: Truth) -> dict[str, Array]:
    """White traces of each mechanism at the size that it has, or would have: one column, or one for each axis."""
    clean, given, there = volts(run, ()), run.visits.given, dict(truth.built)
    found = {}
    for name, mechanism in MECHANISMS.items():
        try:
            built = there.get(name) or sized(run, name, mechanism, 10 * run.floor_v)
        except NotShown:
            continue
        change = (volts(run, (built,)) - clean)[given][:, :, None]
        found[name] = _white(truth, change if mechanism.place in ("stage", "body") else change * np.eye(2))
    return found


def _base(run: Run, truth: Truth) -> Array:
    """Bias and scale factor of each axis, white."""
    a = gravity(run.stand)[run.visits.given]
    columns = np.zeros((len(a), 2, 4))
    for c in range(2):
        columns[:, c, 2 * c], columns[:, c, 2 * c + 1] = 1.0, a[:, c]
    return _white(truth, columns)


def _white(truth: Truth, columns: Array) -> Array:
    """(n, 2, k) -> (2 n, k) under the true noise."""
    return np.vstack([solve_triangular(truth.root, columns[:, c], lower=True) for c in range(2)])


def _gain(free: Array, rest: Array) -> float:
    Q = np.linalg.qr(free)[0]
    return float(np.sum((Q.T @ rest) ** 2))


def _error(truth: Truth, y: Array, Q: Array) -> float:
    assert truth.clean_v is not None
    n = len(truth.clean_v)
    missed = Q @ (Q.T @ y) - _white(truth, truth.clean_v[:, :, None])[:, 0]
    volts_missed = np.concatenate([truth.root @ missed[:n], truth.root @ missed[n:]])
    return float(np.sqrt(1 + np.mean(volts_missed**2) / truth.floor_v**2))
