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


@click.command("plan", context_settings=PASS_ON)
@click.argument("procedure")
@settings_arguments
@bench_option
@json_option
def command(
    procedure: str, given: tuple[str, ...], pairs: tuple[str, ...], bench_file: Path | None, as_json: bool
) -> None:
    """Print every move that PROCEDURE would make, the limits it stays within, and how long it takes.

    Settings of the procedure are options: `rig plan sweep --step-deg 30`. Nothing is touched.
    """
    bench = read_bench(bench_file)
    found = find(procedure, bench.folders.procedures)
    planned = plan(bench, found, parse(found, read_settings(given, pairs)))
    if as_json:
        emit(_document(planned))
    else:
        click.echo("\n".join(_lines(planned)))


def _lines(planned: Plan) -> list[str]:
    steps = [f"{duration(step.start_s):>9}  {step.what}" for step in planned.steps]
    asked = [f"asks  {question}" for question in planned.questions]
    reach = [
        f"{role} from {low:g} to {high:g} deg, within its limits {least:g} to {most:g} deg"
        for role, ((low, high), (least, most)) in planned.reach.items()
    ]
    total = f"{planned.poses} poses in {duration(planned.duration_s)}, {size(planned.bytes)} on the disk"
    return [*steps, "", *asked, *reach, total]


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
        "steps": [{"start_s": s.start_s, "duration_s": s.duration_s, "what": s.what} for s in planned.steps],
    }
