"""run and resume: a procedure on the bench, guided or unattended."""

from __future__ import annotations

from pathlib import Path

import click

from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import Bench, read_bench
from rig.cli.terminal.complete import complete_procedure, complete_run
from rig.cli.terminal.options import PASS_ON, read_settings, settings_arguments
from rig.cli.terminal.output import bench_option, json_option, note, notes, watch_options
from rig.cli.terminal.settings_help import ProcedureCommand
from rig.cli.terminal.watch import print_end, trace_option, watching
from rig.record import Record
from rig.record.push import push_after
from rig.record.values import CHANGED
from rig.runs.runner import Outcome, resume, start


@click.command("run", cls=ProcedureCommand, context_settings=PASS_ON)
@click.argument("procedure", shell_complete=complete_procedure)
@settings_arguments
@watch_options
@trace_option
@bench_option
@json_option
def run_command(
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
    definition = find(procedure, bench.folders.procedures)
    settings = parse(definition, read_settings(given, pairs, definition.defaults))
    with Record() as record:
        with watching(definition, bench, unattended, answers) as observer:
            outcome = start(record, bench, definition, settings, observer, trace=trace)
        push_after(record, outcome.run, bench.lab, note)
        return print_end(record, outcome, as_json)


@click.command("resume")
@click.argument("run", shell_complete=complete_run)
@watch_options
@trace_option
@bench_option
@json_option
def resume_command(
    run: str, unattended: bool, answers: Path | None, trace: bool, bench_file: Path | None, as_json: bool
) -> int:
    """Continue RUN at its first missing pose, on the bench of its first part.

    With --bench, the run continues only if that bench file has not changed.
    """
    bench = read_bench(bench_file) if bench_file else None
    with Record.to_find(run, local_only=True) as record:
        interrupted = record.run(run)
        if interrupted.state == "complete":
            return print_end(record, Outcome(interrupted), as_json)
        run_bench = Bench.model_validate(interrupted.bench)
        with watching(
            find(interrupted.procedure, run_bench.folders.procedures), run_bench, unattended, answers
        ) as observer:
            outcome = resume(record, interrupted.run, observer, bench, trace)
        notes(f"program changed {event.text}" for event in record.events(interrupted.run) if event.what == CHANGED)
        push_after(record, outcome.run, (bench or run_bench).lab, note)
        return print_end(record, outcome, as_json)
