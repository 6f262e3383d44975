"""discover: add missing effects until none is missing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.output import check_option, emit, model_option, note, notes
from rig.cli.request import request_options
from rig.cli.watch import watch_options

if TYPE_CHECKING:
    from rig.analysis.request import Request


@click.command("discover")
@click.argument("data", nargs=-1)
@model_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the final model to this file.")
@click.option("--live", is_flag=True, help="Measure on the bench, and choose what to measure next.")
@click.option("--time", "minutes", type=click.FloatRange(min=0, min_open=True), help="Rig time for --live, minutes.")
@watch_options
@check_option
@request_options
def command(
    request: Request,
    several: tuple[str, ...],
    out: Path | None,
    live: bool,
    minutes: float | None,
    unattended: bool,
    answers: Path | None,
    check: bool,
    as_json: bool,
) -> int:
    """Diagnose and add until nothing is missing on DATA (a file or a run; several are judged together).

    With --live there is no DATA: it is measured, little by little, until one explanation stands or the time is used up
    (without --time: as long as the standard sweep takes).
    """
    if live:
        from rig.cli.live import discover_live

        if several:
            raise click.UsageError("--live measures its own data; leave out DATA, or --live")
        return discover_live(request, out, minutes, unattended, answers, check, as_json)
    if not several:
        raise click.UsageError("name DATA (a file or a run), or --live to measure it")
    from rig.cli.still import of_still, told_discover

    if (still := of_still(request, out)) is not None:
        if len(several) > 1:
            raise click.UsageError("still records are judged one at a time; name one")
        return told_discover(still, request, out, check, as_json)
    return _discover(request, several, out, check, as_json)


def _discover(request: Request, several: tuple[str, ...], out: Path | None, check: bool, as_json: bool) -> int:
    from calibrations.discover import discover
    from calibrations.documents import discovery_document
    from rig.analysis.asked import with_known_noise
    from rig.analysis.several import load_all
    from rig.cli.asked import asked, write_model
    from rig.cli.own_effect import own_effect, told
    from rig.cli.words import discovery, parameters, warning
    from rig.planning.foresight import with_next

    table, start, effects = asked(request, out)
    table = with_known_noise(load_all(several, note), request.noise, effects) if len(several) > 1 else table
    result = with_next(discover(table, start, effects), request.data, effects, request.bench_file, note)
    if out is not None:
        write_model(result.end, start, out)
    reached = str(out) if out else request.model or start.name
    own = (result.pattern if len(several) == 1 else None, reached, request)
    if as_json:
        emit(discovery_document(result, str(out) if out else None) | {"own_effect": own_effect(*own)})
        notes(warning(result.caution))
    else:
        lines = "\n".join([discovery(result), *told(*own)])
        click.echo(f"{table.n} rows of {table.source}\n\n{lines}\n\n{parameters(result.end.model)}")
        if out is not None:
            click.echo(f"\nwritten to {out}")
    return 1 if check and result.verdict != "adequate" else 0
