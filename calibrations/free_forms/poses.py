"""Data of a table of poses for the search: angles, time, logged columns, outputs and their white noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from calibrations.geometry.orientation import one_orientation
from calibrations.geometry.stage_path import STATED_APPROACH, last_turn, turning_points, with_approach
from calibrations.table import Array, Table

USED = {"alpha_deg", "beta_deg", "mount_deg", "flip", "t_s", "direction", "temperature_c", "supply_v", "n", "path",
        "alpha_set_deg", "beta_set_deg", "excluded"}  # fmt: skip
LOGGED_DEG = 5.0  # approach of a pose whose side is taken from the column `direction`

SIDES = {0.0: "moved", LOGGED_DEG: "logged", STATED_APPROACH: "stated"}  # names of sides by the length of the approach


def logged_columns(table: Table) -> list[str]:
    """The logged columns that change, without those that have a place or a meaning of their own."""
    of_outputs = {*table.output_names, *table.std_names, *(f"{name}_of_mean" for name in table.std_names)}
    return sorted(name for name in set(table.columns) - USED - of_outputs if np.ptp(table.column(name)) > 0)


@dataclass(frozen=True, eq=False)
class PoseData:
    """A table of poses with the rows in order of time. Angles in rad, (n,); outputs in the table's unit, (channels, n).

    sides   sides from which beta came, (n,), by how far the approach begins before a pose, deg: 0 where the angles tell
    spread  standard deviation of the samples, (channels, n); None where it is not logged
    logged  any other column that changes
    """

    table: Table
    alpha: Array
    beta: Array
    mount: Array
    flip: Array
    outputs: Array
    sides: Mapping[float, Array]
    spread: Array | None = None
    logged: Mapping[str, Array] = field(default_factory=dict)

    @staticmethod
    def of(table: Table) -> PoseData:
        """The data of a table in order of time."""
        spreads = table.std_names
        return PoseData(
            table=table,
            alpha=np.radians(table.column("alpha_deg")),
            beta=np.radians(table.column("beta_deg")),
            mount=np.radians(table.optional("mount_deg", 0.0)),
            flip=table.optional("flip", 0.0),
            outputs=table.outputs.T.copy(),
            sides=_sides(table),
            spread=np.stack([table.column(name) for name in spreads]) if all(s in table for s in spreads) else None,
            logged={name: table.column(name) for name in logged_columns(table)},
        )

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that were measured."""
        return self.table.axes

    @property
    def n(self) -> int:
        """Number of poses."""
        return len(self.alpha)

    @property
    def channels(self) -> int:
        """Number of measured axes."""
        return len(self.axes)

    @property
    def at_rest(self) -> bool:
        """Whether all poses have one orientation: no function of the force can be known."""
        return one_orientation(self.table)

    @property
    def timed(self) -> bool:
        """Whether the time was logged, and changes."""
        return "t_s" in self.table and float(np.ptp(self.table.time_s)) > 0

    @property
    def elapsed_share(self) -> Array:
        """Time from 0 to 1 along the record, shape (n,)."""
        t = self.table.time_s
        return np.asarray((t - t.min()) / (float(np.ptp(t)) or 1.0))

    @property
    def remounted(self) -> bool:
        """Whether the sensor was mounted in several ways: an offset of beta is then no turn of the sensor about z."""
        return bool(np.ptp(self.flip) > 0 or np.ptp(self.mount) > 0)


def _sides(table: Table) -> dict[float, Array]:
    """Sides as the angles have them, and as the column `direction` has them where that differs."""
    if "direction" not in table and "t_s" not in table:
        return {}
    if "approach_deg" in table.constants:
        return {STATED_APPROACH: last_turn(table)}
    approach_side = last_turn(with_approach(table, 0.0))
    if "direction" not in table or not table.column("direction").any():
        return {0.0: approach_side}
    logged = np.where(table.column("direction") != 0, table.column("direction"), approach_side)
    return {LOGGED_DEG: logged} if np.array_equal(logged, approach_side) else {0.0: approach_side, LOGGED_DEG: logged}


def turning_forces(table: Table, by_deg: float) -> Array:
    """Specific force where it turns round before each pose, g, shape (n, points, 3)."""
    return turning_points(with_approach(table, by_deg))


def side(table: Table, by_deg: float) -> Array:
    """Side of the last move of beta, +-1, shape (n,): that of `direction` where the approach has a length."""
    return last_turn(with_approach(table, by_deg))
