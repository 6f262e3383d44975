"""Foreign tables as ours: names and units mapped to our columns, copied rows; our tables as CSV.

A column is named by the file's header, or by its number from 1 in a file without one. Units are converted to those of
the target column (V, deg, degC, s); outputs of `positions` keep any unit, which the table then carries. A header with
our names needs no mapping, for any separator; units in it are used.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError, MissingColumn, nearest
from calibrations.files import text_source
from calibrations.importing.binary import open_sheet
from calibrations.importing.cells import is_number
from calibrations.importing.plausible import (
    check_at_rest,
    check_stated_rate,
    check_turning,
    find_log_time_doubt,
    find_unit_doubts,
)
from calibrations.importing.raw_logs import is_raw_log
from calibrations.importing.sessions import RATE, TURN, is_session, is_whole_turn_log, sample_rates
from calibrations.importing.sheet import Sheet, look_like_names, read_cells, read_sheet
from calibrations.importing.units import RATES, TRIADS, UNITS, ColumnMapping, column_unit, output_unit, still_units
from calibrations.table import NUMBERS, Array, Constant, Table, guess_kind
from calibrations.tables import FILE_KINDS, TURN_MARKS

PATH = "path"


@dataclass(frozen=True)
class ImportedTable:
    """A table and its import: `mapped` has an entry for each column that was renamed or converted."""

    table: Table
    sheet: Sheet
    mapped: tuple[ColumnMapping, ...]
    damaged: tuple[str, ...] = ()  # remarks on damaged lines

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the import: damaged lines, and a second sensor that is not imported."""
        from calibrations.importing.proposal import second_sensor

        mapping = [*self.mapped, *(ColumnMapping(name, name) for name in self.sheet.header if name in NUMBERS)]
        others = second_sensor(self.sheet, self.table.kind, mapping)
        names = ", ".join(m.file_column for m in others)
        note = f"{self.sheet.name}: {names} look like a second sensor; its outputs are not those of this table."
        return (*self.damaged, note) if others else self.damaged

    @property
    def settings(self) -> dict[str, object]:
        """The settings of the import, kept with the run so that it can be repeated."""
        names = {None: "blanks", ",": "comma", ";": "semicolon", "\t": "tab"}
        return {
            "file": Path(self.sheet.name).name,
            **({"topic": self.sheet.topic} if self.sheet.topic else {}),
            "separator": names.get(self.sheet.separator, self.sheet.separator),
            "columns": {m.name: m.text.partition("=")[2] for m in self.mapped},
            "constants": dict(self.table.constants),
            **({"damaged_lines": self.damaged[0].partition(": ")[2]} if self.damaged else {}),
        }


def import_sheet(
    laid: Sheet, kind: str | None, mapped: Sequence[ColumnMapping] = (), constants: Mapping[str, Constant] | None = None
) -> ImportedTable:
    """The table in a sheet. Mapped columns take our names; the others keep their names in the header.

    Raises DataError with file, line and column; the message of MissingColumn ends with a likely import command.
    """
    mapping = complete_mapping(laid, mapped)
    try:
        return _import_with(laid, kind, mapping, constants or {})
    except MissingColumn as error:
        from calibrations.importing.suggestion import suggest_import  # a table with its columns needs no proposal

        tail = suggest_import(
            laid,
            kind,
            mapping,
            constants or {},
            lambda kind, meant, merged: _import_with(laid, kind, complete_mapping(laid, meant), merged).table,
        )
        raise MissingColumn(f"{error}{tail}") from None


