"""Checksums of the record's rows: a row that changed on the disk is refused, not used.

SQLite checks its own structure, and not the values. So each row of a run has the CRC-32 of its values. Rows of older
programs have none (NULL); they are readable, and only undecodable values are found in them. If the entry of a run has
one, its other rows need one too: a changed length in the head of a row can hide the checksum.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping
from typing import Any

from sqlalchemy import Column, Float, Integer, LargeBinary, Table

from rig.record.schema import DAMAGED, blocks, columns, dwells, poses, readings, runs

# The values of a row that do not change after its insertion, without the run's name, which is different in a lab. The
# lists stay as they are when a later schema adds columns; else the rows of today would look damaged.
CHECKED_COLUMNS: Mapping[Table, tuple[str, ...]] = {
    runs: (
        "kind", "procedure", "settings", "bench", "identities", "configuration", "constants", "source", "created",
    ),
    poses: (
        "number", "alpha_deg", "beta_deg", "direction", "path", "mount_deg", "flip", "t_s", "temperature_c",
        "alpha_read_deg", "beta_read_deg", "up", "rate_deg_s",
    ),
    blocks: ("number", "rate_hz", "start_s", "channels", "codec", "samples"),
    dwells: ("number", "n", "means", "stds"),
    readings: ("name", "at", "value", "std", "unit"),
    columns: ("name", "position", "numbers", "texts"),
}  # fmt: skip


def with_checksum(table: Table, values: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a new row with their checksum."""
    return {**values, "checksum": _checksum(table, values)}


def is_damaged(table: Table, row: Mapping[Any, Any], required: bool = False) -> bool:
    """Whether a row of `table`, by column, has an undecodable value or another checksum than at its insertion, or none
    where one is `required`.
    """
    values = {column.name: row[column] for column in table.c if column in row}
    if any(value is DAMAGED or (isinstance(value, str) and not _is_text(value)) for value in values.values()):
        return True
    if (expected := values.get("checksum")) is None:
        return required and any(value is not None for value in values.values())  # else an outer join found no row
    return bool(expected != _checksum(table, values))


def _checksum(table: Table, values: Mapping[str, Any]) -> int:
    parts = [_stored_value(table.c[name], values.get(name)) for name in CHECKED_COLUMNS[table]]
    return zlib.crc32(json.dumps(parts).encode())


def _stored_value(column: Column[Any], value: Any) -> Any:
    """The value as the database returns it."""
    if value is None:
        return None
    if isinstance(column.type, Float):
        return None if math.isnan(value) else float(value) + 0.0  # SQLite has no NaN and no negative zero
    if isinstance(column.type, Integer):
        return int(value)
    return zlib.crc32(value) if isinstance(column.type, LargeBinary) else value


def _is_text(value: str) -> bool:
    """Whether all bytes of a text were readable, see `decode_text`."""
    return not any("\ud800" <= letter <= "\udfff" for letter in value) if not value.isascii() else True
