"""The report's verdict in words: a headline, a summary, the numbers to remember, and what to run next."""

from __future__ import annotations

from calibrations.criteria import CERTAIN_PROBABILITY
from calibrations.design.expected import pairs_separated
from calibrations.design.experiment import Experiment
from calibrations.discovery.results import Discovery
from calibrations.fit import Fit
from calibrations.presentation.residual import milli_unit, pooled_milli
from calibrations.presentation.text import joined, rounded

LONG_MIN = 120  # longer durations are given in hours


def summary(found: Discovery[Fit]) -> str:
    """The error before and after the added effects, and the reasons to doubt them."""
    doubts = [found.caution, found.start.table.constants.get("expired")]
    return " ".join([_error(found), *(f"But {doubt}." for doubt in doubts if doubt)])


def _error(found: Discovery[Fit]) -> str:
    (error, floor), unit = pooled_milli(found.start), milli_unit(found.start)
    rows = f"{found.start.table.n} {found.start.table.type.rows}"
    if not found.steps:
        left = f" Remaining: {found.residual_structure}." if found.residual_structure else ""
        return (
            f"On {rows} its rms error is {rounded(error, 2)} {unit}, {rounded(found.start.pooled_excess)} × the noise "
            f"floor of {rounded(floor, 2)} {unit}.{left}"
        )
    unseen = rounded(found.start.held_out_excess), rounded(found.steps[-1].held_out_after)
    text = (
        f"On {rows} the rms error falls from {rounded(error, 2)} {unit} to {rounded(pooled_milli(found.end)[0], 2)} "
        f"{unit}; the noise floor is {rounded(floor, 2)} {unit}. The held-out error falls from {unseen[0]} to "
        f"{unseen[1]} × the noise floor."
    )
    if found.refinements:
        text += f" For the form of these effects the model also holds {joined(found.refinements)}."
    return f"{text} Remaining: {found.residual_structure}." if found.residual_structure else text


def key_figures(found: Discovery[Fit]) -> list[tuple[str, str, str]]:
    """The few numbers to remember: (what, value, remark)."""
    start, floor, unit = found.start, pooled_milli(found.start)[1], milli_unit(found.start)
    first = "error before" if found.steps else "rms error"
    shown = [(first, f"{rounded(pooled_milli(start)[0], 2)} {unit}", _of_floor(start, start.held_out_excess))]
    if found.steps:
        held_out = found.steps[-1].held_out_after
        shown.append(
            ("error after", f"{rounded(pooled_milli(found.end)[0], 2)} {unit}", _of_floor(found.end, held_out))
        )
    kind = "white noise of one mean" if start.noise.known else "from the scatter: the white noise is not known"
    return [*shown, ("noise floor", f"{rounded(floor, 2)} {unit}", kind)]


def _of_floor(fit: Fit, held_out: float) -> str:
    return f"{rounded(fit.pooled_excess)} × the noise floor; held-out error {rounded(held_out)} ×"


def next_words(e: Experiment) -> str:
    """What to run next, which effects it separates, and why."""
    pairs = [f"{a} from {joined([y for x, y in e.separates if x == a], 'or')}" for a in dict(e.separates)]
    settings = ", ".join(f"{name} = {value}" for name, value in e.settings.items())
    return f"To separate {joined(pairs)}, run {e.procedure}{f' with {settings}' if settings else ''}: {e.why}."


def next_takes(e: Experiment) -> str:
    """Its duration and its probability of success, as far as they are known."""
    if e.duration_s is None:
        return ""
    minutes = e.duration_s / 60
    takes = f"It takes {minutes:.0f} min" if minutes < LONG_MIN else f"It takes {minutes / 60:.1f} h"
    if e.expected is None:
        return f"{takes}. Its result cannot be predicted."
    alone = e.expected.probability_alone >= CERTAIN_PROBABILITY
    percent = 100 * pairs_separated(e.expected.alone if alone else e.expected.together)
    whose = "its own data" if alone else "all data together"
    return f"{takes} and separates them with a probability of {min(percent, 99.9):.3g} %, from {whose}."