def _import_with(
    laid: Sheet, kind: str | None, mapping: Sequence[ColumnMapping], constants: Mapping[str, Constant]
) -> ImportedTable:
    """The table by a complete mapping. Raises DataError, MissingColumn without advice."""
    unmapped = _unmapped_columns(laid, mapping, bool(mapping))
    try:
        kind = kind or guess_kind([*(m.name for m in mapping), *unmapped])
    except MissingColumn as error:
        reason = error if look_like_names(laid.header) else "a header line with column names is missing"
        raise MissingColumn(f"{laid.place}: {reason}") from None
    merged = {**laid.constants, **constants}
    names = {*(m.name for m in mapping), *unmapped}
    if kind == "still":
        merged |= still_units(mapping, names, laid.name)
    else:
        merged |= output_unit(mapping, kind, merged, laid.name)
    mapped_names = {m.file_column for m in mapping}
    path = next((m.file_column for m in mapping if m.name == PATH), PATH)
    first = zip(laid.header, laid.sample[0], strict=True)
    words = [name for name, cell in first if name not in mapped_names and _is_text(name, cell)]
    required = {*mapped_names - {path}, *NUMBERS}
    notes: list[str] = []
    words = list(dict.fromkeys([*words, path])) if path in laid.header else words
    numbers, texts = read_cells(laid, words, required, notes.append)
    columns = {m.name: _convert(numbers[m.file_column], m) for m in mapping if m.name != PATH}
    columns |= {name: numbers[name] for name in unmapped if name in numbers}
    labels = {k: texts[k] for k in unmapped if k in texts} | ({PATH: texts[path]} if path in texts else {})
    if is_session(kind, columns, labels.get(PATH)):
        columns[RATE] = sample_rates(columns, labels[PATH], merged, laid.name)
    elif is_whole_turn_log(kind, columns, merged):
        from calibrations.importing.turn_logs import cut_whole_turns  # few tables are such logs

        columns, labels = cut_whole_turns(columns, merged, laid.name)
    if kind == "turns" and TURN_MARKS.isdisjoint(columns) and all(name in columns for name in (*RATES, *TRIADS[0])):
        from calibrations.importing.turn_logs import cut_turns  # few tables are such logs

        columns, labels = cut_turns(columns, merged, laid.name), {}
    table = Table.from_columns(kind, columns, merged, laid.name, labels)
    _check_units(table, laid, mapping)
    check_at_rest(table)
    check_turning(table)
    _check_clock(table, laid, mapping)
    return ImportedTable(table, laid, tuple(mapping), tuple(notes))


def complete_mapping(laid: Sheet, mapped: Sequence[ColumnMapping]) -> list[ColumnMapping]:
    """`mapped` with names and units from the header, and the columns that have our names. Raises DataError."""
    mappings: list[ColumnMapping] = []
    for m in mapped:
        if m.name in [mapping.name for mapping in mappings]:
            raise DataError(f'{laid.name}: the column "{m.name}" is mapped twice; give it once')
        mappings.append(_locate(laid, m))
    mapped_names = {m.file_column for m in mappings}
    for header, name, unit in zip(laid.header, laid.bare, laid.units, strict=True):
        if name in NUMBERS - {m.name for m in mappings} and header not in mapped_names:
            mappings.append(check_unit(ColumnMapping(name, header, unit), laid.name))
    return [m for m in mappings if m.unit or m.name != m.file_column]


def needs_mapping(laid: Sheet, kind: str | None, mapped: Sequence[ColumnMapping]) -> bool:
    """Whether a table of `kind`, or of any kind, still lacks columns. Raises as `complete_mapping`."""
    mapping = complete_mapping(laid, mapped)
    names = {m.name for m in mapping} | set(_unmapped_columns(laid, mapping, bool(mapped)))
    if kind == "rates" and (PATH in names or TURN in laid.constants):
        from calibrations.importing.proposal import missing_columns  # as above

        return bool(missing_columns(kind, laid, mapping))
    if kind == "turns" and names.isdisjoint(TURN_MARKS):
        names |= TURN_MARKS
    kinds = [FILE_KINDS[kind]] if kind else FILE_KINDS.values()
    sets = [columns for kind_of_table in kinds for columns in kind_of_table.columns if kind or len(columns) > 1]
    return not any(names.issuperset(columns) for columns in sets)


def _locate(laid: Sheet, m: ColumnMapping) -> ColumnMapping:
    """The mapping with the file's full column name and unit. Raises MissingColumn, DataError."""
    for names in (laid.header, laid.bare):
        if m.file_column in names:
            place = names.index(m.file_column)
            return check_unit(replace(m, file_column=laid.header[place], unit=m.unit or laid.units[place]), laid.name)
    column, _, unit = m.file_column.rpartition(":")
    if not m.unit and column in laid.header:
        raise DataError(f'{laid.name}: unknown unit "{unit}" of the column "{column}"{nearest(unit, UNITS)}')
    raise MissingColumn(f'{laid.name}: there is no column "{m.file_column}"{nearest(m.file_column, laid.header)}')


