"""Calibration of a magnetometer by hand as it goes on: the directions of the field that it has had, the next attitude,
and when the positions suffice.

They suffice when the standard uncertainty of every parameter, as a share of the field, is at most the wanted one. What
differs from `calibrations.analyses.hand_positions` is that the field has another direction in the room than upward, and
that its strength is a parameter. Iron beside the sensor shows as a magnitude that differs from position to position.

Source  Renaudin, Afzal and Lachapelle, Journal of Sensors (2010): the ellipsoid of all directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibrations.analyses.hand_positions import FEWEST, HandProgress, hand_table, largest_error
from calibrations.criteria import LEAST_FIELD_CHANGE, MOST_FIELD_EXCESS
from calibrations.design.attitudes import Attitude, NextAttitude, assumed_field, estimate_field, next_attitude
from calibrations.design.orientations import CENTRE_POSITIONS, directions_up
from calibrations.fitting.fit import Fit, fit
from calibrations.means.noise import rms
from calibrations.model.file import read_model
from calibrations.table import Array, Table

MODEL = "magnetometer"
OUTPUTS = ("mx", "my", "mz")


@dataclass(frozen=True)
class FieldCourse(HandProgress):
    """The positions of a magnetometer so far, each with the attitude that was wanted.

    Attitudes `skipped` are not wanted.
    """

    attitudes: tuple[Attitude, ...] = ()
    skipped: tuple[Attitude, ...] = ()

    @property
    def up(self) -> tuple[float, ...]:
        """The upward direction of the most informative attitude."""
        return tuple(map(float, self.next.attitude.up))

    @property
    def north(self) -> tuple[float, ...]:
        """The position's direction to the north."""
        return tuple(map(float, self.next.attitude.north))

    @property
    def wanted(self) -> tuple[float, ...]:
        """The direction of the field that it will give."""
        return tuple(map(float, self.next.direction))

    @cached_property
    def directions(self) -> Array:
        """Directions of the field in the sensor, unit vectors (n, 3): the expected ones until they can be measured."""
        expected = np.array([attitude.matrix @ assumed_field() for attitude in self.attitudes]).reshape(-1, 3)
        return directions_up(self.outputs, expected)

    @cached_property
    def field(self) -> Array:
        """The direction of the field in the room, (3,)."""
        return assumed_field() if self.count < CENTRE_POSITIONS else estimate_field(self.directions, self.attitudes)

    @cached_property
    def next(self) -> NextAttitude:
        """The most informative attitude."""
        skipped = np.array([attitude.matrix @ self.field for attitude in self.skipped]).reshape(-1, 3)
        last = self.attitudes[-1] if self.attitudes else None
        return next_attitude(np.vstack([self.directions, skipped]), self.field, last)

    @cached_property
    def fitted(self) -> Fit | None:
        """The ellipsoid of the positions; None with fewer than FEWEST."""
        return None if self.count < FEWEST else fit_fields(hand_table(self.positions, self.noise, OUTPUTS))

    @property
    def uncertainty(self) -> tuple[float, str]:
        """The largest standard uncertainty of a parameter as a share of the field, and the parameter's words.

        Infinite with fewer than FEWEST positions.
        """
        return (np.inf, "") if self.fitted is None else largest_uncertainty(self.fitted)

    @property
    def doubt(self) -> str:
        """A contradiction to one field in all positions, in words; "" without one."""
        return "" if self.fitted is None else field_doubt(self.fitted)


def fit_fields(table: Table) -> Fit:
    """Field strength, hard iron and soft iron from a table of positions. Raises as `fit`."""
    return fit(read_model(MODEL), table)


def largest_uncertainty(fitted: Fit) -> tuple[float, str]:
    """The largest standard uncertainty of a parameter as a share of the field, and its words."""
    (strength,) = fitted.model.estimates("field-strength")
    return largest_error(fitted, lambda key, _, std: std if key.startswith("soft-iron") else std / strength.value)


def field_doubt(fitted: Fit) -> str:
    """Whether the field differs from position to position, in words; empty if it does not.

    A residual counts if it is larger than the noise of the means and than what sensors of the field leave of an
    ellipsoid.
    """
    floor, residual = float(fitted.noise.floor[0]), fitted.residual[0]
    size = float(rms(fitted.residual)[0])
    if size < LEAST_FIELD_CHANGE or size < MOST_FIELD_EXCESS * floor:
        return ""
    (pose,) = fitted.problem.table.numbered(np.array([np.argmax(np.abs(residual))]))
    return (
        f"the magnitude of the field differs by {100 * size:.2g} % between positions, most at pose {pose}: iron or "
        "a magnet is near that does not turn with the sensor, such as a table of steel, a motor or a telephone"
    )
