"""Anybody's table as ours: their names and units mapped to our columns.

A column is named by their header, or by its number from 1 where there is none. Units are those of the target column
(V, deg, degC, s); outputs of `positions` may be in any unit, which the table then carries. A header with our names
needs no mapping, whatever the separator; units in it are used.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from calibrations.errors import DataError, MissingColumn, nearest
from calibrations.reading.cells import cells
from calibrations.reading.plausible import check_at_rest, doubts
from calibrations.reading.proposal import command, missing
from calibrations.reading.separated import Sheet, is_number, look_like_names, sheet
from calibrations.reading.sessions import RATE, is_session, sample_rates
from calibrations.reading.text_file import text_file
from calibrations.reading.tried import advice
from calibrations.reading.units import UNITS, Mapped, own_unit
from calibrations.table import KINDS, NUMBERS, Array, Constant, Table, guess_kind

TRIADS = (("ax", "ay", "az"), ("mx", "my", "mz"))
RATES = ("gx", "gy", "gz")
PATH = "path"


@dataclass(frozen=True)
class Taken:
    """A table, and how it was made of a file: `mapped` has a line for every column that was renamed or converted."""

    table: Table
    sheet: Sheet
    mapped: tuple[Mapped, ...]

    @property
    def settings(self) -> dict[str, object]:
        """What is kept with a run, so that it can be made again."""
        names = {None: "blanks", ",": "comma", ";": "semicolon", "\t": "tab"}
        return {
            "file": Path(self.sheet.name).name,
            "separator": names.get(self.sheet.separator, self.sheet.separator),
            "columns": {m.name: m.text.partition("=")[2] for m in self.mapped},
            "constants": dict(self.table.constants),
        }


def read_foreign(
    path: Path, kind: str | None, mapped: Sequence[Mapped] = (), constants: Mapping[str, Constant] | None = None
) -> Table:
    """The table in the file `path`. Mapped columns take our names; others keep those that a header gives them.

    Raises DataError naming file, line and column.
    """
    return take(sheet(text_file(path)), kind, mapped, constants).table


def take(
    laid: Sheet, kind: str | None, mapped: Sequence[Mapped] = (), constants: Mapping[str, Constant] | None = None
) -> Taken:
    """The table in a sheet. Raises DataError; MissingColumn holds the import that may be meant, ready to be copied."""
    chosen = mapping(laid, mapped)
    try:
        return _taken(laid, kind, chosen, constants or {})
    except MissingColumn as error:
        tail = advice(laid, kind, chosen, constants or {}, lambda *meant: _taken(laid, *_whole(laid, *meant)).table)
        raise MissingColumn(f"{error}{tail}") from None


def _whole(
    laid: Sheet, kind: str, mapped: Sequence[Mapped], constants: Mapping[str, Constant]
) -> tuple[str, list[Mapped], Mapping[str, Constant]]:
    """What is given on the command line, with what the header adds to it."""
    return kind, mapping(laid, mapped), constants


def _taken(laid: Sheet, kind: str | None, chosen: Sequence[Mapped], constants: Mapping[str, Constant]) -> Taken:
    """The table by a whole mapping. Raises DataError, MissingColumn without advice."""
    kept = _kept(laid, chosen, bool(chosen))
    try:
        kind = kind or guess_kind([*(m.name for m in chosen), *kept])
    except MissingColumn as error:
        what = error if look_like_names(laid.header) else "a header line with column names is missing"
        raise MissingColumn(f"{laid.name}, line {laid.line}: {what}") from None
    known = {**laid.constants, **constants}
    known |= _output_unit(chosen, kind, known.get("triad") == "m", laid.name)
    taken = {m.theirs for m in chosen}
    path = next((m.theirs for m in chosen if m.name == PATH), PATH)
    words = [name for name in laid.header if name not in taken and _is_text(laid, name)]
    numbers, texts = cells(laid, list(dict.fromkeys([*words, path])) if path in laid.header else words)
    columns = {m.name: _converted(numbers[m.theirs], m) for m in chosen if m.name != PATH}
    columns |= {name: numbers[name] for name in kept if name in numbers}
    labels = {k: texts[k] for k in kept if k in texts} | ({PATH: texts[path]} if path in texts else {})
    if is_session(kind, columns, labels.get(PATH)):
        columns[RATE] = sample_rates(columns, labels[PATH], known, laid.name)
    table = Table.from_columns(kind, columns, known, laid.name, labels)
    _check_units(table, laid, chosen)
    check_at_rest(table)
    return Taken(table, laid, tuple(chosen))


def mapping(laid: Sheet, mapped: Sequence[Mapped]) -> list[Mapped]:
    """`mapped` with the header's names and units filled in, and the columns that have our names. Raises DataError."""
    chosen: list[Mapped] = []
    for m in mapped:
        if m.name in [other.name for other in chosen]:
            raise DataError(f'{laid.name}: the column "{m.name}" is given twice')
        chosen.append(_found(laid, m))
    taken = {m.theirs for m in chosen}
    for header, bare, unit in zip(laid.header, laid.bare, laid.units, strict=True):
        if bare in NUMBERS - {m.name for m in chosen} and header not in taken:
            chosen.append(fitting(Mapped(bare, header, unit), laid.name))
    return [m for m in chosen if m.unit or m.name != m.theirs]


