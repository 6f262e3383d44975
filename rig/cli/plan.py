"""plan: dry run of a procedure: every move, its limits, duration; touches nothing."""

from __future__ import annotations

from pathlib import Path

import click

from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import read_bench
from rig.cli.output import bench_option, duration, emit, json_option, size
from rig.cli.settings import PASS_ON, read_settings, settings_arguments
from rig.plan import Plan, plan
from rig.stretches import Stretch, stretches

FEW_STEPS = 120  # that are read through rather than summed up
HEAD, TAIL = 14, 4  # stretches of a long plan that are shown


@click.command("plan", context_settings=PASS_ON)
@click.argument("procedure")
@settings_arguments
@click.option("--moves", is_flag=True, help="Every move and every record, however many.")
@bench_option
@json_option
def command(
    procedure: str,
    given: tuple[str, ...],
    pairs: tuple[str, ...],
    moves: bool,
    bench_file: Path | None,
    as_json: bool,
) -> None:
    """Print every move that PROCEDURE would make, the limits it stays within, and how long it takes.

    A long plan is summed up; --moves prints all of it. Settings of the procedure are options: `rig plan sweep
    --step-deg 30`. Nothing is touched.
    """
    bench = read_bench(bench_file)
    found = find(procedure, bench.folders.procedures)
    planned = plan(bench, found, parse(found, read_settings(given, pairs, found.defaults)))
    if as_json:
        emit(_document(planned))
        return
    whole = moves or len(planned.steps) <= FEW_STEPS
    click.echo("\n".join([*(_steps(planned) if whole else _summary(planned)), "", *_end(planned)]))


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
