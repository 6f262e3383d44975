"""demo: a calibration on the simulated rig: sweep, compare, diagnose, add, report."""

from __future__ import annotations

from pathlib import Path

import click

from rig.cli.terminal.output import emit, json_option, note


@click.command("demo")
@click.option(
    "--folder",
    default="rig-demo",
    show_default=True,
    type=click.Path(file_okay=False, path_type=Path),
    help="Folder for the model and the report.",
)
@json_option
def command(folder: Path, as_json: bool) -> None:
    """Sweep a simulated sensor, find the effects that its linear model misses, add them, and write a report."""
    from calibrations.documents import discovery_document
    from calibrations.loop import compare, discover
    from calibrations.model.file import read_model
    from calibrations.presentation.charts.discovery import album
    from calibrations.presentation.report.report import report
    from procedures.catalogue import find
    from procedures.settings import parse
    from rig.bench import read_bench
    from rig.cli.terminal.watch import watching
    from rig.cli.terminal.words import discovery
    from rig.cli.terminal.words import table as shown
    from rig.files import make_folder, program, write_whole
    from rig.record import Record
    from rig.runs.runner import start
    from rig.services.provenance import today, write_model
    from rig.services.tables import load

    make_folder(folder)
    note("1  Sweep: both stages move a simulated ADXL203 through 518 poses, over the protocols of the instruments.")
    sweep, bench = find("sweep"), read_bench()
    with watching(sweep, bench, False, None) as observer, Record() as record:
        outcome = start(record, bench, sweep, parse(sweep, {}), observer)
    if outcome.error is not None:
        raise outcome.error
    run = outcome.run.run
    table, linear = load(run), read_model("linear")

    note("2  Compare: the linear model of the manufacturer and the measurement.")
    comparison = compare(table, linear)
    places = "\n".join(f"   {place.text}" for place in comparison.fails[:3])
    note(f"\n{shown(comparison.data.error_table(comparison.fit))}\n\n{places}\n")

    note("3  Diagnose and add until no effect is missing.\n")
    discovery_result = discover(table, linear)
    model, page = folder / "model.yaml", folder / "report.html"
    write_model(discovery_result.end, linear, model, note)
    write_whole(page, report(discovery_result, comparison, today(), program(), album(discovery_result, comparison)))
    if as_json:
        emit({**discovery_document(discovery_result, str(model)), "run": run, "report": str(page)})
        return
    click.echo(discovery(discovery_result))
    click.echo(f"\n4  Report: {page} shows where the model failed and how the error fell; {model} is the new model.\n")
    click.echo(f"The run is {run}. Try: rig diagnose {run}, rig effects, rig import YOUR.csv")
