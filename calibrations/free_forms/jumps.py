"""Jumps of a converter's characteristic, found in what the other components leave over the output.

A converter whose bits have wrong weights jumps where a bit changes, for instance in the middle of its range, and no
smooth curve over the output follows. A step is tried between each two neighbouring outputs of all axes together, the
best one is kept, and the next one is sought beside it.

Source  IEEE Std 1241, code transition levels; Pati, Rezaiifar and Krishnaprasad, Asilomar (1993): orthogonal matching.
"""

from __future__ import annotations

import numpy as np

from calibrations.free_forms.bases import Steps
from calibrations.free_forms.chain import State
from calibrations.free_forms.components import GENERAL, Component, free
from calibrations.free_forms.form import Form
from calibrations.free_forms.reml import Gram, Sizes
from calibrations.free_forms.saw import SAW
from calibrations.table import Array

STEPS = "output/steps"
MOST = 64  # steps: those of six bits
POSITIONS, ELEMENTS = 1000, 4_000_000  # at most, that are tried, and numbers in their columns
FEWEST_BESIDE = 12  # outputs below and above a step, and between two of them
CAUTION = 2.0  # times the price of a step in white noise
INDEPENDENT = 1e-6  # of a step's squares: the least that base and components leave of it


def find_jumps(state: State, white: Array, X: Array, g: Gram, sizes: Sizes) -> Component | None:
    """The steps over the output that the residual shows, beside the components that act; None if it shows none.

    X, g   whitened columns [base, components, data] and their products; `sizes` of the components that act

    A step must gain twice the price of its height, log n, and of its position between n outputs, 2 log n, because other
    effects that are not found yet are no white noise.
    """
    data = state.data
    if data.channels < 2 or {"output", SAW} & set(data.table.left_out):
        return None
    width = float(np.median(data.spread)) if data.spread is not None else 0.0
    response = state.response.ravel()
    positions = _positions(response)
    if not len(positions):
        return None
    log_n = float(np.log(response.size))
    columns = Steps(tuple(positions.tolist()), width)(response) / white.reshape(-1, 1)
    tried = np.column_stack([columns, X[:, -1]])
    left = _without_acting(tried, X, g, sizes)
    found = _pursue(tried, left, positions, CAUTION * 3 * log_n)
    if not found:
        return None
    form = Form("output", "steps", "output", (Steps(tuple(sorted(found)), width),), shared=True)
    return free(form, state, "adc-nonlinearity", GENERAL + 2 * log_n * len(found))


def _positions(response: Array) -> Array:
    """Middles between neighbouring outputs, without the outermost; at most `POSITIONS`, fewer of many rows."""
    ordered = np.unique(response)
    middles = (ordered[1:] + ordered[:-1])[FEWEST_BESIDE - 1 : 1 - FEWEST_BESIDE] / 2
    most = min(POSITIONS, max(1, ELEMENTS // response.size))
    return middles[:: max(1, -(-len(middles) // most))]


def _without_acting(columns: Array, X: Array, g: Gram, sizes: Sizes) -> Array:
    """What base and acting components leave of columns, (rows, m)."""
    b = len(g.base_inverse)
    base, acting = X[:, :b], g.indices(sizes.variances)
    left = columns - base @ (g.base_inverse @ (base.T @ columns))
    beside_base = X[:, b + acting] - base @ (g.base_inverse @ g.base_products[:, acting])
    return np.asarray(left - beside_base @ (sizes.inverse @ (beside_base.T @ left)))


def _pursue(tried: Array, left: Array, positions: Array, price: float) -> list[float]:
    """Positions of the steps that gain more than the price each, the best one first, each beside those before it.

    tried, left   columns of a step at each position, and the data; and what base and acting components leave of them
    """
    columns, left = tried[:, :-1], left.copy()
    squares, side = np.einsum("ij,ij->j", columns, left[:, :-1]), columns.T @ left[:, -1]
    least = INDEPENDENT * np.einsum("ij,ij->j", columns, columns)
    allowed = squares > least
    found: list[float] = []
    while len(found) < MOST and allowed.any():
        gains = np.where(allowed, side**2 / np.where(allowed, squares, 1.0), 0.0)
        best = int(np.argmax(gains))
        if gains[best] < price:
            break
        found.append(float(positions[best]))
        direction = left[:, best] / np.sqrt(squares[best])
        shares = columns.T @ direction
        side = side - shares * (side[best] / np.sqrt(squares[best]))
        squares = squares - shares**2
        left[:, :-1] -= np.outer(direction, shares)
        allowed &= squares > least
        allowed[max(0, best - FEWEST_BESIDE + 1) : best + FEWEST_BESIDE] = False
    return found
