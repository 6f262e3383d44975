"""Poses chosen for a model, compared with the standard sweep, in words: for the terminal and the page."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from calibrations.text import duration
from rig.planning.optimal import AGAIN, CHECK, DESIGN, Optimal, most_relative, relative

PLANS = ("", "standard sweep", "chosen, same dwell", "chosen, same error")


def plan_rows(optimum: Optimal) -> list[tuple[str, ...]]:
    """A row for each property of the standard sweep, the chosen poses, and those with its worst error."""
    plans = (optimum.standard, optimum.short, optimum.equal)
    return [
        ("poses", *(str(candidate.plan.poses) for candidate in plans)),
        ("dwell", *(f"{candidate.dwell_s:g} s" for candidate in plans)),
        ("rig time", *(duration(candidate.plan.duration_s) for candidate in plans)),
        (
            "worst standard error, relative to the sweep",
            *(_percent(relative(optimum.standard, candidate)) for candidate in plans),
        ),
        (
            "any standard error, relative to the sweep, at most",
            *(_percent(most_relative(optimum.standard, candidate)) for candidate in plans),
        ),
    ]


def savings(optimum: Optimal) -> Iterator[str]:
    """How much less time the rig needs."""
    yield f"{optimum.times_less:.1f} times less rig time for the same worst standard error ({_worst(optimum)})."
    for_all = optimum.all_equal
    yield (
        f"With a dwell of {for_all.dwell_s:g} s at these poses, no parameter becomes less certain. The rig time is "
        f"then {duration(for_all.plan.duration_s)}, {_times(optimum.times_less_for_all)} that of the standard sweep."
    )
    if undetermined := [
        optimum.over.name(k) for k, is_determined in enumerate(optimum.standard.determined) if not is_determined
    ]:
        yield f"The standard sweep cannot determine {', '.join(undetermined)}; the comparison ignores them."


def purpose(optimum: Optimal) -> Iterator[str]:
    """Purpose of the poses, and the effect of their order on a drift."""
    paths = Counter(pose.path for pose in optimum.equal.poses)
    yield (
        f"{paths[DESIGN]} poses are for the model. {paths[AGAIN]} of them are measured twice, which shows the noise. "
        f"{paths[CHECK]} more poses check the model; the errors above do not use them."
    )
    yield (
        f"In this order height and time have a correlation of {optimum.height_correlation:.2f}. A drift fitted with "
        f"the model would add at most {100 * optimum.drift_loss:.1f} % to the variance of a parameter."
    )


def _percent(ratio: float) -> str:
    return f"{100 * ratio:.0f} %"


def _worst(optimum: Optimal) -> str:
    standard_worst, optimal_worst = (
        optimum.over.name(optimum.worst(candidate)) for candidate in (optimum.standard, optimum.equal)
    )
    return standard_worst if standard_worst == optimal_worst else f"{standard_worst} before, {optimal_worst} now"


def _times(ratio: float) -> str:
    if f"{max(ratio, 1 / ratio):.1f}" == "1.0":
        return "about"
    return f"{ratio:.1f} times less than" if ratio >= 1 else f"{1 / ratio:.1f} times"