def check_unit(m: ColumnMapping, source: str) -> ColumnMapping:
    """The mapping itself. Raises DataError for a unit that cannot be converted to the target's."""
    target_unit = column_unit(m.name)
    if m.unit and target_unit and UNITS[m.unit][0] != target_unit:
        raise DataError(
            f'{source}: the column "{m.name}" is in {target_unit}; "{m.file_column}" in {m.unit} cannot be converted '
            "to it"
        )
    return m


def _unmapped_columns(laid: Sheet, mapping: Sequence[ColumnMapping], is_mapped: bool) -> list[str]:
    """The columns that keep their own names; none of a file without a header if some are mapped."""
    used = {name for m in mapping for name in (m.name, m.file_column)}
    return [name for name in laid.header if name not in used] if laid.named or not is_mapped else []


def _is_text(name: str, cell: str) -> bool:
    """Whether a column holds words: the path, or an unknown column whose first cell is not a number."""
    return name == "path" or (name not in NUMBERS and not is_number(cell))


def _convert(values: Array, m: ColumnMapping) -> Array:
    """Values in the target column's unit."""
    _, factor, offset = UNITS[m.unit] if m.unit else ("", 1.0, 0.0)
    return values if (factor, offset) == (1.0, 0.0) else values * factor + offset


def _check_units(table: Table, laid: Sheet, mapping: Sequence[ColumnMapping]) -> None:
    """Raises DataError for numbers that are unlikely in their unit, with the import command for a better one."""
    with_unit = {m.name for m in mapping if m.unit}
    doubts = find_unit_doubts(table, with_unit)
    is_timed = is_raw_log(table) and "t_s" in table and "t_s" not in with_unit
    if is_timed and (doubt := find_log_time_doubt(table.column("t_s"), _clock(mapping))) is not None:
        doubts["t_s"] = doubt
    if not doubts:
        return
    from calibrations.importing.suggestion import import_command  # as above

    name, (reason, unit) = next(iter(doubts.items()))
    by_name = {name: ColumnMapping(name, name) for name in doubts} | {m.name: m for m in mapping}
    corrected = [replace(m, unit=doubts[m.name][1] if m.name in doubts else m.unit) for m in by_name.values()]
    as_stated = next(replace(m, unit=column_unit(name)) for m in corrected if m.name == name)
    if not unit:
        raise DataError(f'{laid.name}: the column "{name}" {reason}; state its unit, as in --column {as_stated.text}')
    raise DataError(
        f'{laid.name}: the column "{name}" {reason}\nIf its unit is {unit}, import it with:\n\n'
        f"    {import_command(laid, table.kind, corrected)}\n\n"
        f"If its unit is {as_stated.unit} after all, state it: --column {as_stated.text}"
    )


def _check_clock(table: Table, laid: Sheet, mapping: Sequence[ColumnMapping]) -> None:
    """Raises MissingColumn for a log without t_s whose time has another name in the file, DataError where that time
    contradicts the stated sample rate.
    """
    if "t_s" in table or not is_raw_log(table) or table.type.field:
        return
    from calibrations.importing.proposal import propose_mapping  # as above

    clock = next((m for m in propose_mapping(laid, table.kind, mapping) if m.name == "t_s"), None)
    if clock is not None and "sample_rate_hz" not in table.constants:
        raise MissingColumn(f'{laid.place}: a raw log needs the column t_s; "{clock.file_column}" looks like the time')
    if clock is not None and clock.file_column in table:
        check_stated_rate(table, replace(clock, unit=laid.units[laid.header.index(clock.file_column)]))


def _clock(mapping: Sequence[ColumnMapping]) -> str:
    """The file's name of the time."""
    return next((m.file_column for m in mapping if m.name == "t_s"), "")


# Rows of a table that a file repeats, and rows whose clock starts again.

MOST_ROWS_LISTED = 3
FEWEST_BETWEEN_RESTARTS = 12  # rows: in shorter parts the rows of a file are in no order of time


def sort_out_rows(table: Table) -> tuple[Table, list[str]]:
    """The table with each reading once and with one clock, and remarks on what that changed."""
    table, copies = drop_duplicate_rows(table)
    table, restart = _with_one_clock(table)
    return table, [remark for remark in (copies, restart) if remark is not None]


