"""Motions of the positioner's carriage that tests begin with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.world.positioner import PIECES, TERMS


def at_rest(at_um: float) -> NDArray[np.float64]:
    """The motion of a carriage that has always been at `at_um`; shape (PIECES, TERMS)."""
    pieces = np.zeros((PIECES, TERMS))
    pieces[:, 1] = at_um
    return pieces
