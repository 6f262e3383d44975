"""import: take a file into the record as a run."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from rig.cli.terminal.output import emit, json_option, note


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
    from rig.services.data import averaged

    laid, columns, constants = (
        read_sheet(open_text_file(file)),
        [ColumnMapping.parse(m) for m in mapped],
        _constants(given),
    )
    if sys.stdin.isatty() and sys.stderr.isatty() and needs_mapping(laid, kind, columns):
        from rig.cli.terminal.mapping import ask_mapping

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
