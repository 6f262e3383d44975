"""discover: add missing effects until no effect is missing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rig.cli.terminal.complete import complete_data
from rig.cli.terminal.options import request_options
from rig.cli.terminal.output import check_option, emit, model_option, note, notes, watch_options
from rig.cli.terminal.progress import working

if TYPE_CHECKING:
    from calibrations.discovery.dataset import Dataset
    from rig.services.load import Loaded
    from rig.services.request import Request


@click.command("discover")
@click.argument("data", nargs=-1, shell_complete=complete_data)
@model_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the final model to this file.")
@click.option("--without", multiple=True, metavar="PLACE", help="A place to leave out of the search; may be repeated.")
@click.option("--enough", metavar="ERROR", help="Stop at this error on unseen data: 0.5mg, 2mV or 1.5floors.")
@click.option("--all", "every", is_flag=True, help="Of a still record, also each step's error and every parameter.")
@click.option("--live", is_flag=True, help="Measure on the bench, and choose the next experiment.")
@click.option("--time", "minutes", type=click.FloatRange(min=0, min_open=True), help="Rig time for --live, minutes.")
@watch_options
@check_option
@request_options
def command(
    request: Request,
    several: tuple[str, ...],
    out: Path | None,
    without: tuple[str, ...],
    enough: str | None,
    every: bool,
    live: bool,
    minutes: float | None,
    unattended: bool,
    answers: Path | None,
    check: bool,
    as_json: bool,
) -> int:
    """Diagnose DATA (a file or a run, or several together) and add effects until no effect is missing.

    With --live there is no DATA: the program measures in steps until more data do not change the result, or until
    the time is over (default: the duration of the standard sweep).

    In poses the search first finds the places of the signal chain that act, with curves of unknown form, and then
    names the effects of the catalogue that are their causes. A curve without a cause stays in the model as
    `free:PLACE`. --without PLACE leaves out a place, with the effects that act there: own-response, history, output,
    column:NAME and so on (a wrong name lists all), or geometry.

    Effects are added the largest first. --enough ERROR stops at the first model whose error on unseen data is that
    small, and names the effects that it leaves out.
    """
    if live:
        from rig.cli.terminal.live import discover_live

        if several:
            raise click.UsageError("--live measures its own data; remove DATA or --live")
        if without or enough:
            raise click.UsageError(f"--{'without' if without else 'enough'} is for measured DATA; remove it or --live")
        return discover_live(request, out, minutes, unattended, answers, check, as_json)
    if not several:
        raise click.UsageError("give DATA (a file or a run), or --live to measure")
    return _discover(request, several, out, without, enough, every, check, as_json)


def _discover(
    request: Request,
    several: tuple[str, ...],
    out: Path | None,
    without: tuple[str, ...],
    enough: str | None,
    every: bool,
    check: bool,
    as_json: bool,
) -> int:
    from calibrations.discovery.enough import parse_enough
    from calibrations.discovery.verdict import Verdict
    from calibrations.documents import discovery_document
    from rig.cli.terminal.words import (
        discovery,
        own_effect,
        parameters,
        pattern_advice,
        planned,
        short_discovery,
        warning,
    )
    from rig.services.load import loaded

    small = parse_enough(enough) if enough else None
    with working("fitting the model") as progress:
        question = loaded(request, note, out)
        data = question.data if len(several) == 1 else _together(several, request, question)
        data = data.without(without)
        found = data.discover(question.model, progress.searched(question.effects), small)
        progress.text = "planning the next experiment"
        result = planned(found, request, question.effects)
    path = None
    if out is not None:
        from rig.services.provenance import write_model

        path = write_model(data, result.end, question.model, out, note)
    reached = str(path) if path else request.model or question.model.name
    own = (result.pattern if len(several) == 1 else None, reached, request)
    if as_json:
        emit(discovery_document(result, str(path) if path else None) | {"own_effect": own_effect(*own)})
        notes(warning([result.caution]))
    else:
        short = data.form == "samples" and not every
        if short:
            click.echo(f"{data.description}\n{short_discovery(result)}")
        else:
            lines = "\n".join([discovery(result), *pattern_advice(*own)])
            click.echo(f"{data.description}\n\n{lines}\n\n{parameters(result.end.model)}")
        if path is not None:
            click.echo(f"written: {path}" if short else f"\nwritten: {path}")
    return int(result.verdict is Verdict.NO_RESPONSE or (check and result.verdict is not Verdict.ADEQUATE))


def _together(several: tuple[str, ...], request: Request, question: Loaded) -> Dataset[Any]:
    """Several data sets as one table."""
    from calibrations.discovery.rows import Rows
    from rig.services.load import with_known_noise
    from rig.services.tables import load_all

    if question.data.form != "rows":
        raise click.UsageError("still records are analysed one at a time; give one")
    return Rows(with_known_noise(load_all(several, note), request.noise, question.effects))
