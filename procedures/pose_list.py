"""Lists of poses: the lines of a CSV file. Its columns are the fields of a pose.

    alpha_deg,beta_deg,direction,path,mount_deg,flip

The header and the two angles are required, the other columns are optional. The record keeps the lines with the run, so
a resumed run does not need the file.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from dataclasses import fields
from typing import Any

from drivers.errors import did_you_mean
from procedures.bounds import require_bounded
from procedures.errors import SettingError
from procedures.session import Pose

# `up` and `rate_deg_s` belong to positions and rates, not to poses.
NAMES = tuple(field.name for field in fields(Pose) if field.name not in ("up", "rate_deg_s"))


def parse_poses(lines: Sequence[str]) -> list[Pose]:
    """The poses in order. Blank lines and lines that begin with # are ignored.

    Raises SettingError with line and column.
    """
    numbered = [(number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.startswith("#")]
    require_bounded(numbered[1:])
    rows = [(number, [cell.strip() for cell in row]) for number, line in numbered for row in csv.reader([line])]
    (first, head), *data_rows = rows or [(1, [])]
    for name in head:
        if name not in NAMES:
            raise SettingError(f"pose_list, line {first}: a pose has no column {name!r}.{did_you_mean(name, NAMES)}")
    if not {"alpha_deg", "beta_deg"} <= set(head) or not data_rows:
        raise SettingError("pose_list: give a header with alpha_deg and beta_deg, and at least one pose below it")
    return [_pose(number, head, row) for number, row in data_rows]


def format_poses(poses: Iterable[Pose]) -> tuple[str, ...]:
    """The lines from which `parse_poses` reads the same poses."""
    return (",".join(NAMES), *(",".join(_text(getattr(pose, name)) for name in NAMES) for pose in poses))


def _pose(number: int, head: Sequence[str], row: Sequence[str]) -> Pose:
    if len(row) != len(head):
        names = ", ".join(head)
        raise SettingError(f"pose_list, line {number}: {len(row)} values for {len(head)} columns; give {names}")
    values: dict[str, Any] = {name: _value(number, name, cell) for name, cell in zip(head, row, strict=True)}
    return Pose(**values)


def _value(number: int, name: str, cell: str) -> str | float | int:
    if name == "path":
        return cell
    allowed_values = {"direction": (-1, 0, 1), "flip": (0, 1)}.get(name)
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value) or (allowed_values and value not in allowed_values):
        expected = f"one of {', '.join(map(str, allowed_values))}" if allowed_values else "a number"
        raise SettingError(f"pose_list, line {number}, column {name}: the value is {cell!r}; give {expected}")
    return int(value) if allowed_values else value


def _text(value: str | float | int) -> str:
    return value if isinstance(value, str) else f"{value:.10g}"
