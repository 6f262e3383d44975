"""plan: dry run of a procedure: every move, its limits, its duration; nothing moves."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from click import wrap_text

from calibrations.text import columns, duration, size
from drivers.errors import LimitError
from procedures.catalogue import Procedure, find
from procedures.errors import SafetyLimit
from procedures.pose_list import format_poses
from procedures.settings import parse
from rig.bench import Bench, read_bench
from rig.cli.terminal.complete import complete_procedure
from rig.cli.terminal.options import PASS_ON, read_settings, settings_arguments
from rig.cli.terminal.output import bench_option, emit, json_option, model_option, out_option
from rig.cli.terminal.progress import working
from rig.cli.terminal.settings_help import ProcedureCommand
from rig.errors import BeyondLimits
from rig.files import write_whole
from rig.planning.optimal import Optimal, relative
from rig.planning.optimal import optimal as chosen
from rig.planning.plan import Plan, Stretch, plan, stretches
from rig.planning.sweep_range import JudgedPlan
from rig.services.optimal_words import PLANS, plan_rows, purpose, savings

FEW_STEPS = 120  # longer plans are summarised
FIRST, LAST = 14, 4  # stretches of a long plan that are shown at its beginning and its end


@contextmanager
def _limits_as_bad_input() -> Iterator[None]:
    """Report a limit that would stop a run as bad input, because a plan moves nothing."""
    try:
        yield
    except (LimitError, SafetyLimit) as error:
        raise BeyondLimits(str(error)) from None


@click.command("plan", cls=ProcedureCommand, context_settings=PASS_ON)
@click.argument("procedure", shell_complete=complete_procedure)
@settings_arguments
@click.option("--moves", is_flag=True, help="List every move and every recording.")
@click.option(
    "--optimal", is_flag=True, help="For sweep: choose poses for --model, and compare them with the standard ones."
)
@model_option
@click.option("--poses", type=int, help="Number of poses to choose, at most 60. Default: a quarter.")
@click.option("--criterion", type=click.Choice(["D", "I"]), help="D: joint uncertainty; I, the default: prediction.")
@out_option("Write the poses to this file.")
@bench_option
@json_option
@_limits_as_bad_input()
def plan_command(
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
    """Print every move that PROCEDURE would make, the limits, and the duration. Nothing moves.

    A long plan is summarised; --moves prints all of it. Settings of the procedure are options: `rig plan sweep
    --step-deg 30`. --out writes the poses, for `rig run sweep --pose-list`.

    --optimal chooses the poses of a sweep for a model, so that the same uncertainty takes less rig time. The settings
    are those of the standard sweep for comparison; the chosen poses stay in its range.
    """
    bench = read_bench(bench_file)
    planned_procedure = find(procedure, bench.folders.procedures)
    settings = parse(planned_procedure, read_settings(given, pairs, planned_procedure.defaults))
    if optimal:
        _optimal(bench, planned_procedure, settings, OptimalOptions(model, poses, criterion, out, bench_file, as_json))
        return
    if model or poses or criterion:
        raise click.UsageError("--model, --poses and --criterion go with --optimal")
    with working("planning"):
        planned = plan(bench, planned_procedure, settings)
    if out is not None:
        _write_poses(out, planned)
    if as_json:
        emit(_document(planned))
        return
    shows_moves = moves or len(planned.steps) <= FEW_STEPS
    click.echo("\n".join([*(_steps(planned) if shows_moves else _summary(planned)), "", *_end(planned)]))


@dataclass(frozen=True)
class OptimalOptions:
    """Options of --optimal; None where the default applies."""

    model: str | None
    poses: int | None
    criterion: str | None
    out: Path | None
    bench_file: Path | None
    as_json: bool


def _optimal(bench: Bench, procedure: Procedure, settings: Mapping[str, Any], options: OptimalOptions) -> None:
    """Choose poses for a model, and compare them with the standard sweep. Raises UsageError without a grid."""
    from calibrations.effects.catalogue import catalogue
    from calibrations.model.file import read_model

    if procedure.name != "sweep" or settings["pose_list"]:
        raise click.UsageError("--optimal is for a sweep over a grid, without --pose-list")
    model = read_model(options.model or "linear", catalogue(bench.folders.effects))
    with working("choosing the poses"):
        optimum = chosen(bench, procedure, settings, model, options.poses, options.criterion or "I")
    if options.out is not None:
        _write_poses(options.out, optimum.equal.plan)
    if options.as_json:
        emit(_document(optimum.equal.plan) | {"optimal": optimal_document(optimum)})
    else:
        files = (str(path) if path else None for path in (options.out, options.bench_file))
        click.echo("\n".join(optimal_lines(optimum, *files)))


def _write_poses(out: Path, planned: Plan) -> None:
    write_whole(out, "\n".join([*format_poses(dwell.pose for dwell in planned.held), ""]))


def _steps(planned: Plan) -> list[str]:
    return [f"{duration(step.start_s):>9}  {step.what}" for step in planned.steps]


def _summary(planned: Plan) -> list[str]:
    """The stretches; the middle of a long list is left out."""
    lines = [line for stretch in stretches(planned) for line in _lines(stretch)]
    left_out = len(lines) - FIRST - LAST
    if left_out > 1:
        lines[FIRST:-LAST] = [f"{'...':>9}  {left_out} similar lines"]
    return [*lines, f"All {len(planned.steps)} moves and recordings: the same command with --moves"]


def _lines(stretch: Stretch) -> list[str]:
    earlier_steps = [f"{'':>9}  {', '.join(stretch.also)}, then"] if stretch.also else []
    return [*earlier_steps, f"{duration(stretch.start_s):>9}  {stretch.words}"]


def _end(planned: Plan) -> list[str]:
    """Questions, reach of the stages, duration and size on the disk."""
    questions = [f"asks  {question}" for question in planned.questions]
    reach = [
        f"{role} from {low:g} to {high:g} deg, within its limits {least:g} to {most:g} deg"
        for role, ((low, high), (least, most)) in planned.reach.items()
    ]
    total = f"{planned.poses} poses in {duration(planned.duration_s)}, {size(planned.bytes)} on the disk"
    return [*questions, *reach, total]


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


# `rig plan sweep --optimal`: the chosen poses compared with the standard sweep, in words and as JSON.


def optimal_lines(optimum: Optimal, out: str | None, bench: str | None = None) -> Iterator[str]:
    """The optimum in words; `out` is the file of the poses, `bench` the bench file."""
    model, count = optimum.over.fit.model.name, len(optimum.over.fit.theta)
    yield f"{model}, {count} parameters: {optimum.criterion}-optimal poses in the range of the standard sweep"
    yield ""
    yield columns(PLANS, plan_rows(optimum))
    yield ""
    yield from savings(optimum)
    yield ""
    yield from map(wrap_text, purpose(optimum))
    yield ""
    yield from _explain_run(optimum, out, bench)


def optimal_document(optimum: Optimal) -> dict[str, Any]:
    """The key `optimal` of the plan's document."""
    return {
        "model": optimum.over.fit.model.name,
        "criterion": optimum.criterion,
        "times_less_rig_time": optimum.times_less,
        "times_less_rig_time_for_all": optimum.times_less_for_all,
        "standard": _plan_document(optimum, optimum.standard),
        "same_dwell": _plan_document(optimum, optimum.short),
        "same_worst_error": _plan_document(optimum, optimum.equal),
        "no_parameter_worse": _plan_document(optimum, optimum.all_equal),
        "drift_loss": optimum.drift_loss,
        "height_correlation": optimum.height_correlation,
        "poses": [
            {"alpha_deg": p.alpha_deg, "beta_deg": p.beta_deg, "direction": p.direction, "flip": p.flip, "path": p.path}
            for p in optimum.equal.poses
        ],
    }


def _explain_run(optimum: Optimal, out: str | None, bench: str | None) -> Iterator[str]:
    settle_s = optimum.equal.plan.settings["settle_s"]
    words = ["rig", "run", "sweep", "--pose-list", out or "poses.csv", "--dwell-s", f"{optimum.equal.dwell_s:g}"]
    words += ["--settle-s", f"{settle_s:g}"] if settle_s != 0.5 else []
    words += ["--bench", bench] if bench else []
    yield f"Run them:  {shlex.join(words)}"
    if out is None:
        yield "           after the same command with --out poses.csv"


def _plan_document(optimum: Optimal, candidate: JudgedPlan) -> dict[str, Any]:
    with np.errstate(invalid="ignore"):  # a parameter that neither determines has infinite uncertainty
        ratios = [float(ratio) for ratio in candidate.errors / optimum.standard.errors]
    return {
        "poses": candidate.plan.poses,
        "dwell_s": candidate.dwell_s,
        "duration_s": candidate.plan.duration_s,
        "worst_error": relative(optimum.standard, candidate),
        "worst_parameter": optimum.over.name(optimum.worst(candidate)),
        "errors": {optimum.over.name(k): ratio if math.isfinite(ratio) else None for k, ratio in enumerate(ratios)},
    }
