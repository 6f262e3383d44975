"""discover: add missing effects until none is missing."""

from __future__ import annotations

from pathlib import Path

import click

from rig.cli.output import (
    Sampled,
    bench_option,
    check_option,
    emit,
    json_option,
    model_option,
    noise_option,
    note,
    notes,
    sampled_options,
)
from rig.cli.watch import watch_options


@click.command("discover")
@click.argument("data", nargs=-1)
@model_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the final model to this file.")
@click.option("--live", is_flag=True, help="Measure on the bench, and choose what to measure next.")
@click.option("--time", "minutes", type=click.FloatRange(min=0, min_open=True), help="Rig time for --live, minutes.")
@watch_options
@check_option
@bench_option
@noise_option
@sampled_options
@json_option
def command(
    data: tuple[str, ...],
    model: str | None,
    out: Path | None,
    live: bool,
    minutes: float | None,
    unattended: bool,
    answers: Path | None,
    check: bool,
    bench_file: Path | None,
    as_json: bool,
    noise: str | None,
    sampled: Sampled,
) -> int:
    """Diagnose and add until nothing is missing on DATA (a file or a run; several are judged together).

    With --live there is no DATA: it is measured, little by little, until one explanation stands or the time is used up
    (without --time: as long as the standard sweep takes).
    """
    if live:
        from rig.cli.live import discover_live

        if data:
            raise click.UsageError("--live measures its own data; leave out DATA, or --live")
        return discover_live(model, out, minutes, unattended, answers, check, bench_file, as_json)
    if not data:
        raise click.UsageError("name DATA (a file or a run), or --live to measure it")
    from rig.cli.still import of_still, told_discover

    if (still := of_still(data[0], model, bench_file, sampled, out, noise=noise)) is not None:
        if len(data) > 1:
            raise click.UsageError("still records are judged one at a time; name one")
        return told_discover(still, out, bench_file, check, as_json, data[0])
    return _discover(data, model, out, check, bench_file, as_json, noise)


def _discover(
    data: tuple[str, ...],
    model: str | None,
    out: Path | None,
    check: bool,
    bench_file: Path | None,
    as_json: bool,
    noise: str | None,
) -> int:
    from calibrations.discover import discover
    from calibrations.documents import discovery_document
    from rig.analysis.asked import with_known_noise
    from rig.analysis.several import load_all
    from rig.cli.asked import asked, write_model
    from rig.cli.own_effect import own_effect, told
    from rig.cli.words import discovery, parameters, warning
    from rig.planning.foresight import with_next

    table, start, effects = asked(data[0], model, bench_file, out, noise)
    table = with_known_noise(load_all(data, note), noise, effects) if len(data) > 1 else table
    result = discover(table, start, effects)
    result = with_next(result, data[0], effects, bench_file, note)
    if out is not None:
        write_model(result.end, start, out)
    reached = str(out) if out else model or start.name
    own = (result.pattern if len(data) == 1 else None, reached, data[0], bench_file)
    if as_json:
        emit(discovery_document(result, str(out) if out else None) | {"own_effect": own_effect(*own)})
        notes(warning(result.caution))
    else:
        lines = "\n".join([discovery(result), *told(*own)])
        click.echo(f"{table.n} rows of {table.source}\n\n{lines}\n\n{parameters(result.end.model)}")
        if out is not None:
            click.echo(f"\nwritten to {out}")
    return 1 if check and result.verdict != "adequate" else 0
