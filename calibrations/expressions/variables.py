"""What the names in an expression stand for: columns of the table, angles in rad, forces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from calibrations.table import NUMBERS, OUTPUTS, Array, Table

# short name -> the column it needs
COLUMNS: Mapping[str, str] = {
    "alpha": "alpha_deg",
    "beta": "beta_deg",
    "mount": "mount_deg",
    "t": "t_s",
    "temperature": "temperature_c",
    "supply": "supply_v",
    "direction": "direction",
    "flip": "flip",
}
ANGLES = ("alpha", "beta", "mount")
FORCES = ("ax", "ay", "az")
MEASURED = {name for names in OUTPUTS.values() for name in names} - {*FORCES}
OF_THE_MEAN = {name for name in NUMBERS if name == "n" or "_std" in name}  # say nothing of the sensor
KNOWN = {*COLUMNS, *FORCES, *NUMBERS} - OF_THE_MEAN  # without a table at hand


def may_be_column(name: str) -> bool:
    """Whether a name that only a table has is a column of it: how its means were taken is none."""
    return name not in KNOWN and name not in OF_THE_MEAN


def variables(names: Iterable[str], table: Table) -> dict[str, Array]:
    """Those of the names that are columns of the table or short names of one, shape (n,); not the forces."""
    found: dict[str, Array] = {}
    for name in names:
        if name in FORCES:
            continue
        if name in COLUMNS:
            column = table.column(COLUMNS[name])
            found[name] = np.radians(column) if name in ANGLES else column
        elif name in table:
            found[name] = table.column(name)
    return found


def forces(a: Array) -> dict[str, Array]:
    """The specific force along the sensing axes, each of shape (n,)."""
    return dict(zip(FORCES, a.T, strict=True))
