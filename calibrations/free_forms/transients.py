"""Transients over the time: which end within the first poses, and which are not over at the end of the record."""

from __future__ import annotations

import numpy as np

from calibrations.table import Array

FIRST_POSES, OVER_SOON = 0.06, 0.8  # of a record, and of the variance of what decays within them
TIME_CONSTANTS = tuple(np.geomspace(0.02, 3.0, 40).tolist())  # of the record, that a decay may have
UNSETTLED = 0.36  # of the record: of a longer time constant, more than a twentieth of the decay is in the last fifth


def is_over_soon(curve: Array, elapsed_share: Array) -> bool:
    """Whether a curve decays within the first poses, as the memory of what came before them does.

    curve           by axis, (channels, n)
    elapsed_share   time of each row, from 0 to 1 along the record, (n,)
    """
    largest = max(curve, key=np.ptp)
    squares = (largest - np.median(largest)) ** 2
    return bool(squares[elapsed_share < FIRST_POSES].sum() > OVER_SOON * squares.sum())


def is_unsettled(curve: Array, elapsed_share: Array) -> bool:
    """Whether the decay that a curve resembles most is not over at the end of the record.

    A drift that becomes slower, such as ageing with the logarithm of the time, looks like that too.
    """
    largest = max(curve, key=np.ptp)
    squares = []
    for part in TIME_CONSTANTS:
        X = np.column_stack([np.ones_like(elapsed_share), np.exp(-elapsed_share / part)])
        remaining = largest - X @ np.linalg.lstsq(X, largest, rcond=None)[0]
        squares.append(float(remaining @ remaining))
    return bool(TIME_CONSTANTS[int(np.argmin(squares))] > UNSETTLED)
