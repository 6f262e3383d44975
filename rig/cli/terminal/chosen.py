"""What `rig plan sweep --optimal` says: the chosen poses beside the standard sweep, in words and as JSON."""

from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from click import wrap_text

from calibrations.presentation.text import columns, duration
from rig.planning.optimal import AGAIN, CHECK, DESIGN, Optimal, most_relative, relative
from rig.planning.sweep_range import Judged

HEAD = ("", "standard sweep", "chosen, same dwell", "chosen, same error")


def lines(found: Optimal, out: str | None, bench: str | None = None) -> Iterator[str]:
    """For people; `out` is the file that the poses were written to, `bench` the bench file that was named."""
    model, count = found.over.fit.model.name, len(found.over.fit.theta)
    yield f"{model}, {count} parameters: {found.criterion}-optimal poses in the range of the standard sweep"
    yield ""
    yield columns(HEAD, _rows(found, (found.standard, found.short, found.equal)))
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
