"""What the search for free forms reads of a table: angles, time, logged columns, outputs and their white noise."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Measurement:
    """A table of poses with the rows in order of time. Angles in rad, shape (n,); outputs in `unit`, (channels, n)."""

    axes: tuple[str, ...]
    unit: str
    alpha: Array
    beta: Array
    mount: Array
    flip: Array
    outputs: Array
    time_s: Array
    timed: bool  # whether the time was logged
    white: Array | None  # standard deviation of each mean, (channels, n); None where not known
    sides: Mapping[str, Array]  # side from which beta came, (n,): as logged, and as the moves have it
    way: Callable[[float], Array] | None  # specific force where it turns round before each pose, (n, points, 3),
    # of an approach that begins so many degrees before a pose that a move does not reach from the logged side
    temperature_c: Array | None = None
    supply_v: Array | None = None
    std: Array | None = None  # standard deviation of the samples, (channels, n)
    logged: Mapping[str, Array] = field(default_factory=dict)  # any other column

    @property
    def n(self) -> int:
        """Number of poses."""
        return len(self.alpha)

    @property
    def channels(self) -> int:
        """Number of measured axes."""
        return len(self.axes)

    @property
    def since(self) -> Array:
        """Time from 0 to 1 along the record, shape (n,)."""
        span = float(np.ptp(self.time_s))
        return np.asarray((self.time_s - self.time_s.min()) / (span or 1.0))


def specific_force(alpha: Array, turn: Array, flip: Array, up: Array) -> Array:
    """Specific force in the sensor's frame, g, shape (n, 3): a = F Rz(turn) Ry(alpha) up."""
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(turn), np.sin(turn)
    x, y, z = ca * up[0] + sa * up[2], up[1], -sa * up[0] + ca * up[2]
    side = np.where(flip > 0, -1.0, 1.0)
    return np.column_stack([cb * x - sb * y, side * (sb * x + cb * y), side * z])
