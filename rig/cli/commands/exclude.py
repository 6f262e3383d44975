"""exclude: exclude a pose from every analysis, with a reason, or include it again."""

from __future__ import annotations

import click

from rig.cli.terminal.complete import complete_run
from rig.cli.terminal.output import emit, json_option


@click.command("exclude")
@click.argument("run", shell_complete=complete_run)
@click.argument("pose", type=click.IntRange(min=0))
@click.option("--reason", metavar="TEXT", help="The reason; the record stores it.")
@click.option("--include", is_flag=True, help="Include the pose again.")
@json_option
def command(run: str, pose: int, reason: str | None, include: bool, as_json: bool) -> None:
    """Exclude pose number POSE of RUN, or that row of an imported table, from every analysis.

    The pose stays in the record, with the reason and the date. The results of a complete run are computed again; an
    incomplete run measures the pose again on `rig resume`. `rig show RUN --poses` lists the numbers.
    """
    if include == bool(reason and reason.strip()):
        raise click.UsageError("give a reason (--reason TEXT), or include the pose again (--include)")
    from rig.record import Record
    from rig.services.exclusion import RESULTS, exclude
    from rig.services.next_steps import results_table

    with Record.to_find(run) as record:
        found = exclude(record, run, [pose], None if include else reason)
        run = found.run
        told = [event.text for event in record.events(run) if event.what == RESULTS]
    if as_json:
        said = None if include else reason
        emit({"schema": "rig.exclude/1", "run": run, "pose": pose, "excluded": said, "results": found.results})
        return
    state = "included again" if include else f"excluded: {reason}"
    after = [f"results: {told[-1]}", *results_table(found.results)] if found.state == "complete" and told else []
    if found.state != "complete" and not include:
        after = [f"Next: rig resume {run} measures it again"]
    click.echo("\n".join([f"{run}: pose {pose} {state}", *after]))
