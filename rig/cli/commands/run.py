"""run: run a procedure on the bench, guided or --unattended, and record it."""

from __future__ import annotations

from pathlib import Path

import click

from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import read_bench
from rig.cli.terminal.complete import complete_procedure
from rig.cli.terminal.options import PASS_ON, read_settings, settings_arguments
from rig.cli.terminal.output import bench_option, json_option, note, watch_options
from rig.cli.terminal.settings_help import ProcedureCommand
from rig.cli.terminal.watch import print_end, trace_option, watching
from rig.record import Record
from rig.record.push import push_after
from rig.runs.runner import start


@click.command("run", cls=ProcedureCommand, context_settings=PASS_ON)
@click.argument("procedure", shell_complete=complete_procedure)
@settings_arguments
@watch_options
@trace_option
@bench_option
@json_option
def command(
    procedure: str,
    given: tuple[str, ...],
    pairs: tuple[str, ...],
    unattended: bool,
    answers: Path | None,
    trace: bool,
    bench_file: Path | None,
    as_json: bool,
) -> int:
    """Run PROCEDURE on the bench and record it.

    Settings of the procedure are options: `rig run sweep --step-deg 30`. Ctrl-C stops the stages at once; in a terminal
    the program then asks whether to continue. `rig resume` continues later.
    """
    bench = read_bench(bench_file)
    found = find(procedure, bench.folders.procedures)
    settings = parse(found, read_settings(given, pairs, found.defaults))
    with Record() as record:
        with watching(found, bench, unattended, answers) as observer:
            outcome = start(record, bench, found, settings, observer, trace=trace)
        push_after(record, outcome.run, bench.lab, note)
        return print_end(record, outcome, as_json)
