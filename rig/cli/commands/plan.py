"""plan: dry run of a procedure: every move, its limits, duration; touches nothing."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from click import wrap_text

from calibrations.presentation.text import columns, duration, size
from drivers.errors import LimitError
from procedures.catalogue import Procedure, find
from procedures.errors import SafetyLimit
from procedures.pose_list import format_poses
from procedures.settings import parse
from rig.bench import Bench, read_bench
from rig.cli.terminal.options import PASS_ON, read_settings, settings_arguments
from rig.cli.terminal.output import bench_option, emit, json_option, model_option
from rig.errors import BeyondLimits
from rig.planning.optimal import AGAIN, CHECK, DESIGN, Optimal, most_relative, relative
from rig.planning.plan import Plan, Stretch, plan, stretches
from rig.planning.sweep_range import Judged

PLANS = ("", "standard sweep", "chosen, same dwell", "chosen, same error")


FEW_STEPS = 120  # that are read through rather than summed up
FIRST, LAST = 14, 4  # stretches of a long plan that are shown


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
    left_out = len(lines) - FIRST - LAST
    if left_out > 1:
        lines[FIRST:-LAST] = [f"{'...':>9}  {left_out} lines like these"]
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


# What `rig plan sweep --optimal` says: the chosen poses beside the standard sweep, in words and as JSON.


def lines(found: Optimal, out: str | None, bench: str | None = None) -> Iterator[str]:
    """For people; `out` is the file that the poses were written to, `bench` the bench file that was named."""
    model, count = found.over.fit.model.name, len(found.over.fit.theta)
    yield f"{model}, {count} parameters: {found.criterion}-optimal poses in the range of the standard sweep"
    yield ""
    yield columns(PLANS, _rows(found, (found.standard, found.short, found.equal)))
    yield ""
    yield f"{found.times_less:.1f} x less rig time at equal worst standard error: {_worst(found)}."
    yield f"{_times(found.times_less_for_all)} with no parameter less certain than after the sweep: {_longest(found)}."
    if lost := [found.over.name(k) for k, known in enumerate(found.standard.told) if not known]:
        yield f"The standard sweep does not tell {', '.join(lost)}: left out of account."
    yield ""
    yield from map(wrap_text, _about(found))
    yield ""
    yield from _how_to_run(found, out, bench)


def document(found: Optimal) -> dict[str, Any]:
    """The key `optimal` of the plan's document."""
    return {
        "model": found.over.fit.model.name,
        "criterion": found.criterion,
        "times_less_rig_time": found.times_less,
        "times_less_rig_time_for_all": found.times_less_for_all,
        "standard": _of_plan(found, found.standard),
        "same_dwell": _of_plan(found, found.short),
        "same_worst_error": _of_plan(found, found.equal),
        "no_parameter_worse": _of_plan(found, found.all_equal),
        "drift_loss": found.drift_loss,
        "height_correlation": found.height_correlation,
        "poses": [
            {"alpha_deg": p.alpha_deg, "beta_deg": p.beta_deg, "direction": p.direction, "flip": p.flip, "path": p.path}
            for p in found.equal.poses
        ],
    }


def _percent(ratio: float) -> str:
    return f"{100 * ratio:.0f} %"


def _rows(found: Optimal, plans: Sequence[Judged]) -> list[tuple[str, ...]]:
    return [
        ("poses", *(str(each.plan.poses) for each in plans)),
        ("dwell", *(f"{each.dwell_s:g} s" for each in plans)),
        ("rig time", *(duration(each.plan.duration_s) for each in plans)),
        ("worst standard error", *(_percent(relative(found.standard, each)) for each in plans)),
        ("each error, at most", *(_percent(most_relative(found.standard, each)) for each in plans)),
    ]


def _worst(found: Optimal) -> str:
    before, after = (found.over.name(found.worst(each)) for each in (found.standard, found.equal))
    return before if before == after else f"{before}, now {after}"


def _times(ratio: float) -> str:
    return f"{ratio:.1f} x less" if ratio >= 1 else f"{1 / ratio:.1f} x more"


def _longest(found: Optimal) -> str:
    return f"{found.all_equal.dwell_s:g} s a pose, {duration(found.all_equal.plan.duration_s)}"


def _about(found: Optimal) -> Iterator[str]:
    """What the poses are for, and what their order does to a drift."""
    paths = Counter(pose.path for pose in found.equal.poses)
    yield (
        f"{paths[DESIGN]} poses for the model, {paths[AGAIN]} of them once more, so that the noise shows in the data "
        f"themselves, and {paths[CHECK]} to check the model on, which the errors above do without."
    )
    yield (
        f"In their order height and time correlate by {found.height_correlation:.2f}. A drift fitted beside the model "
        f"would add at most {100 * found.drift_loss:.1f} % to the variance of a parameter."
    )


def _how_to_run(found: Optimal, out: str | None, bench: str | None) -> Iterator[str]:
    settle_s = found.equal.plan.settings["settle_s"]
    words = ["rig", "run", "sweep", "--pose-list", out or "poses.csv", "--dwell-s", f"{found.equal.dwell_s:g}"]
    words += ["--settle-s", f"{settle_s:g}"] if settle_s != 0.5 else []
    words += ["--bench", bench] if bench else []
    yield f"Run them:  {shlex.join(words)}"
    if out is None:
        yield "           once the same command with --out poses.csv has written them"


def _of_plan(found: Optimal, each: Judged) -> dict[str, Any]:
    with np.errstate(invalid="ignore"):  # what neither tells is infinitely uncertain by both
        ratios = [float(ratio) for ratio in each.errors / found.standard.errors]
    return {
        "poses": each.plan.poses,
        "dwell_s": each.dwell_s,
        "duration_s": each.plan.duration_s,
        "worst_error": relative(found.standard, each),
        "worst_parameter": found.over.name(found.worst(each)),
        "errors": {found.over.name(k): ratio if math.isfinite(ratio) else None for k, ratio in enumerate(ratios)},
    }
