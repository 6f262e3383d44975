"""effects: list the catalogue of physical effects, or show one."""

from __future__ import annotations

from pathlib import Path

import click

from calibrations.text import columns
from rig.cli.terminal.complete import complete_effect
from rig.cli.terminal.output import bench_option, emit, json_option


@click.command("effects")
@click.argument("effect", shell_complete=complete_effect, required=False)
@bench_option
@json_option
def command(effect: str | None, bench_file: Path | None, as_json: bool) -> None:
    """List the catalogue of physical effects, or show one EFFECT in full.

    EFFECT may be a free form, free:PLACE: a smooth curve of unknown form at a place of the signal chain.
    """
    from calibrations.effects import Effect
    from rig.services.request import effects_of

    known = effects_of(bench_file)

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

    shown = list(known.values())
    if effect:
        from calibrations.free_forms.requested import named  # slow to import; the list needs no free form

        shown = [named(effect, known)]
    if as_json:
        emit({"schema": "rig.effects/1", "effects": [document(e) for e in shown]})
    elif effect:
        from calibrations.compensation.forward import known_at_run_time

        e = shown[0]
        formula = e.formula.replace("{out}", "V").replace("\n", "\n    ")  # as docs/effects does for an output in V
        click.echo(f"{e.name}: {e.summary}\n\n    {formula}\n")
        parts = (("Symptom", e.symptom), ("Excited by", e.excited_by), ("Confused with", e.confused_with))
        more = (("At run time", known_at_run_time(e)), ("Source", e.source))
        click.echo("\n".join(f"{title}: {text}" for title, text in (*parts, *more) if text))
    else:
        click.echo(columns(("effect", "acts on", "description"), [(e.name, e.acts_on, e.summary) for e in shown]))
