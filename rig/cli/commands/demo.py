"""demo: find three hidden faults of a simulated sensor, and compare them with the true ones."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.terminal.output import FOLDER, emit, force_option, json_option, note, require_outputs
from rig.cli.terminal.progress import working
from rig.files import make_folder, program, write_whole
from rig.services.request import effects_of

if TYPE_CHECKING:
    from rig.bench import Bench
    from rig.cli.terminal.progress import Progress
    from rig.record import KeptPose
    from rig.runs.observer import Observer

SETTINGS = {"inclinations_deg": "90,30,150,60", "step_deg": "30"}  # 104 poses show the three faults
MEASURING_SHARE = 0.4  # share of the bar


@click.command("demo")
@click.option(
    "--folder",
    type=FOLDER,
    help="Folder for the model and the report. Default: rig-demo, or rig-demo-realistic.",
)
@force_option
@click.option("--realistic", is_flag=True, help="The default rig with all its faults at once; takes minutes.")
@json_option
def demo_command(folder: Path | None, realistic: bool, as_json: bool) -> None:
    """Measure a simulated sensor with three hidden faults, find them, and compare them with the true ones.

    --realistic uses the default simulated rig: a standard sweep of 518 poses, and all faults at once.
    """
    from calibrations.documents import discovery_document
    from calibrations.loop import compare, discover
    from calibrations.model.file import read_model
    from calibrations.presentation.charts.discovery import album
    from calibrations.presentation.report.report import report
    from rig.bench import read_bench
    from rig.bench.file import DEMO
    from rig.cli.terminal.words import discovery
    from rig.services.hidden_faults import hidden_faults
    from rig.services.provenance import today, write_model
    from rig.services.tables import load

    folder = folder or Path("rig-demo-realistic" if realistic else "rig-demo")
    make_folder(folder)
    model, page = folder / "model.yaml", folder / "report.html"
    require_outputs(model, page)
    bench, settings = (read_bench(), {}) if realistic else (read_bench(DEMO), SETTINGS)
    note(
        "The default simulated rig: all its faults act at once. The analysis does not know them."
        if realistic
        else "A simulated sensor has three hidden faults. The analysis does not know them."
    )
    with working("starting; the first time takes a minute", 0.0) as progress:
        run = _measure(bench, settings, progress)
        progress.share = MEASURING_SHARE
        table, linear = load(run), read_model("linear")
        discovered = discover(table, linear, progress.searched(effects_of(None)))
        progress.text, progress.share = "writing the report", 0.9
        faults = hidden_faults(bench, discovered.end, discovered.start)
        comparison = compare(table, linear)
        write_whole(page, report(discovered, comparison, today(), program(), album(discovered, comparison)))
    write_model(discovered.findings.data, discovered.end, linear, model, note)
    if as_json:
        document = discovery_document(discovered, str(model))
        emit({**document, "run": run, "report": str(page), "hidden_faults": faults.document()})
        return
    click.echo(f"{discovery(discovered)}\n\nHidden faults and named causes (rms change of the output):\n")
    click.echo(faults.text())
    click.echo(f"\nReport: {page}   open it with: xdg-open {page}\nModel:  {model}\nRun:    {run}")
    click.echo(
        "The same in a browser: rig web"
        + ("" if realistic else "\nWith all faults of the default rig at once: rig demo --realistic")
    )


def _measure(bench: Bench, settings: Mapping[str, str], progress: Progress) -> str:
    """The id of a sweep on the bench. Raises the error that ended it."""
    from procedures.catalogue import find
    from procedures.settings import parse
    from rig.record import Record
    from rig.runs.runner import start

    sweep = find("sweep")
    with Record() as record:
        outcome = start(record, bench, sweep, parse(sweep, dict(settings)), _watch(progress))
    if outcome.error is not None:
        raise outcome.error
    return outcome.run.run


def _watch(progress: Progress) -> Observer:
    """The observer of the demonstration's sweep: it moves the bar."""
    from rig.runs.observer import Observer

    class Bar(Observer):
        total, done = 1, 0

        def expect(self, total: int, recorded_poses: int) -> None:
            self.total, self.done = max(total, 1), recorded_poses

        def kept(self, recorded: KeptPose) -> None:  # noqa: ARG002
            self.done += 1
            progress.text = f"measuring, {self.done} of {self.total} poses"
            progress.share = MEASURING_SHARE * self.done / self.total

    return Bar()
