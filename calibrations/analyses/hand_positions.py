"""Progress of a calibration by hand: the orientations so far, the next one, and whether the positions are enough.

The positions suffice when the standard uncertainty of every parameter, as an error at full scale (1 g), is at most the
wanted one. It comes from a fit to the positions so far. A fit that misses more than the noise is less certain, so a
sensor that slipped or was shaken costs more positions.

Source  Tedaldi, Pretto and Menegatti, ICRA 2014: calibration of a triad from positions of unknown orientation.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from calibrations.analyses.stillness import BLOCK_S, NoiseAtRest
from calibrations.design.orientations import (
    CENTRE_POSITIONS,
    FIRST_SIDES,
    NextOrientation,
    directions_up,
    is_informative,
    is_other_side,
    next_orientation,
)
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit
from calibrations.model import Estimate
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from calibrations.text import parameter_words

FEWEST = 12  # nine parameters, and three positions that check them
OUTPUTS = ("ax", "ay", "az")
MODEL, ANGLES = "linear", "axis-nonorthogonality"


@dataclass(frozen=True)
class HandPosition:
    """The mean (3,) of a position, the standard deviation (3,) and number of its samples, and the stated direction."""

    mean: Array
    std: Array
    n: int
    stated_up: Array
    t_s: float = 0.0


class NextPosition(Protocol):
    """The most informative position, in words, and how to turn the sensor there; empty if that is not known."""

    @property
    def words(self) -> str: ...
    @property
    def turn(self) -> str: ...


@dataclass(frozen=True)
class HandProgress(ABC):
    """The positions so far, of any sensor. `noise` is that of the sensor at rest."""

    positions: tuple[HandPosition, ...]
    noise: NoiseAtRest

    @property
    @abstractmethod
    def directions(self) -> Array:
        """Directions of gravity upward, or of the field, at the positions, unit vectors (n, 3)."""

    @property
    @abstractmethod
    def wanted(self) -> tuple[float, ...]:
        """The direction that the next position will add."""

    @property
    @abstractmethod
    def next(self) -> NextPosition:
        """The most informative position."""

    @property
    def count(self) -> int:
        """Number of positions."""
        return len(self.positions)

    @property
    def words(self) -> str:
        """The most informative position, in words."""
        return self.next.words

    @property
    def turn(self) -> str:
        """How to turn the sensor there from its last position; empty if that is not known."""
        return self.next.turn

    @property
    def outputs(self) -> Array:
        """Means of the positions, shape (n, 3)."""
        return np.array([p.mean for p in self.positions]).reshape(-1, 3)

    def is_new(self, mean: Array) -> bool:
        """Whether a rest with this mean (3,) is worth taking."""
        if self.count < CENTRE_POSITIONS - 1:
            return is_other_side(mean, self.outputs, float(self.noise.std.max()))
        wanted = np.array(self.wanted)
        direction = directions_up(np.vstack([self.outputs, mean]), np.vstack([self.directions, wanted]))[-1]
        return is_informative(direction, wanted, self.directions)


@dataclass(frozen=True)
class HandCourse(HandProgress):
    """The positions of an accelerometer so far. Orientations `skipped` (k, 3) are not wanted."""

    skipped: Array = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def up(self) -> tuple[float, ...]:
        """The upward direction of the most informative orientation."""
        return tuple(map(float, self.next.up))

    @property
    def north(self) -> tuple[float, ...]:
        """No direction to the north: a turn about the vertical has no effect."""
        return ()

    @property
    def wanted(self) -> tuple[float, ...]:
        """The direction that the position will add."""
        return self.up

    @cached_property
    def directions(self) -> Array:
        """Directions upward of the positions, unit vectors (n, 3)."""
        return directions_up(self.outputs, np.array([p.stated_up for p in self.positions]).reshape(-1, 3))

    @cached_property
    def next(self) -> NextOrientation:
        """The most informative orientation."""
        last = self.directions[-1] if len(self.directions) else None
        return next_orientation(np.vstack([self.directions, self.skipped]), last, FIRST_SIDES + len(self.skipped))

    @property
    def doubt(self) -> str:
        """Gravity is the same in all positions."""
        return ""

    @cached_property
    def uncertainty(self) -> tuple[float, str]:
        """The largest standard uncertainty of a parameter as an error at 1 g, in g, and the parameter's words.

        Infinite with fewer than FEWEST positions.
        """
        if len(self.positions) < FEWEST:
            return np.inf, ""
        return largest_uncertainty_g(fit_positions(hand_table(self.positions, self.noise)))


def hand_table(positions: Sequence[HandPosition], noise: NoiseAtRest, outputs: Sequence[str] = OUTPUTS) -> Table:
    """The table of positions. The noise of a mean is that of the blocks of a window, which a filter does not hide."""
    means, count = np.array([p.mean for p in positions]), np.array([float(p.n) for p in positions])
    blocks = np.maximum(1.0, count / max(1, round(noise.rate_hz * BLOCK_S)))
    columns = {name: means[:, k] for k, name in enumerate(outputs)}
    columns |= {f"{name}_std": np.full(len(means), np.sqrt(noise.sway[k])) for k, name in enumerate(outputs)}
    return Table.from_columns("positions", {**columns, "n": blocks}, {}, "positions by hand")


def fit_positions(table: Table) -> Fit:
    """Bias, scale factor and angles between the axes from a table of positions. Raises as `fit`."""
    return fit(read_model(MODEL).with_effect(catalogue()[ANGLES]), table)


def largest_uncertainty_g(fit: Fit) -> tuple[float, str]:
    """The largest standard uncertainty of a parameter as an error at 1 g, in g, and its words."""
    scale = {e.axis: abs(e.value) for e in fit.model.estimates("scale-factor")}
    return largest_error(fit, lambda key, e, std: np.radians(std) if key.startswith(ANGLES) else std / scale[e.axis])


def largest_error(fit: Fit, error_of: Callable[[str, Estimate, float], float]) -> tuple[float, str]:
    """The largest error of a parameter, and its words; infinite with the first that is not identified.

    error_of  from key, estimate and standard uncertainty of a parameter: its error at full scale
    """
    errors: dict[str, float] = {}
    for key, estimate in fit.params.items():
        if estimate.std is None or not estimate.identified:
            return np.inf, parameter_words(key)
        errors[key] = float(error_of(key, estimate, estimate.std))
    worst = max(errors, key=lambda key: errors[key])
    return errors[worst], parameter_words(worst)
