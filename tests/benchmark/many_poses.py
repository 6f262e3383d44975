"""The linear model fitted to 20,000 poses: a sweep that is repeated, each time with noise of its own."""

from __future__ import annotations

import json
import sys

import numpy as np

from calibrations.fitting.fit import fit
from calibrations.model.file import read_model
from calibrations.table import Table
from rig.services.tables import load
from tests.benchmark.timed import seconds

POSES, PAUSE_S = 20_000, 60.0


def main(data: str) -> None:
    table, model = repeated(load(data), POSES), read_model("linear")
    fit(model, table)
    print(json.dumps({"seconds": seconds(lambda: fit(model, table), 3), "poses": table.n}))


def repeated(table: Table, rows: int) -> Table:
    """The rows of a table again and again, one sweep after the other, up to a number of rows."""
    rng = np.random.default_rng(1)
    times = -(-rows // table.n)
    columns = {name: np.tile(values, times)[:rows] for name, values in table.columns.items()}
    columns["t_s"] += np.repeat(np.arange(times) * (float(np.ptp(table.time_s)) + PAUSE_S), table.n)[:rows]
    for axis in table.axes:
        noise = columns[f"v{axis}_std_v"] / np.sqrt(columns["n"])
        columns[f"v{axis}_v"] += noise * rng.standard_normal(rows)
    return Table.from_columns(table.kind, columns, table.constants, f"{table.source}, repeated")


if __name__ == "__main__":
    main(sys.argv[1])
