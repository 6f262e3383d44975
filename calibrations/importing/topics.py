"""A binary log as a sheet: one of its topics (a message, a group of arrays, a worksheet), with columns in memory.

A reader gives the topics of a file without their values; the values of one topic are read when it is chosen.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from calibrations.errors import DataError, nearest
from calibrations.files import LARGEST_BYTES, LARGEST_RATIO, SMALL_BYTES, Source, text_source
from calibrations.importing.proposal import sensor_kind
from calibrations.importing.sheet import HEAD_LINES, Sheet, read_sheet
from calibrations.importing.units import split_unit
from calibrations.table import Array, Constant

Cells = Mapping[str, "Array | tuple[str, ...]"]  # by name in the header, with a unit in brackets; equal lengths
MOST_LISTED = 12


class SeveralTopics(DataError):
    """A file has several topics that can be meant: `topics` has a description of each by its name, `proposed` is the
    likely one, "" without.
    """

    def __init__(self, message: str, topics: Mapping[str, str], proposed: str) -> None:
        super().__init__(message)
        self.topics, self.proposed = dict(topics), proposed


@dataclass(frozen=True)
class Topic:
    """One table of a file. `header`: names of columns; `rows`: their length; `cells` reads the columns.

    `text` gives a worksheet's text instead. `notes` tell what a person must know of the values, such as a correction
    that they already contain. `refusal` says why this topic cannot be imported.
    """

    name: str
    header: tuple[str, ...]
    rows: int
    cells: Callable[[], Cells] | None = None
    text: Callable[[], str] | None = None
    constants: Mapping[str, Constant] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    refusal: str = ""
    sensor: str | None = None  # a, m, g, "" for none; None where the columns' names tell it

    @property
    def rank(self) -> int:
        """0 for an accelerometer, 1 for a magnetometer, 2 for a gyroscope, 3 for other values."""
        sensor = sensor_kind(self.header, self.name) if self.sensor is None else self.sensor
        return "amg".index(sensor) if sensor else 3

    @property
    def described(self) -> str:
        """The topic in a list: its name, rows and columns."""
        if not self.header:
            return f"{self.name} ({self.rows} rows)"
        names = ", ".join(self.header[:6]) + (", ..." if len(self.header) > 6 else "")
        return f"{self.name} ({self.rows} rows: {names})"


def topic_sheet(path: Path, topics: Sequence[Topic], name: str | None) -> Sheet:
    """The sheet of the topic `name`, or of the only one that holds an accelerometer, else a magnetometer, else a
    gyroscope.

    Raises SeveralTopics where a person has to choose, DataError for a topic that does not exist or cannot be read.
    """
    if not topics:
        raise DataError(f"{path}: has no table of two or more rows of numbers; export the measurements again")
    topic = _choose_topic(path, topics, name)
    if topic.refusal:
        raise DataError(f"{path}, topic {topic.name}: {topic.refusal}")
    unread = [t for t in topics if t is not topic]
    notes = topic.notes
    if unread and name is None:
        notes = (
            f"{path}: reading {topic.name}; choose another with --topic: {_list_names(t.name for t in unread)}",
            *notes,
        )
    topic_name = topic.name if unread else ""
    if topic.text is not None:
        sheet = read_sheet(text_source(topic.text(), str(path)))
    elif topic.cells is None or topic.rows < 1:
        raise DataError(f"{path}, topic {topic.name}: has no rows; record the measurements again")
    else:
        sheet = _column_sheet(str(path), topic.cells(), topic.constants, topic_name)
    return replace(sheet, topic=topic_name, notes=notes, topics=tuple(t.name for t in topics))


def _column_sheet(name: str, cells: Cells, constants: Mapping[str, Constant], topic: str) -> Sheet:
    """Columns in memory as a sheet. Columns without any finite number are left out.

    Raises DataError without a column of numbers.
    """
    columns = {k: v for k, v in cells.items() if isinstance(v, tuple) or bool(np.isfinite(v).any())}
    if all(isinstance(v, tuple) for v in columns.values()):
        place = f"{name}, topic {topic}" if topic else name
        raise DataError(f"{place}: has no numbers; choose a file or a topic with columns of measurements")
    sample = tuple(zip(*(_head(v) for v in columns.values()), strict=False))
    header = tuple(columns)
    has_names = not all(column.isdigit() for column in header)
    units = tuple(split_unit(column)[1] for column in header)
    return Sheet(
        Source(name, _no_text), None, header, units, has_names, len(header), 1, 1, sample, dict(constants), columns
    )


def library(module: str, extra: str, path: Path, description: str) -> Any:
    """An optional library, imported. Raises DataError that names it and the extra that brings it."""
    try:
        return import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise DataError(
            f"{path}: is {description}; the library {package} that reads it is not installed. Install it with\n\n"
            f"    pip install 'inertial-rig[{extra}]'\n"
        ) from None


def require_size(path: Path, unpacked: int) -> None:
    """Raises DataError where the values of a file are too many for memory, or for a packed file of its size."""
    packed = path.stat().st_size
    if unpacked > LARGEST_BYTES:
        raise DataError(
            f"{path}: holds {unpacked / 2**30:.1f} GiB of values; the limit is {LARGEST_BYTES >> 30} GiB; "
            "export a part of the log"
        )
    if unpacked > max(SMALL_BYTES, LARGEST_RATIO * packed):
        raise DataError(
            f"{path}: the unpacked file is more than {LARGEST_RATIO} times larger, which is unusual for measurements; "
            "if it is a table, save it without compression"
        )


def _choose_topic(path: Path, topics: Sequence[Topic], name: str | None) -> Topic:
    names = [t.name for t in topics]
    if name is not None:
        if name not in names:
            raise DataError(f'{path}: there is no topic "{name}"{nearest(name, names)}')
        return topics[names.index(name)]
    if len(topics) == 1:
        return topics[0]
    able = [t for t in topics if not t.refusal and t.rows > 1]
    best = [t for t in able if t.rank == min(candidate.rank for candidate in able)]
    proposed = best[0].name if best and best[0].rank < 3 else ""
    if len(best) == 1:
        return best[0]
    lines = "".join(f"\n    {t.described}" for t in topics[:MOST_LISTED])
    rest_words = f"\n    and {len(topics) - MOST_LISTED} more" if len(topics) > MOST_LISTED else ""
    command = shlex.join(["rig", "import", str(path), "--topic", proposed or names[0]])
    raise SeveralTopics(
        f"{path}: has {len(topics)} topics; choose one with --topic:{lines}{rest_words}\nSuch as\n\n    {command}\n",
        {t.name: t.described for t in topics},
        proposed,
    )


def _list_names(names: Any) -> str:
    all_names = list(names)
    rest_words = f" and {len(all_names) - MOST_LISTED} more" if len(all_names) > MOST_LISTED else ""
    return ", ".join(all_names[:MOST_LISTED]) + rest_words


def _head(values: Array | tuple[str, ...]) -> list[str]:
    """The first cells as text; of numbers, the first finite ones, repeated where they are few."""
    if isinstance(values, tuple):
        return list(values[:HEAD_LINES])
    first_values = values[: 4 * HEAD_LINES]
    finite = first_values[np.isfinite(first_values)]
    if not len(finite):
        finite = values[np.isfinite(values)]
    return [repr(float(v)) for v in np.resize(finite, min(HEAD_LINES, len(values)))]


def _no_text() -> Any:
    raise DataError("the values of this file are in memory; it has no text")
