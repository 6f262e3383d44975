"""A table of poses as a `Measurement`. The only file of the package that imports the project."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calibrations.geometry.stage_path import last_turn, turning_points
from calibrations.means.noise import white_std
from calibrations.table import Array, Table
from tests.benchmark.free_forms.measurement import Measurement

USED = {"alpha_deg", "beta_deg", "mount_deg", "flip", "t_s", "direction", "temperature_c", "supply_v", "n", "path",
        "alpha_set_deg", "beta_set_deg"}  # fmt: skip


def measurement(table: Table) -> Measurement:
    """A table of poses as the search reads it. Rows in order of time."""
    table = table.in_order()
    white = white_std(table)
    sides, way = _sides_and_way(table)
    spreads = [name.replace("_v", "_std_v") for name in table.output_names]
    std = np.stack([table.column(name) for name in spreads]) if all(name in table for name in spreads) else None
    other = set(table.columns) - USED - set(table.output_names) - set(spreads)
    return Measurement(
        axes=table.axes,
        unit=table.unit,
        alpha=np.radians(table.column("alpha_deg")),
        beta=np.radians(table.column("beta_deg")),
        mount=np.radians(table.optional("mount_deg", 0.0)),
        flip=table.optional("flip", 0.0),
        outputs=table.outputs.T.copy(),
        time_s=table.time_s,
        timed="t_s" in table,
        white=None if white is None else white.T.copy(),
        sides=sides,
        way=way,
        temperature_c=table.column("temperature_c") if "temperature_c" in table else None,
        supply_v=table.column("supply_v") if "supply_v" in table else None,
        std=std,
        logged={name: table.column(name) for name in sorted(other) if np.ptp(table.column(name)) > 0},
    )


def _sides_and_way(table: Table) -> tuple[dict[str, Array], Callable[[float], Array] | None]:
    """Sides as they are known, "logged" (the column direction) or "moved" (the angles), and the way to each pose.

    Where a pose repeats the angles of the one before with the other direction, both differ.
    """
    if "direction" not in table and "t_s" not in table:
        return {}, None

    def approached(by_deg: float) -> Table:
        return replace(table, constants={**table.constants, "approach_deg": by_deg})

    def way(by_deg: float) -> Array:
        return turning_points(approached(by_deg))

    sides = {"moved": last_turn(approached(0.0))}
    if "direction" in table and table.column("direction").any():
        direction = table.column("direction")
        sides["logged"] = np.where(direction != 0, direction, sides["moved"])
        if np.array_equal(sides["logged"], sides["moved"]):
            del sides["moved"]
    return sides, way
