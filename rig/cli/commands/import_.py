"""import: take a file into the record as a run."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click

from calibrations.errors import DataError, nearest
from calibrations.importing.foreign import PATH, check_unit
from calibrations.importing.proposal import import_command, likely_kind, missing_columns, propose_mapping, sample_values
from calibrations.importing.sheet import Sheet
from calibrations.importing.units import ColumnMapping, parse_unit
from calibrations.table import NUMBERS
from rig.cli.terminal.output import emit, json_option, note

LEAVE = "-"
CHOICES = {
    "poses": "alpha_deg beta_deg vx_v vy_v vz_v direction t_s temperature_c supply_v vx_std_v vy_std_v n flip",
    "positions": "ax ay az t_s temperature_c n; of a magnetometer mx my mz",
    "rates": "rate_deg_s gx gy gz ax ay az axis_x axis_y axis_z t_s temperature_c n; of named sections path",
    "motion": "t_s vx_v vy_v displacement_m temperature_c supply_v",
}


@click.command("import")
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--kind", type=click.Choice(["poses", "positions", "motion", "still", "rates"]), help="Kind of table.")
@click.option(
    "--column", "mapped", multiple=True, metavar="NAME=THEIRS:UNIT", help="Our name for one of their columns."
)
@click.option("--constant", "given", multiple=True, metavar="KEY=VALUE", help="Such as gravity_m_s2=9.81744.")
@json_option
def command(file: Path, kind: str | None, mapped: tuple[str, ...], given: tuple[str, ...], as_json: bool) -> None:
    """Take FILE into the record. A raw log becomes the means of what it holds still.

    A column is named by the file's header, or by its number from 1 where there is none. At a terminal the program
    proposes what is not given, and asks.
    """
    from calibrations.importing.files import open_text_file
    from calibrations.importing.foreign import import_sheet, needs_mapping
    from calibrations.importing.sheet import read_sheet
    from calibrations.importing.units import ColumnMapping
    from rig.record import Record
    from rig.services.tables import averaged

    laid, columns, constants = (
        read_sheet(open_text_file(file)),
        [ColumnMapping.parse(m) for m in mapped],
        _constants(given),
    )
    if sys.stdin.isatty() and sys.stderr.isatty() and needs_mapping(laid, kind, columns):
        kind, columns = ask_mapping(laid, kind, columns, given)
    taken = import_sheet(laid, kind, columns, constants)
    table = averaged(taken.table, note)
    with Record.to_read() as record:
        run = record.add_table(table, taken.settings)
    if table.content == "positions" and {"ax", "mx"} <= set(table.columns):
        note("Its accelerometer is meant; with --constant triad=m its magnetometer is.")
    if as_json:
        names = [*table.columns, *table.labels]
        emit({"schema": "rig.import/1", "run": run, "kind": table.kind, "rows": table.n, "columns": names})
    else:
        click.echo(f"{run}: {table.n} rows of {table.kind} ({', '.join(table.columns)})")
        click.echo(f"Next: rig compare {run}")


def _constants(given: tuple[str, ...]) -> dict[str, str | float]:
    constants: dict[str, str | float] = {}
    for text in given:
        key, equals, value = text.partition("=")
        if not equals:
            raise click.UsageError(f'"{text}": a constant is given as KEY=VALUE, such as gravity_m_s2=9.81744')
        try:
            constants[key] = float(value)
        except ValueError:
            constants[key] = value
    return constants


# A person at a terminal says which column of a file is what; a proposal is there to be confirmed.


def ask_mapping(
    laid: Sheet, kind: str | None, mapped: Sequence[ColumnMapping], constants: Sequence[str]
) -> tuple[str, list[ColumnMapping]]:
    """The kind of table and the whole mapping, as the person confirms it; the command that repeats it is printed.

    Raises click.Abort where the person gives up.
    """
    note(f"{laid.name} has columns that are not called as here. Which is what?")
    if kind is None:
        kinds = click.Choice(sorted(CHOICES))
        told = "Held at known stage angles (poses), put down by hand (positions), turned (rates), or shaken (motion)"
        kind = str(click.prompt(told, default=likely_kind(laid, mapped), type=kinds, err=True))
    note(
        f"\nOur columns: {CHOICES.get(kind, '')}\nEnter takes what stands in brackets, {LEAVE} none; or type a column,"
    )
    note("with a unit where it is another (vx_v:mV), or a unit alone (mV).\n")
    whole = _columns(laid, kind, mapped)
    while lacking := missing_columns(kind, laid, whole):
        note(f"\nA table of {kind} needs {', '.join(lacking)} too. Once more:\n")
        whole = _columns(laid, kind, mapped)
    note(f"\nThe same again, without questions:\n    {import_command(laid, kind, whole, constants)}\n")
    return kind, whole


def _columns(laid: Sheet, kind: str, mapped: Sequence[ColumnMapping]) -> list[ColumnMapping]:
    """One question for each column that has no name of ours."""
    whole = list(mapped)
    proposals = {m.theirs: m for m in propose_mapping(laid, kind, mapped)}
    open_ones = [t for t, bare in zip(laid.header, laid.bare, strict=True) if bare not in NUMBERS]
    for theirs in open_ones:
        if theirs not in {m.theirs for m in mapped} and (m := _column(laid, theirs, proposals.get(theirs), whole)):
            whole.append(m)
    return whole


def _column(
    laid: Sheet, theirs: str, proposal: ColumnMapping | None, before: Sequence[ColumnMapping]
) -> ColumnMapping | None:
    """What a person calls one column; asked until it can be."""
    values = sample_values(laid, theirs)
    shown = f"{values.min():g} .. {values.max():g}" if len(values) else f'"{laid.sample[0][laid.header.index(theirs)]}"'
    default = proposal.text.partition("=")[0] + (f":{proposal.unit}" if proposal.unit else "") if proposal else LEAVE
    while True:
        answer = str(click.prompt(f"  {theirs:16} {shown:24}", default=default, err=True)).strip()
        try:
            return _understood(answer, theirs, proposal, before, laid.name)
        except DataError as error:
            note(f"    {error}")


def _understood(
    answer: str, theirs: str, proposal: ColumnMapping | None, before: Sequence[ColumnMapping], source: str
) -> ColumnMapping | None:
    """The column that `answer` means, None for none. Raises DataError."""
    if answer == LEAVE:
        return None
    if proposal is not None and parse_unit(answer) and answer not in NUMBERS:
        return check_unit(replace(proposal, unit=parse_unit(answer)), source)
    name, colon, unit = answer.partition(":")
    if name not in NUMBERS | {PATH}:
        raise DataError(f'"{name}" is none of our columns{nearest(name, " ".join(CHOICES.values()).split())}')
    if name in {m.name for m in before}:
        raise DataError(f"{name} is taken already")
    if colon and not parse_unit(unit):
        raise DataError(f'"{unit}" is no unit that is known here')
    return check_unit(ColumnMapping(name, theirs, parse_unit(unit)), source)
