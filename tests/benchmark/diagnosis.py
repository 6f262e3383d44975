"""Diagnosis in a process that is warm: read once, diagnosed again and again."""

from __future__ import annotations

import json
import sys

from calibrations.loop import diagnose
from calibrations.model.file import read_model
from calibrations.table import Table
from rig.services.tables import load
from tests.benchmark.timed import seconds


def main(data: str) -> None:
    table, model = load(data), read_model("linear")

    def fresh() -> Table:
        """The same table as if just read: nothing that was worked out for it before is remembered."""
        return Table.from_columns(table.kind, table.columns, table.constants, table.source, table.labels)

    found = diagnose(fresh(), model)
    taken = seconds(lambda: diagnose(fresh(), model), 3)
    print(json.dumps({"seconds": taken, "verdict": found.verdict, "steps": len(found.missing)}))


if __name__ == "__main__":
    main(sys.argv[1])