def needs_mapping(laid: Sheet, kind: str | None, mapped: Sequence[Mapped]) -> bool:
    """Whether columns of a table of `kind`, or of any, are still without our name. Raises what `mapping` raises."""
    chosen = mapping(laid, mapped)
    names = {m.name for m in chosen} | set(_kept(laid, chosen, bool(mapped)))
    if kind == "rates" and PATH in names:
        return bool(missing(kind, laid, chosen))
    sets = KINDS[kind] if kind else [wanted for wanteds in KINDS.values() for wanted in wanteds if len(wanted) > 1]
    return not any(names.issuperset(wanted) for wanted in sets)


def _found(laid: Sheet, m: Mapped) -> Mapped:
    """With the file's full name of the column, and its unit where none is given. Raises MissingColumn, DataError."""
    for names in (laid.header, laid.bare):
        if m.theirs in names:
            place = names.index(m.theirs)
            return fitting(replace(m, theirs=laid.header[place], unit=m.unit or laid.units[place]), laid.name)
    bare, _, unit = m.theirs.rpartition(":")
    if not m.unit and bare in laid.header:
        raise DataError(f'{laid.name}: unknown unit "{unit}" of the column "{bare}"{nearest(unit, UNITS)}')
    raise MissingColumn(f'{laid.name}: there is no column "{m.theirs}"{nearest(m.theirs, laid.header)}')


def fitting(m: Mapped, source: str) -> Mapped:
    """The same. Raises DataError for a unit that cannot become the target's."""
    own = own_unit(m.name)
    if m.unit and own and UNITS[m.unit][0] != own:
        raise DataError(f'{source}: the column "{m.name}" is in {own}; "{m.theirs}" in {m.unit} cannot become that')
    return m


def _kept(laid: Sheet, chosen: Sequence[Mapped], is_mapped: bool) -> list[str]:
    """The columns that are taken beside the mapped ones, under their own names: none of a number where some are."""
    gone = {name for m in chosen for name in (m.name, m.theirs)}
    return [name for name in laid.header if name not in gone] if laid.named or not is_mapped else []


def _is_text(laid: Sheet, name: str) -> bool:
    """Whether a column that is none of ours holds words: the path, and one whose first cell does."""
    return name == "path" or (name not in NUMBERS and not is_number(laid.sample[0][laid.header.index(name)]))


def _converted(values: Array, m: Mapped) -> Array:
    """Values in the target column's unit."""
    _, factor, offset = UNITS[m.unit] if m.unit else ("", 1.0, 0.0)
    return values if (factor, offset) == (1.0, 0.0) else values * factor + offset


def _check_units(table: Table, laid: Sheet, chosen: Sequence[Mapped]) -> None:
    """Raises DataError for numbers that can hardly be in their unit, with the import that gives them another."""
    found = doubts(table, {m.name for m in chosen if m.unit})
    if not found:
        return
    name, (what, unit) = next(iter(found.items()))
    by_name = {name: Mapped(name, name) for name in found} | {m.name: m for m in chosen}
    better = [replace(m, unit=found[m.name][1] if m.name in found else m.unit) for m in by_name.values()]
    own = next(replace(m, unit=own_unit(name)) for m in better if m.name == name)
    if not unit:
        raise DataError(
            f'{laid.name}: the column "{name}" {what}; give the unit that it is in, as in --column {own.text}'
        )
    raise DataError(
        f'{laid.name}: the column "{name}" {what}\nIf they are in {unit}, this takes them:\n\n'
        f"    {command(laid, table.kind, better)}\n\n"
        f"Whoever states the unit is believed: if they are in {own.unit} after all, --column {own.text} says so"
    )


def _output_unit(mapped: Sequence[Mapped], kind: str, field: bool, source: str) -> dict[str, Constant]:
    """The unit of the three axes that are meant, where one is given: the magnetometer's where `field`, or where there
    is no accelerometer. Raises DataError where they differ."""
    accelerometer = any(m.name == "ax" for m in mapped)
    for axes in (RATES,) if kind == "rates" else TRIADS[1:] if field else TRIADS[:1] if accelerometer else TRIADS:
        given = {m.name: UNITS[m.unit][0] for m in mapped if m.unit}
        units = {axis: given.get(axis, "") for axis in axes}
        if len(set(units.values())) > 1:
            said = ", ".join(f"{axis} in {unit or 'no unit'}" for axis, unit in units.items())
            raise DataError(f"{source}: the three axes must be in one unit: {said}")
        if units[axes[0]]:
            return {"unit": units[axes[0]]}
    return {}
