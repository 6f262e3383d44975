"""Correlation coefficients of parameters that were fitted together, as a model file keeps them.

Standard uncertainties alone make a quantity that follows from several parameters too certain or too uncertain: this
needs the correlations too (GUM 5.2.2).
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.errors import ModelError, nearest
from calibrations.table import Array

DIGITS = 9  # of a coefficient: a sum and a difference of nearly equal parameters stay right
MOST = 60  # parameters; a free form of hundreds of coefficients would fill a file with numbers
ROUNDING = 1e-6  # of the least eigenvalue: digits of a file


@dataclass(frozen=True)
class Correlations:
    """The lower triangle of a correlation matrix: `lower[i]` has the i coefficients of `names[i]` with those above it.

    `names` are keys of `Model.params`, such as "bias.x". A parameter without an entry is independent of the others.
    """

    names: tuple[str, ...]
    lower: tuple[tuple[float, ...], ...]

    @classmethod
    def of(cls, names: Sequence[str], matrix: Array) -> Correlations:
        """Correlations from a symmetric matrix, shape (p, p)."""
        rows = [tuple(round(float(r), DIGITS) + 0.0 for r in row[:i]) for i, row in enumerate(matrix)]
        return cls(tuple(names), tuple(rows))

    @property
    def matrix(self) -> Array:
        """The whole matrix, shape (p, p), with the diagonal 1."""
        full = np.eye(len(self.names))
        for i, row in enumerate(self.lower):
            full[i, :i] = full[:i, i] = row
        return full

    def only(self, keys: Container[str]) -> Correlations | None:
        """The correlations of `keys`; None for fewer than two."""
        indices = [i for i, name in enumerate(self.names) if name in keys]
        if len(indices) < 2:
            return None
        names = [self.names[i] for i in indices]
        return Correlations.of(names, self.matrix[np.ix_(indices, indices)])

    def split(self, parts: Mapping[str, Sequence[str]]) -> Correlations:
        """The same where some parameters are given by several of the same value and error: their keys by its key."""
        pairs = [(key, i) for i, name in enumerate(self.names) for key in parts.get(name, [name])]
        indices = [i for _, i in pairs]
        return Correlations.of([key for key, _ in pairs], self.matrix[np.ix_(indices, indices)])

    def submatrix(self, keys: Sequence[str]) -> Array:
        """The matrix for `keys`, in their order; 0 where nothing is known."""
        place = {name: i for i, name in enumerate(self.names)}
        present = [k for k, key in enumerate(keys) if key in place]
        indices = [place[keys[k]] for k in present]
        matrix = np.eye(len(keys))
        matrix[np.ix_(present, present)] = self.matrix[np.ix_(indices, indices)]
        return matrix


def check_correlations(correlations: Correlations, keys: Iterable[str], source: str) -> Correlations:
    """`correlations`, if it is a correlation matrix of parameters among `keys`.

    Raises ModelError with `source` and the fault.
    """
    allowed_keys = list(keys)
    for i, (name, row) in enumerate(zip(correlations.names, correlations.lower, strict=False)):
        if name not in allowed_keys:
            raise ModelError(f'{source}: the model has no parameter "{name}" with a value{nearest(name, allowed_keys)}')
        if name in correlations.names[:i]:
            raise ModelError(f'{source}: "{name}" is given twice')
        if len(row) != i:
            raise ModelError(
                f"{source}: {name} has {len(row)} coefficients, and needs {i}: one with each parameter above it"
            )
        if any(not abs(r) <= 1 for r in row):
            raise ModelError(f"{source}: {name}: a correlation coefficient is from -1 to 1, not {max(row, key=abs):g}")
    if len(correlations.lower) != len(correlations.names):
        raise ModelError(
            f"{source}: {len(correlations.names)} parameters need {len(correlations.names)} rows, "
            f"not {len(correlations.lower)}"
        )
    if correlations.names and np.linalg.eigvalsh(correlations.matrix)[0] < -ROUNDING:
        raise ModelError(
            f"{source}: these coefficients contradict each other: no parameters can have them all; "
            "fit the model again, or remove the key correlations"
        )
    return correlations
