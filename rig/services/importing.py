"""Import of a file with names and units that a person chooses: for `rig import` and the page Import."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from calibrations.errors import MissingColumn
from calibrations.importing.binary import open_sheet
from calibrations.importing.cells import SHARES, Policy
from calibrations.importing.foreign import complete_mapping, import_sheet, needs_mapping
from calibrations.importing.plausible import Doubt
from calibrations.importing.proposal import (
    column_names,
    likely_kind,
    missing_columns,
    propose_mapping,
    time_doubt,
)
from calibrations.importing.sheet import Sheet
from calibrations.importing.units import UNITS, ColumnMapping, column_unit
from calibrations.presentation.chart import CANDIDATE, MEASURED, QUIET, Axis, Chart, Panel, Points, single_chart
from calibrations.table import AXES, NUMBERS, Constant, Table, guess_kind
from rig.record import Record
from rig.services.tables import average_log

QUANTITIES = {
    "alpha_deg": "the angle alpha",
    "beta_deg": "the angle beta",
    "rate_deg_s": "the turning rate",
    "t_s": "the time",
    "displacement_m": "the displacement",
    "turn": "the number of the turn",
    "resting": "the rests",
    "path": "the section",
}
SENSORS = {"v": "output", "a": "specific force", "m": "magnetic field", "g": "turning rate"}  # by the first letter
MOST_DRAWN = 4000
TIMES = ("s", "min", "h", "ms")  # units of a time in doubt, for a person
COLOURS = (MEASURED, CANDIDATE, QUIET)
OUTPUT_UNITS = {
    "a": ("g", "mg", "m/s2", "V", "mV", "counts"),
    "m": ("uT", "counts"),
    "g": ("deg/s", "rad/s", "counts"),
}  # of outputs


@dataclass(frozen=True)
class Proposal:
    """The proposal for a file. `columns`: the mapping of each column of the file, None for an unused column."""

    kind: str
    columns: Mapping[str, ColumnMapping | None]


@dataclass(frozen=True)
class Preview:
    """The table that an import would store, and remarks on it."""

    table: Table
    notes: tuple[str, ...]


def open_file(path: Path, topic: str | None = None, bad_lines: Policy = "few") -> Sheet:
    """The sheet in a file, of the topic `topic` where it has several.

    `bad_lines`: the treatment of damaged lines of a text: skip a few, skip them, or refuse them. Raises DataError,
    SeveralTopics.
    """
    return replace(open_sheet(path, topic), skipped=SHARES[bad_lines])


def needs_person(sheet: Sheet) -> bool:
    """Whether a person has to name columns or units before the file can be used. Raises DataError."""
    return needs_mapping(sheet, None, ()) or time_doubt(sheet, _known_columns(sheet)) is not None


def proposal(sheet: Sheet, kind: str | None = None, mapped: Sequence[ColumnMapping] = ()) -> Proposal:
    """The proposed mapping of a sheet, as `kind` or as the likely one. `mapped`: columns that a person has named."""
    mapping = named_columns(sheet, mapped)
    kind = kind or _kind(sheet, mapping)
    target_names = column_names(kind)
    proposed = propose_mapping(sheet, "poses" if kind == "still" else kind, mapping)
    mappings = {m.file_column: m for m in proposed if m.name in target_names or m in mapping}
    return Proposal(kind, {name: mappings.get(name) for name in sheet.header})


def further_columns(sheet: Sheet, kind: str | None, mapped: Sequence[ColumnMapping]) -> list[ColumnMapping]:
    """The proposals of the page Import for the columns that neither a person nor their names in the file explain.

    No outputs in addition to `mapped` ones: a person who names the outputs of one sensor leaves out those of another.
    """
    named = {m.file_column for m in (*mapped, *named_columns(sheet, mapped))}
    proposed = proposal(sheet, kind, mapped).columns.values()
    further = [m for m in proposed if m is not None and m.file_column not in named]
    return [m for m in further if not (mapped and _output_axis(m.name))]


def named_columns(sheet: Sheet, mapped: Sequence[ColumnMapping] = ()) -> list[ColumnMapping]:
    """The columns that a person has named, and those that have our names already. Raises DataError."""
    by_person = complete_mapping(sheet, mapped)
    names = {name for m in by_person for name in (m.name, m.file_column)}
    return [*by_person, *(m for m in _known_columns(sheet) if names.isdisjoint((m.name, m.file_column)))]


def doubt_of_time(sheet: Sheet, columns: Sequence[ColumnMapping]) -> Doubt | None:
    """The doubt about the unit of the time with these columns; only the header of the file states one."""
    with_stated_unit = [replace(m, unit=_header_unit(sheet, m.file_column)) if m.name == "t_s" else m for m in columns]
    return time_doubt(sheet, with_stated_unit)


def units_for(name: str) -> list[str]:
    """The units that a column of this name may have in a file, its own unit first; none for a bare number."""
    if target_unit := column_unit(name):
        return sorted(
            (unit for unit, (base_unit, _, _) in UNITS.items() if base_unit == target_unit),
            key=lambda unit: unit != target_unit,
        )
    return list(OUTPUT_UNITS.get(name[:1], ())) if name[1:] in AXES else []


def lacking(sheet: Sheet, kind: str, columns: Sequence[ColumnMapping]) -> list[str]:
    """The columns that the import still needs."""
    return missing_columns(kind, sheet, columns) if kind != "still" else [] if _outputs(columns) else ["vx_v"]


def column_words(name: str) -> str:
    """A column that an import needs, in words: `the column of the angle alpha (alpha_deg)`."""
    if name in QUANTITIES:
        return f"the column of {QUANTITIES[name]} ({name})"
    if axis := _output_axis(name):
        return f"the column of the {SENSORS[name[0]]} along {axis} ({name})"
    return f"the column {name}"


def preview(sheet: Sheet, kind: str, columns: Sequence[ColumnMapping], constants: Mapping[str, Constant]) -> Preview:
    """The table of an import that is not stored. Raises DataError."""
    notes = list(sheet.notes)
    imported = import_sheet(sheet, kind, columns, constants)
    notes += imported.notes
    table = average_log(imported.table, notes.append)
    return Preview(table, tuple(notes))


def store_sheet(
    sheet: Sheet,
    kind: str | None,
    columns: Sequence[ColumnMapping],
    constants: Mapping[str, Constant],
    notify: Callable[[str], None],
) -> tuple[str, Table]:
    """Store the sheet in the record: the name of the new run, and its table. Raises DataError, RecordError."""
    imported = import_sheet(sheet, kind, columns, constants)
    for remark in (*sheet.notes, *imported.notes):
        notify(remark)
    table = average_log(imported.table, notify)
    with Record.to_read() as record:
        return record.add_table(table, imported.settings), table


def data_chart(table: Table) -> Chart:
    """The outputs of a table over the stage angle beta, the time, or the row."""
    stride = max(1, -(-table.n // MOST_DRAWN))
    name = next((column for column in ("beta_deg", "t_s") if column in table), "")
    x = table.column(name) if name else np.arange(table.n, dtype=float)
    outputs = [column for column in table.output_names if column in table]
    dots = [
        Points(x[::stride], table.column(column)[::stride], column, colour, size=4)
        for column, colour in zip(outputs, COLOURS, strict=False)
    ]
    label = f"{name.rpartition('_')[0]} ({column_unit(name)})" if name else "row"
    unit = column_unit(outputs[0]) or table.unit
    return single_chart(Panel(tuple(dots), Axis(label), Axis(f"outputs ({unit})"), legend="outside"))


def _known_columns(sheet: Sheet) -> list[ColumnMapping]:
    """The columns that have our names already."""
    columns = zip(sheet.header, sheet.bare, sheet.units, strict=True)
    return [ColumnMapping(unitless, header, unit) for header, unitless, unit in columns if unitless in NUMBERS]


def _kind(sheet: Sheet, own_columns: Sequence[ColumnMapping]) -> str:
    try:
        return guess_kind([m.name for m in own_columns])
    except MissingColumn:
        kind = likely_kind(sheet, own_columns)
    names = {m.name for m in propose_mapping(sheet, kind, own_columns)}
    return "still" if kind == "poses" and not {"alpha_deg", "beta_deg"} & names and "vx_v" in names else kind


def _header_unit(sheet: Sheet, column: str) -> str:
    """The unit of a column in the file's header."""
    return sheet.units[sheet.header.index(column)]


def _output_axis(name: str) -> str:
    """The axis of an output of a sensor; "" for another column."""
    return name[1] if re.fullmatch(r"v[xyz]_v|[amg][xyz]", name) else ""


def _outputs(columns: Sequence[ColumnMapping]) -> bool:
    return any(m.name in ("vx_v", "vy_v", "vz_v") for m in columns)