def drop_duplicate_rows(table: Table) -> tuple[Table, str | None]:
    """The table without rows that equal an earlier row in every number, time included; and a message that lists them.

    A repeated pose has another time and another reading. Without times, equal rows may be real repetitions: they
    stay.
    """
    if "t_s" not in table:
        return table, None
    among = _rows_at_shared_times(table.column("t_s"))
    if not len(among):
        return table, None
    rows = np.column_stack([values[among] for values in table.columns.values()])
    _, first, group = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    copies = np.setdiff1d(np.arange(len(among)), first)
    if not len(copies):
        return table, None
    earlier = among[first[group.ravel()]]
    pairs = [f"{among[k] + 1} (as {earlier[k] + 1})" for k in copies[:MOST_ROWS_LISTED]]
    rest_words = f" and {len(copies) - MOST_ROWS_LISTED} more" if len(copies) > MOST_ROWS_LISTED else ""
    verb = "copies an earlier row" if len(copies) == 1 else "copy earlier rows"
    rows_said = f"row{'s' if len(copies) > 1 else ''} {', '.join(pairs)}{rest_words}"
    return table.rows(np.delete(np.arange(table.n), among[copies])), (
        f"{table.source}: {rows_said} {verb} (same time, same values); each is used once."
    )


def _rows_at_shared_times(t_s: Array) -> NDArray[np.intp]:
    """Numbers of the rows whose time another row has too."""
    _, group, counts = np.unique(t_s, return_inverse=True, return_counts=True)
    return np.flatnonzero(counts[group] > 1)


def _with_one_clock(table: Table) -> tuple[Table, str | None]:
    """The table with times that continue where the clock starts again, and a message that names the first such row.

    A clock that counts from power-on starts again when the sensor is switched on again. Without this, rows of several
    days would be mixed in order of time. Parts of a file that only stand in another order are not such rows: their
    times do not overlap.
    """
    if "t_s" not in table or not table.type.means:
        return table, None
    t_s = table.column("t_s")
    begins = np.flatnonzero(np.diff(t_s) < 0) + 1
    parts = np.split(t_s, begins)
    if not len(begins) or min(map(len, parts)) < FEWEST_BETWEEN_RESTARTS:
        return table, None
    if any(later[-1] < earlier[0] for earlier, later in pairwise(parts)):
        return table, None
    continued = parts[:1]
    for part in parts[1:]:
        continued.append(part - part[0] + continued[-1][-1] + float(np.median(np.diff(part))))
    return replace(table, columns={**table.columns, "t_s": np.concatenate(continued)}), (
        f"{table.source}: t_s starts again at row {begins[0] + 1}. The rows from there on are taken as measured "
        "directly after the rows before; if they are of another sensor, separate the file."
    )


# Read and write a table as CSV: `# key: value` lines, a header, numbers; text only in columns of text.
#
# Reading accepts all that needs no mapping; writing uses commas and decimal points.


def read_csv(path: Path | str, kind: str | None = None, topic: str | None = None) -> Table:
    """The table in the file `path`, of text or of a known binary format, of the topic `topic` where it has several.

    Without `kind` it is guessed from the columns. Raises DataError with file, line and column.
    """
    return import_sheet(open_sheet(Path(path), topic), kind).table


def parse_csv(content: str, source: str, kind: str | None = None) -> Table:
    """The table in a text. Raises DataError with source, line and column."""
    return import_sheet(read_sheet(text_source(content, source)), kind).table


def write_csv(table: Table, path: Path | str) -> None:
    """Write `table` so that `read_csv` restores it to the last bit."""
    names = [*table.columns, *table.labels]
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        # A constant is one line; a line break in a sensor's name would begin a constant of its own.
        file.writelines(f"# {' '.join(f'{key}: {value}'.splitlines())}\n" for key, value in table.constants.items())
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        cells = [[repr(float(v)) for v in values] for values in table.columns.values()]
        writer.writerows(zip(*cells, *table.labels.values(), strict=True))


def require_kind(table: Table, *kinds: str) -> Table:
    """The table itself. Raises DataError if it is of another kind."""
    if table.kind not in kinds:
        raise DataError(f"{table.source}: a table of {table.kind}; this needs {' or '.join(kinds)}")
    return table
