"""Calibrations of sensors over years, as tables in the record."""

from __future__ import annotations

import json

from calibrations.table import Table
from rig.record import Record
from tests.calibrations.synthetic import components, poses, turns

COLUMNS = turns((90, 30), step_deg=45.0)


def calibrated(serial: str, day: str, bias: float, seed: int = 0, rig: str = "") -> str:
    """A run of one sensor with a date of its own, imported, or measured on a named rig; its id."""
    x, y, _ = components(COLUMNS)
    made = poses(COLUMNS, bias + 1.001 * x, 2.45 + 0.98 * y, seed=seed)
    constants = {"sensor": "ADXL203", "serial": serial, **({"date": day} if day else {})}
    with Record() as record:
        run = record.add_table(Table.from_columns("poses", made.columns, constants, "made"))
        if rig:
            with record.engine.begin() as to:
                to.exec_driver_sql(
                    "UPDATE runs SET bench = ?, checksum = NULL WHERE run = ?", (json.dumps({"name": rig}), run)
                )
    return run
