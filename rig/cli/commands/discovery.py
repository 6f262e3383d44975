"""compare, diagnose, add and discover: from a model that fails to one that is complete."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from rig.cli.terminal.complete import complete_data, complete_effect, complete_model
from rig.cli.terminal.options import DataCommand, request_options
from rig.cli.terminal.output import (
    check_option,
    emit,
    model_option,
    note,
    notes,
    out_option,
    verdict_status,
    watch_options,
)
from rig.cli.terminal.progress import working

if TYPE_CHECKING:
    from calibrations.discovery.dataset import Dataset
    from calibrations.discovery.patterns import Pattern
    from calibrations.discovery.results import Diagnosis, Discovery
    from calibrations.effects import Effect
    from rig.services.load import AnalysisInput
    from rig.services.request import Request


@click.command("compare", cls=DataCommand)
@click.argument("data", shell_complete=complete_data)
@model_option
@check_option
@request_options
def compare_command(request: Request, check: bool, as_json: bool) -> int:
    """Compare a model with DATA (a file or a run), and show where it fails. A model without values is fitted first."""
    from calibrations.discovery.verdict import Verdict
    from calibrations.documents import comparison_document
    from rig.cli.terminal.words import warning
    from rig.services.load import load_request

    with working("fitting the model"):
        question = load_request(request, note)
        result = question.data.compare(question.model, question.effects)
        name, cautions = request.model or question.model.name, question.data.cautions(result.fit)
    if as_json:
        emit(comparison_document(result, name))
        notes(warning(cautions))
    else:
        click.echo(result.report())
        if result.rejection is None and not result.adequate:
            command = shlex.join(["rig", "diagnose", request.data, "--model", name])
            click.echo(f"\nTo find the missing effect: {command}")
        for line in filter(None, (question.data.note, *warning(cautions))):
            click.echo(f"\n{line}")
    silent = result.rejection is not None and result.rejection.verdict == Verdict.NO_RESPONSE
    undetermined = question.data.undetermined(result.fit) is not None
    return int(silent or (check and (not result.adequate or undetermined)))


@click.command("diagnose", cls=DataCommand)
@click.argument("data", shell_complete=complete_data)
@model_option
@check_option
@request_options
def diagnose_command(request: Request, check: bool, as_json: bool) -> int:
    """Find the physical effect that a model misses on DATA (a file or a run)."""
    from calibrations.discovery.verdict import Verdict
    from calibrations.documents import diagnosis_document
    from rig.cli.terminal.words import own_effect, pattern_advice, warning, with_planned_experiment
    from rig.services.load import load_request

    with working("fitting the model") as progress:
        question = load_request(request, note)
        result = question.data.diagnose(question.model, progress.searched(question.effects))
        progress.text = "planning the next experiment"
        result = with_planned_experiment(result, request, question.effects)
    if (untestable := question.data.untestable(result.fit, question.effects)) is not None:
        note(untestable)
    if result.verdict is not Verdict.NO_RESPONSE:
        notes(warning(question.data.doubts(result.fit)))
    name = request.model or question.model.name
    if as_json:
        own_effect_name = own_effect(result.pattern, name, request)
        emit(diagnosis_document(result, name) | {"own_effect": own_effect_name})
        notes(warning([result.caution]))
    else:
        click.echo("\n".join([_diagnosis_text(result, name, request), *pattern_advice(result.pattern, name, request)]))
    return verdict_status(result.verdict, check)


def _diagnosis_text(result: Diagnosis[Any], model: str, request: Request) -> str:
    from calibrations.presentation.answers import diagnosis_text
    from rig.cli.terminal.words import experiment

    data = result.findings.data
    lines = [diagnosis_text(result, model), ""]
    if result.missing:
        best = result.candidates[0]
        words = ["rig", "add", best.name, "--model", model, "--data", request.data, "--out", "model.yaml"]
        lines.append(f"Add it: {shlex.join(words)}{request.bench_words}")
    if data.note:
        lines += ["", data.note]
    if result.next_experiment:
        lines += experiment(result.next_experiment, request.data)
    return "\n".join(lines).rstrip()


NAME = re.compile(r"[A-Za-z0-9_-]+")  # no useful expression looks like this


@click.command("add")
@click.argument("effect", shell_complete=complete_effect)
@click.option("--name", help="Name of an effect given as an expression.")
@click.option("--model", required=True, shell_complete=complete_model, help="A shipped model by name, or a model file.")
@click.option("--data", required=True, shell_complete=complete_data, help="A file or a run.")
@out_option("The new model file.", required=True)
@request_options
def add_command(request: Request, effect: str, name: str | None, out: Path, as_json: bool) -> int:
    """Add EFFECT to a model, fit both models to the data, and write the new model. The old model file stays.

    EFFECT is a name in the catalogue (`rig effects`), a free form (free:PLACE, such as free:own-response: a smooth
    curve whose size the data show), a Python file of your own (my_effect.py), or, with --name, an expression such as
    "a*sin(5*beta) + b*cos(5*beta)" or "beta_deg += a*sin(5*beta)". In an expression alpha, beta and mount are in rad,
    ax, ay, az in g, t in s, temperature in C, supply in V; direction, flip and other columns of the data have their
    own names; every other name is a parameter. The model file contains the expression.
    """
    from calibrations.documents import discovery_document
    from rig.cli.terminal.words import addition, parameters, warning, with_planned_experiment
    from rig.services.load import load_request
    from rig.services.provenance import write_model

    with working("fitting both models") as progress:
        question = load_request(request, note)
        new_effect = _find_effect(effect, name, question)
        effects = question.effects if effect.startswith("free:") else {**question.effects, new_effect.name: new_effect}
        result = question.data.add(new_effect, question.model, progress.searched(effects))
        progress.text = "planning the next experiment"
        result = with_planned_experiment(result, request, question.effects)
    path = write_model(question.data, result.end, question.model, out, note)
    if as_json:
        emit(discovery_document(result, str(path) if path else None))
        notes(warning([result.caution]))
    else:
        text = addition(result, request.data, out)
        click.echo(f"{new_effect.name} added to {question.model.name}\n\n{text}\n\n{parameters(result.end.model)}\n")
        if path is not None:
            click.echo(f"written: {path}")
    if effect.endswith(".py"):
        note(
            f"{out} refers to {new_effect.name} but does not contain it: "
            f"keep {effect} in the effects folder of the bench"
        )
    return verdict_status(result.verdict)


def _find_effect(effect: str, name: str | None, question: AnalysisInput) -> Effect:
    """The effect by name, from an expression or from a file. Raises UnknownName, ModelError, ExpressionError."""
    from calibrations.effects.catalogue import read_effect
    from calibrations.errors import ModelError
    from calibrations.free_forms.place_names import PREFIX
    from calibrations.free_forms.requested import resolve_effect

    if effect.startswith(PREFIX):
        return resolve_effect(effect, question.effects)
    if name is not None:
        if name in question.effects:
            raise ModelError(f"{name} is already in the catalogue (`rig effects {name}`); give yours another name")
        return question.data.expression(name, effect)
    if effect.endswith(".py"):
        return read_effect(Path(effect))
    if effect not in question.effects and not NAME.fullmatch(effect):
        raise ModelError(f'there is no effect "{effect}"; if this is an expression, give it a name: --name my-effect')
    return resolve_effect(effect, question.effects)


@click.command("discover", cls=DataCommand)
@click.argument("data", nargs=-1, shell_complete=complete_data)
@model_option
@out_option("Write the final model to this file.")
@click.option("--without", multiple=True, metavar="PLACE", help="A place to leave out of the search; may be repeated.")
@click.option("--enough", metavar="ERROR", help="Stop at this error on unseen data: 0.5mg, 2mV or 1.5floors.")
@click.option("--all", "every", is_flag=True, help="Of a still record, also each step's error and every parameter.")
@click.option("--live", is_flag=True, help="Measure on the bench, and choose the next experiment.")
@click.option("--time", "minutes", type=click.FloatRange(min=0, min_open=True), help="Rig time for --live, minutes.")
@watch_options
@check_option
@request_options
def discover_command(
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
    from rig.cli.terminal.words import warning

    answer = _discover(request, several, out, without, enough)
    if as_json:
        emit(answer.document)
        notes(warning([answer.discovery.caution]))
    else:
        click.echo(answer.text(every))
    return verdict_status(answer.discovery.verdict, check)


@dataclass(frozen=True)
class _Answer:
    """A discovery, the file with its model, and what an effect of your own needs: pattern, model and data."""

    discovery: Discovery[Any]
    path: Path | None
    own: tuple[Pattern | None, str, Request]

    @property
    def document(self) -> dict[str, Any]:
        """`rig.discovery/1`."""
        from calibrations.documents import discovery_document
        from rig.cli.terminal.words import own_effect

        return discovery_document(self.discovery, str(self.path) if self.path else None) | {
            "own_effect": own_effect(*self.own)
        }

    def text(self, whole_text: bool) -> str:
        """Text for a terminal; of a still record only the short form, or all of it with `whole_text`."""
        from rig.cli.terminal.words import discovery, parameters, pattern_advice, short_discovery

        data = self.discovery.findings.data
        path_lines = [f"written: {self.path}"] if self.path else []
        if data.form == "samples" and not whole_text:
            return "\n".join([data.description, short_discovery(self.discovery), *path_lines])
        lines = "\n".join([discovery(self.discovery), *pattern_advice(*self.own)])
        return "\n\n".join([data.description, lines, parameters(self.discovery.end.model), *path_lines])


def _discover(
    request: Request, several: tuple[str, ...], out: Path | None, left_out: tuple[str, ...], enough: str | None
) -> _Answer:
    from rig.cli.terminal.words import with_planned_experiment
    from rig.services.load import load_request

    small = None
    if enough:
        from calibrations.discovery.enough import parse_enough

        small = parse_enough(enough)
    with working("fitting the model") as progress:
        question = load_request(request, note)
        data = question.data if len(several) == 1 else _join_data(several, request, question)
        data = data.without(left_out)
        discovered = data.discover(question.model, progress.searched(question.effects), small)
        progress.text = "planning the next experiment"
        result = with_planned_experiment(discovered, request, question.effects)
    path = None
    if out is not None:
        from rig.services.provenance import write_model

        path = write_model(data, result.end, question.model, out, note)
    reached = str(path) if path else request.model or question.model.name
    return _Answer(result, path, (result.pattern if len(several) == 1 else None, reached, request))


def _join_data(several: tuple[str, ...], request: Request, question: AnalysisInput) -> Dataset[Any]:
    """Several data sets as one table."""
    from calibrations.discovery.rows import Rows
    from rig.services.load import with_known_noise
    from rig.services.tables import load_all

    if question.data.form != "rows":
        raise click.UsageError("still records are analysed one at a time; give one")
    return Rows(with_known_noise(load_all(several, note), request.noise, question.effects))
