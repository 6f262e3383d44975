"""What the data cannot distinguish, judged by a cause's own trace, without noise, in the noise that there is.

An effect can stand for a cause where, under the true noise, it leaves hardly more of the cause's trace than the effect
that the cause is called by. Effects that come near are given their best shape first, by a fit to the trace.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit, refit
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.benchmark.discovery.cases import Truth
from tests.benchmark.discovery.library import Library

NOT_TOLD_APART = 6.0  # of twice the log-likelihood: odds of 20 to 1
NEAR = 0.3  # of the trace's squares: an effect that leaves more cannot stand for it in another shape either


def equals(table: Table, truth: Truth, lib: Library) -> list[frozenset[str]]:
    """For each cause, the names that this data cannot tell from its own, and those themselves."""
    return [_equals(table, truth, lib, k) for k in range(len(truth.causes))]


def _equals(table: Table, truth: Truth, lib: Library, k: int) -> frozenset[str]:
    assert truth.clean_v is not None
    names = truth.causes[k]
    others = [part for j, part in enumerate(truth.parts) if j != k]
    beside = [part[table.order].T.reshape(-1, 1) for part in others]
    base = np.linalg.qr(_white(table, truth, np.hstack([lib.base * lib.floor[:, None], *beside])))[0]

    def left(columns: Array, of: Array) -> float:
        """Sum of squares of what is left of a white trace."""
        free = columns - base @ (base.T @ columns)
        Q = np.linalg.qr(free)[0]
        rest = of - base @ (base.T @ of)
        return float(np.sum((rest - Q @ (Q.T @ rest)) ** 2))

    trace = _white(table, truth, truth.parts[k][table.order].T.reshape(-1, 1))
    whole = left(trace[:, :0], trace)
    lefts = {
        name: min(left(_white(table, truth, group * lib.floor[:, None]), trace) for group in groups)
        for name, groups in lib.groups.items()
    }
    alone = _without_noise(table, truth.clean_v - sum(others, np.zeros_like(truth.clean_v)))
    for name in lefts:
        if whole > NOT_TOLD_APART and lefts[name] < NEAR * whole:
            rest = _white(table, truth, _fitted(alone, name).residual.reshape(-1, 1))
            lefts[name] = min(lefts[name], left(rest[:, :0], rest))
    own = min((lefts[name] for name in names if name in lefts), default=whole)
    return names | {name for name, rest in lefts.items() if rest < min(own, whole) + NOT_TOLD_APART}


def _white(table: Table, truth: Truth, columns: Array) -> Array:
    """(2 n, m) under the true noise; rows in order of time become those of the table."""
    back = np.argsort(table.order)
    return np.vstack([solve_triangular(truth.root, c[back], lower=True) for c in columns.reshape(2, table.n, -1)])


def _without_noise(table: Table, outputs: Array) -> Fit:
    columns = {**table.columns, "vx_v": outputs[:, 0], "vy_v": outputs[:, 1]}
    return fit(read_model("linear"), Table.from_columns("poses", columns, table.constants, table.source))


def _fitted(alone: Fit, name: str) -> Fit:
    return refit(alone, alone.model.with_effect(catalogue()[name]))
