"""What the data cannot distinguish, judged without the analysis: by the cause's own trace in the noise that there is.

An effect can stand for a cause where, under the true noise, it leaves hardly more of the cause's noise-free trace than
the effect that the cause is called by.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from calibrations.table import Array, Table
from tests.benchmark.discovery.cases import Truth
from tests.benchmark.discovery.library import Library

NOT_TOLD_APART = 6.0  # of twice the log-likelihood: odds of 20 to 1


def equals(table: Table, truth: Truth, lib: Library) -> list[frozenset[str]]:
    """For each cause, the names that this data cannot tell from its own, and those themselves."""
    return [_equals(table, truth, lib, k) for k in range(len(truth.causes))]


def _equals(table: Table, truth: Truth, lib: Library, k: int) -> frozenset[str]:
    order, names = table.order, truth.causes[k]

    def white(columns: Array) -> Array:
        """(2 n, m) under the true noise."""
        x, y = columns.reshape(2, table.n, -1)
        return np.vstack([solve_triangular(truth.root, c[np.argsort(order)], lower=True) for c in (x, y)])

    def volts(part: Array) -> Array:
        return part[order].T.reshape(-1, 1)

    others = [volts(part) for j, part in enumerate(truth.parts) if j != k]
    base = np.linalg.qr(white(np.hstack([lib.base * lib.floor[:, None], *others])))[0]

    def free(columns: Array) -> Array:
        return columns - base @ (base.T @ columns)

    trace = free(white(volts(truth.parts[k])))[:, 0]

    def left(name: str) -> float:
        return min(_left(free(white(group * lib.floor[:, None])), trace) for group in lib.groups[name])

    own = min((left(name) for name in names if name in lib.groups), default=np.inf)
    own = min(own, float(trace @ trace))
    return names | {name for name in lib.groups if left(name) < own + NOT_TOLD_APART}


def _left(columns: Array, trace: Array) -> float:
    Q = np.linalg.qr(columns)[0]
    rest = trace - Q @ (Q.T @ trace)
    return float(rest @ rest)
