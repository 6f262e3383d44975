"""Foreign files of tests, read with a mapping of columns and with constants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from calibrations.importing.binary import open_sheet
from calibrations.importing.foreign import import_sheet
from calibrations.importing.units import ColumnMapping
from calibrations.table import Constant, Table


def read_foreign(
    path: Path,
    kind: str | None,
    mapped: Sequence[ColumnMapping] = (),
    constants: Mapping[str, Constant] | None = None,
    topic: str | None = None,
) -> Table:
    return import_sheet(open_sheet(path, topic), kind, mapped, constants).table
