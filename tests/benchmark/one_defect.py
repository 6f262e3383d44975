"""Writes the table of a sweep of 518 poses on a rig with one hidden defect, ten times the noise of a dwell."""

from __future__ import annotations

import sys
from pathlib import Path

from calibrations.importing.foreign import write_csv
from calibrations.table import Table
from tests.hidden.rigs import rig_with


def main(path: str) -> None:
    write_csv(Table.from_columns("poses", rig_with("package stress", 10.0, seed=1), source=path), Path(path))


if __name__ == "__main__":
    main(sys.argv[1])
