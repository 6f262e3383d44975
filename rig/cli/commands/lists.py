"""The commands procedures, effects, models and runs: lists to choose from."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from calibrations.effects import Effect
from calibrations.text import columns
from rig.cli.terminal.complete import complete_effect, complete_procedure
from rig.cli.terminal.output import bench_option, emit, json_option, notes
from rig.services.request import effects_of

if TYPE_CHECKING:
    from rig.record import Run


@click.command("procedures")
@click.argument("procedure", required=False, shell_complete=complete_procedure)
@bench_option
@json_option
def procedures_command(procedure: str | None, bench_file: Path | None, as_json: bool) -> None:
    """List the shipped procedures and your own, with their purposes and settings; or one PROCEDURE."""
    from procedures.catalogue import find, paths
    from rig.bench import read_bench
    from rig.cli.terminal.settings_help import procedure_text

    folder = read_bench(bench_file).folders.procedures
    procedures = [find(name, folder) for name in ([procedure] if procedure else paths(folder))]
    if as_json:
        documents = [{"name": p.name, "summary": p.summary, "doc": p.doc, "settings": p.defaults} for p in procedures]
        emit({"schema": "rig.procedures/1", "procedures": documents})
    else:
        click.echo("\n\n".join(map(procedure_text, procedures)))


@click.command("effects")
@click.argument("effect", shell_complete=complete_effect, required=False)
@bench_option
@json_option
def effects_command(effect: str | None, bench_file: Path | None, as_json: bool) -> None:
    """List the catalogue of physical effects, or show one EFFECT in full.

    EFFECT may be a free form, free:PLACE: a smooth curve of unknown form at a place of the signal chain.
    """
    effects_by_name = effects_of(bench_file)

    def document(e: Effect) -> dict[str, object]:
        return {
            "effect": e.name,
            "acts_on": e.acts_on,
            "summary": e.summary,
            "formula": e.formula,
            "parameters": [
                {"name": p.name, "unit": p.unit, "per_axis": p.per_axis, "doc": p.doc} for p in e.parameters
            ],
            "symptom": e.symptom,
            "excited_by": e.excited_by,
            "confused_with": e.confused_with,
            "needs": list(e.needs),
            "kinds": list(e.kinds),
            "source": e.source,
        }

    listed = list(effects_by_name.values())
    if effect:
        from calibrations.free_forms.requested import resolve_effect  # slow to import; the list needs no free form

        listed = [resolve_effect(effect, effects_by_name)]
    if as_json:
        emit({"schema": "rig.effects/1", "effects": [document(e) for e in listed]})
    elif effect:
        from calibrations.compensation.forward import known_at_run_time

        e = listed[0]
        formula = e.formula.replace("{out}", "V").replace("\n", "\n    ")  # as docs/effects does for an output in V
        click.echo(f"{e.name}: {e.summary}\n\n    {formula}\n")
        parts = (("Symptom", e.symptom), ("Excited by", e.excited_by), ("Confused with", e.confused_with))
        further_parts = (("At run time", known_at_run_time(e)), ("Source", e.source))
        click.echo("\n".join(f"{title}: {text}" for title, text in (*parts, *further_parts) if text))
    else:
        click.echo(columns(("effect", "acts on", "description"), [(e.name, e.acts_on, e.summary) for e in listed]))


@click.command("models")
@json_option
def models_command(as_json: bool) -> None:
    """List the shipped models and their effects."""
    from calibrations.model.file import read_model, shipped_names

    models = [read_model(name) for name in shipped_names()]
    if as_json:
        emit({"schema": "rig.models/1", "models": [{"model": m.name, "effects": list(m.effects)} for m in models]})
    else:
        click.echo(columns(("model", "effects"), [(m.name, ", ".join(m.effects)) for m in models]))


@click.command("runs")
@json_option
def runs_command(as_json: bool) -> None:
    """List the runs of the record, newest first."""
    from rig.record import Record

    with Record.to_read() as record:
        runs, damaged = record.runs(), record.damaged_runs()
    notes(damaged)
    if as_json:
        emit({"schema": "rig.runs/1", "runs": [_run_document(run) for run in runs]})
    elif runs or damaged:
        rows = [(run.run, run.state, run.kind, run.extent, run.source) for run in runs]
        click.echo(columns(("run", "state", "kind", "holds", "source"), rows))
    else:
        click.echo("The record is empty. `rig run sweep` makes a run, `rig import FILE` stores a file.")


def _run_document(run: Run) -> dict[str, object]:
    return {
        "run": run.run,
        "procedure": run.procedure,
        "state": run.state,
        "poses": run.rows,
        "kind": run.kind,
        "settings": run.settings,
        "source": run.source,
        "created": run.created,
        "ended": run.ended,
    }
