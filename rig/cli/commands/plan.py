"""plan: dry run of a procedure: every move, its limits, duration; touches nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from calibrations.presentation.text import duration, size
from drivers.errors import LimitError
from procedures.catalogue import Procedure, find
from procedures.errors import SafetyLimit
from procedures.pose_list import format_poses
from procedures.settings import parse
from rig.bench import Bench, read_bench
from rig.cli.terminal.output import bench_option, emit, json_option, model_option
from rig.cli.terminal.settings import PASS_ON, read_settings, settings_arguments
from rig.errors import BeyondLimits
from rig.planning.plan import Plan, Stretch, plan, stretches

FEW_STEPS = 120  # that are read through rather than summed up
HEAD, TAIL = 14, 4  # stretches of a long plan that are shown


@contextmanager
def _nothing_stopped() -> Iterator[None]:
    """What a run would be stopped for is bad input here: a plan moves nothing."""
    try:
        yield
    except (LimitError, SafetyLimit) as refused:
        raise BeyondLimits(str(refused)) from None


@click.command("plan", context_settings=PASS_ON)
@click.argument("procedure")
@settings_arguments
@click.option("--moves", is_flag=True, help="Every move and every record, however many.")
@click.option("--optimal", is_flag=True, help="Of a sweep: poses chosen for --model, beside the standard ones.")
@model_option
@click.option("--poses", type=int, help="How many to choose, at most 60. Default: a quarter.")
@click.option("--criterion", type=click.Choice(["D", "I"]), help="D: joint uncertainty; I, the default: prediction.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the poses to this file.")
@bench_option
@json_option
@_nothing_stopped()
def command(
    procedure: str,
    given: tuple[str, ...],
    pairs: tuple[str, ...],
    moves: bool,
    optimal: bool,
    model: str | None,
    poses: int | None,
    criterion: str | None,
    out: Path | None,
    bench_file: Path | None,
    as_json: bool,
) -> None:
    """Print every move that PROCEDURE would make, the limits it stays within, and how long it takes.

    A long plan is summed up; --moves prints all of it. Settings of the procedure are options: `rig plan sweep
    --step-deg 30`. Nothing is touched. --out writes the poses, for `rig run sweep --pose-list`.

    --optimal chooses the poses of a sweep for a model, so that it takes less time to know as much. The settings are
    those of the standard sweep beside it, whose range the chosen poses have.
    """
    bench = read_bench(bench_file)
    found = find(procedure, bench.folders.procedures)
    settings = parse(found, read_settings(given, pairs, found.defaults))
    if optimal:
        _optimal(bench, found, settings, Asked(model, poses, criterion, out, bench_file, as_json))
        return
    if model or poses or criterion:
        raise click.UsageError("--model, --poses and --criterion go with --optimal")
    planned = plan(bench, found, settings)
    if out is not None:
        _write_poses(out, planned)
    if as_json:
        emit(_document(planned))
        return
    whole = moves or len(planned.steps) <= FEW_STEPS
    click.echo("\n".join([*(_steps(planned) if whole else _summary(planned)), "", *_end(planned)]))


@dataclass(frozen=True)
class Asked:
    """What is asked of chosen poses; None where nothing is said."""

    model: str | None
    poses: int | None
    criterion: str | None
    out: Path | None
    bench_file: Path | None
    as_json: bool


def _optimal(bench: Bench, procedure: Procedure, settings: Mapping[str, Any], asked: Asked) -> None:
    """Choose poses for a model, and print them beside the standard sweep. Raises UsageError for what is no sweep."""
    from calibrations.effects.catalogue import catalogue
    from calibrations.model.file import read_model
    from rig.cli.terminal.chosen import document, lines
    from rig.planning.optimal import optimal as chosen

    if procedure.name != "sweep" or settings["pose_list"]:
        raise click.UsageError("--optimal chooses the poses of a sweep over a grid")
    model = read_model(asked.model or "linear", catalogue(bench.folders.effects))
    found = chosen(bench, procedure, settings, model, asked.poses, asked.criterion or "I")
    if asked.out is not None:
        _write_poses(asked.out, found.equal.plan)
    if asked.as_json:
        emit(_document(found.equal.plan) | {"optimal": document(found)})
    else:
        files = (str(path) if path else None for path in (asked.out, asked.bench_file))
        click.echo("\n".join(lines(found, *files)))


def _write_poses(out: Path, planned: Plan) -> None:
    from rig.files import write_whole

    write_whole(out, "\n".join([*format_poses(held.pose for held in planned.held), ""]))


def _steps(planned: Plan) -> list[str]:
    return [f"{duration(step.start_s):>9}  {step.what}" for step in planned.steps]


def _summary(planned: Plan) -> list[str]:
    """The stretches, the middle ones of very many left out, and how to see all."""
    lines = [line for stretch in stretches(planned) for line in _lines(stretch)]
    left_out = len(lines) - HEAD - TAIL
    if left_out > 1:
        lines[HEAD:-TAIL] = [f"{'...':>9}  {left_out} lines like these"]
    return [*lines, f"Each of its {len(planned.steps)} moves and records: the same command with --moves"]


def _lines(stretch: Stretch) -> list[str]:
    before = [f"{'':>9}  {', '.join(stretch.also)}, then"] if stretch.also else []
    return [*before, f"{duration(stretch.start_s):>9}  {stretch.words}"]


def _end(planned: Plan) -> list[str]:
    """What it asks a person, how far the stages turn, how long it takes and what it leaves on the disk."""
    asked = [f"asks  {question}" for question in planned.questions]
    reach = [
        f"{role} from {low:g} to {high:g} deg, within its limits {least:g} to {most:g} deg"
        for role, ((low, high), (least, most)) in planned.reach.items()
    ]
    total = f"{planned.poses} poses in {duration(planned.duration_s)}, {size(planned.bytes)} on the disk"
    return [*asked, *reach, total]


def _document(planned: Plan) -> dict[str, object]:
    return {
        "schema": "rig.plan/1",
        "procedure": planned.procedure,
        "settings": dict(planned.settings),
        "poses": planned.poses,
        "duration_s": planned.duration_s,
        "bytes": planned.bytes,
        "questions": list(planned.questions),
        "reach": {role: {"deg": reach, "limits_deg": limits} for role, (reach, limits) in planned.reach.items()},
        "stretches": [
            {"start_s": s.start_s, "poses": len(s.poses), "what": s.words, "before": list(s.also)}
            for s in stretches(planned)
        ],
        "steps": [{"start_s": s.start_s, "duration_s": s.duration_s, "what": s.what} for s in planned.steps],
    }
