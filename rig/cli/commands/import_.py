"""import: store a file in the record as a run."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import click

from calibrations.errors import DataError, nearest
from calibrations.importing.cells import number_or_text
from calibrations.importing.foreign import PATH, check_unit, needs_mapping
from calibrations.importing.plausible import Doubt
from calibrations.importing.proposal import (
    COLUMN_NAMES,
    NAME_PATTERNS,
    column_names,
    likely_kind,
    missing_columns,
    propose_mapping,
    sample_values,
)
from calibrations.importing.sheet import Sheet
from calibrations.importing.suggestion import import_command as repeating_command
from calibrations.importing.units import ColumnMapping, column_unit, parse_unit
from calibrations.table import NUMBERS
from calibrations.tables import FILE_KINDS
from rig.cli.terminal.output import emit, json_option, note
from rig.cli.terminal.progress import working

LEAVE = "-"


@click.command("import")
@click.argument("file", type=click.Path(exists=True, path_type=Path))
@click.option("--kind", type=click.Choice(tuple(FILE_KINDS)), help="Kind of table.")
@click.option(
    "--column", "mapped", multiple=True, metavar="NAME=THEIRS:UNIT", help="Name a column of the file; repeatable."
)
@click.option(
    "--constant", "constant_texts", multiple=True, metavar="KEY=VALUE", help="A constant, such as gravity_m_s2=9.81744."
)
@click.option("--topic", metavar="NAME", help="Topic, group or worksheet of a file that has several.")
@click.option(
    "--bad-lines",
    type=click.Choice(["skip", "refuse"]),
    help="Damaged lines of a text: skip all, or refuse the first. Without it at most 1 % of the lines are skipped.",
)
@json_option
def import_command(
    file: Path,
    kind: str | None,
    mapped: tuple[str, ...],
    constant_texts: tuple[str, ...],
    topic: str | None,
    bad_lines: Literal["skip", "refuse"] | None,
    as_json: bool,
) -> None:
    """Store FILE in the record. A raw log is averaged over its still intervals.

    FILE is CSV, JSON, HDF5, MATLAB, NumPy, Parquet, Excel, ULog (PX4), DataFlash (ArduPilot) or a ROS bag (also a
    folder with metadata.yaml); its first bytes tell which.

    THEIRS is a name in the file's header, or a column number from 1 if the file has no header. In a terminal the
    program proposes names for unknown columns and asks.
    """
    from calibrations.importing.topics import SeveralTopics
    from rig.services.importing import open_file, store_sheet

    attended = sys.stdin.isatty() and sys.stderr.isatty()
    try:
        with working(f"reading {file}"):
            sheet = open_file(file, topic, bad_lines or "few")
    except SeveralTopics as several:
        if not attended:
            raise
        note(str(several))
        choice = click.Choice(list(several.topics))
        topic = str(click.prompt("Topic", default=several.proposed or None, type=choice, err=True))
        sheet = open_file(file, topic, bad_lines or "few")
    columns, constants = [ColumnMapping.parse(text) for text in mapped], _constants(constant_texts)
    sheet = replace(sheet, constants={**sheet.constants, **constants})
    if not needs_mapping(sheet, kind, columns):
        columns = [*columns, *_take_proposals(sheet, kind, columns, attended)]
    elif attended:
        kind, columns = ask_mapping(sheet, kind, columns, constant_texts)
    with working(f"storing {file}"):
        run, table = store_sheet(sheet, kind, columns, constants, note)
    if table.content == "positions" and {"ax", "mx"} <= set(table.columns):
        note("The run has the accelerometer; with --constant triad=m it has the magnetometer.")
    if as_json:
        names = [*table.columns, *table.labels]
        emit({"schema": "rig.import/1", "run": run, "kind": table.kind, "rows": table.n, "columns": names})
    else:
        click.echo(f"{run}: {table.n} rows of {table.kind} ({', '.join(table.columns)})")
        click.echo(f"Next: rig compare {run}")


def _constants(texts: tuple[str, ...]) -> dict[str, str | float]:
    constants: dict[str, str | float] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        if not equals:
            raise click.UsageError(f'"{text}": write a constant as KEY=VALUE, such as gravity_m_s2=9.81744')
        constants[key] = number_or_text(value)
    return constants


def _take_proposals(
    sheet: Sheet, kind: str | None, mapped: Sequence[ColumnMapping], attended: bool
) -> list[ColumnMapping]:
    """The further columns that the page Import would propose, with a note on each.

    Raises DataError if the unit of a time is in doubt and nobody can be asked.
    """
    from rig.services.importing import doubt_of_time, further_columns, named_columns

    taken = further_columns(sheet, kind, mapped)
    clock = next((m for m in taken if m.name == "t_s"), None)
    if clock is not None and (doubt := doubt_of_time(sheet, [*named_columns(sheet, mapped), *taken])) is not None:
        taken[taken.index(clock)] = replace(clock, unit=_unit_of_time(sheet, clock, doubt, attended))
    for m in taken:
        unit = m.unit or column_unit(m.name)
        taken_as = f"{m.name} in {unit}" if unit else m.name
        note(
            f'The column "{m.file_column}" is taken as {taken_as}. Another meaning or unit: '
            f"--column NAME={m.file_column}:UNIT; as it is: --column {m.file_column}={m.file_column}"
        )
    return taken


def _unit_of_time(sheet: Sheet, clock: ColumnMapping, doubt: Doubt, attended: bool) -> str:
    """The unit of the time, by a person. Raises DataError without one."""
    from rig.services.importing import TIMES

    reason, fits = doubt
    if not attended:
        stated = replace(clock, unit=fits or "s").text
        raise DataError(
            f'{sheet.name}: the time "{clock.file_column}" {reason}; state its unit, as in --column {stated}'
        )
    note(f'The time "{clock.file_column}" {reason}; no stage does that.')
    return str(click.prompt("Its unit", default=fits or None, type=click.Choice(TIMES), err=True))


# Questions to a person about the columns of a file.


def ask_mapping(
    sheet: Sheet, kind: str | None, mapped: Sequence[ColumnMapping], constants: Sequence[str]
) -> tuple[str, list[ColumnMapping]]:
    """The kind of table and the mapping, confirmed by a person; prints the command that repeats the import.

    Raises click.Abort if the person gives up.
    """
    note(f"{sheet.name} has columns with unknown names. Name them.")
    if kind is None:
        kinds = click.Choice(sorted(NAME_PATTERNS))
        question = (
            "Kind of table: known stage angles (poses), still positions by hand (positions), rotation (rates), "
            "vibration (motion); Enter accepts"
        )
        kind = str(click.prompt(question, default=likely_kind(sheet, mapped), type=kinds, show_choices=False, err=True))
    names = "; ".join(" ".join(filter(None, (group, *names))) for group, names in COLUMN_NAMES[kind].items())
    note(f"\nColumn names: {names}\nEnter accepts the proposal in brackets, {LEAVE} skips the column. Or type a name,")
    note("with a unit if it differs (vx_v:mV), or only a unit (mV).\n")
    mapping = _columns(sheet, kind, mapped)
    while lacking := missing_columns(kind, sheet, mapping):
        note(f"\nA table of {kind} also needs {', '.join(lacking)}. Again:\n")
        mapping = _columns(sheet, kind, mapped)
    note(f"\nTo repeat this import without questions:\n    {repeating_command(sheet, kind, mapping, constants)}\n")
    return kind, mapping


def _columns(sheet: Sheet, kind: str, mapped: Sequence[ColumnMapping]) -> list[ColumnMapping]:
    """Ask for the name of each unknown column."""
    mapping = list(mapped)
    proposals = {m.file_column: m for m in propose_mapping(sheet, kind, mapped)}
    mapped_columns = {m.file_column for m in mapped}
    for column, name in zip(sheet.header, sheet.bare, strict=True):
        if name in NUMBERS or column in mapped_columns:
            continue
        if m := _column(sheet, column, proposals.get(column), mapping):
            mapping.append(m)
    return mapping


def _column(
    sheet: Sheet, column: str, proposal: ColumnMapping | None, mapped: Sequence[ColumnMapping]
) -> ColumnMapping | None:
    """Ask for the name of one column until the answer is valid."""
    values = sample_values(sheet, column)
    range_text = (
        f"{values.min():g} .. {values.max():g}" if len(values) else f'"{sheet.sample[0][sheet.header.index(column)]}"'
    )
    default = proposal.text.partition("=")[0] + (f":{proposal.unit}" if proposal.unit else "") if proposal else LEAVE
    while True:
        answer = str(click.prompt(f"  {column:16} {range_text:24}", default=default, err=True)).strip()
        try:
            return _parse_answer(answer, column, proposal, mapped, sheet.name)
        except DataError as error:
            note(f"    {error}")


def _parse_answer(
    answer: str, column: str, proposal: ColumnMapping | None, mapped: Sequence[ColumnMapping], source: str
) -> ColumnMapping | None:
    """The column for an answer, None if it is skipped. Raises DataError."""
    if answer == LEAVE:
        return None
    if proposal is not None and parse_unit(answer) and answer not in NUMBERS:
        return check_unit(replace(proposal, unit=parse_unit(answer)), source)
    name, colon, unit = answer.partition(":")
    if name not in NUMBERS | {PATH}:
        raise DataError(f'"{name}" is not a column name{nearest(name, column_names())}')
    if name in {m.name for m in mapped}:
        raise DataError(f"{name} is already the name of another column")
    if colon and not parse_unit(unit):
        raise DataError(f'"{unit}" is not a known unit')
    return check_unit(ColumnMapping(name, column, parse_unit(unit)), source)
