"""Reference vectors: inputs, and what the compensation makes of them, for the self-test that is written beside it.

Points all over the range, from a quadrature that spreads evenly (Sobol). Outputs come from the model itself, so that a
self-test that passes on the target shows both the arithmetic and the inverse. Where something is remembered from one
sample to the next, the vectors are samples in a row from the first on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from calibrations.compensation.graph import evaluate
from calibrations.compensation.inverse import Compensation
from calibrations.table import Array

TOLERANCE = {"double": 1e-9, "float": 2e-5}  # of the reach
COUNT = 16


@dataclass(frozen=True)
class Vectors:
    """`inputs` shape (n, inputs), `expected` (n, sought): true values that the model made the inputs of."""

    inputs: Array
    expected: Array
    tolerance: float


def vectors(made: Compensation, count: int = COUNT) -> Vectors:
    """`count` vectors, a power of two; the first is a corner of the range, the second its middle."""
    ranges = dict.fromkeys(made.forward.sought, (-made.range.reach, made.range.reach)) | made.beside
    unit = qmc.Sobol(len(ranges), scramble=False).random(count)
    low, high = np.array(list(ranges.values())).T
    at = dict(zip(ranges, (low + unit * (high - low)).T, strict=True))
    outputs = [np.broadcast_to(v, count) for v in _in_a_row(made, at, count)]
    at |= {f"v{axis}": v for axis, v in zip(made.forward.axes, outputs, strict=True)}
    inputs = np.column_stack([at[name] for name in made.program.inputs])
    expected = np.column_stack([at[name] for name in made.forward.sought])
    return Vectors(inputs, expected, TOLERANCE[made.precision] * made.range.reach)


def _in_a_row(made: Compensation, at: Mapping[str, Array], count: int) -> list[Array]:
    """The model's outputs for samples one after the other, shape (count,) each."""
    forward = made.forward
    if not forward.memory:
        return evaluate(forward.outputs, at)
    remembered: dict[str, Array] = dict.fromkeys(forward.memory, np.zeros(()))
    rows = []
    for i in range(count):
        found = evaluate((*forward.outputs, *forward.memory.values()), {k: v[i] for k, v in at.items()} | remembered)
        rows.append(found[: len(forward.outputs)])
        remembered = dict(zip(forward.memory, found[len(forward.outputs) :], strict=True))
    return list(np.array(rows, float).T)
