"""The report's verdict in words: a headline, a summary, the numbers to remember, and what to run next."""

from __future__ import annotations

from calibrations.criteria import CERTAIN_PROBABILITY
from calibrations.design.expected import pairs_separated
from calibrations.design.experiment import Experiment
from calibrations.discovery.results import Discovery, F
from calibrations.fit import Fit
from calibrations.presentation.residual import milli_unit, pooled_milli
from calibrations.presentation.text import joined, plain

LONG_MIN = 120  # from here on, a duration is told in hours
VERDICTS = {
    "adequate": "nothing missing",
    "found": "effect found",
    "ambiguous": "not decided",
    "unexplained": "not explained",
    "no-response": "no response",
}


def state(found: Discovery[F]) -> str:
    """The verdict on the model that was given: as that of the discovery, or `found` where its effects complete it."""
    return "found" if found.verdict == "adequate" and found.steps else found.verdict.value


def summary(found: Discovery[Fit]) -> str:
    """What adding the effects does to the error, in one or two sentences, and whether that can be trusted."""
    doubts = [found.caution, found.start.table.constants.get("expired")]
    return " ".join([_error(found), *(f"But {doubt}." for doubt in doubts if doubt)])


def _error(found: Discovery[Fit]) -> str:
    kind, (error, floor) = found.start.table.type.rows, pooled_milli(found.start)
    rows, unit = f"{found.start.table.n} {kind}", milli_unit(found.start)
    if not found.steps:
        left = f" Left over: {found.residual_structure}." if found.residual_structure else ""
        return (
            f"On {rows} its rms error is {plain(error, 2)} {unit}, {plain(found.start.pooled_excess)} × the noise "
            f"floor of {plain(floor, 2)} {unit}.{left}"
        )
    unseen = plain(found.start.held_out_excess), plain(found.steps[-1].held_out_after)
    text = (
        f"On {rows} the rms error falls from {plain(error, 2)} {unit} to "
        f"{plain(pooled_milli(found.end)[0], 2)} {unit}; "
        f"the noise floor is {plain(floor, 2)} {unit}. On unseen {kind} it falls from {unseen[0]} to {unseen[1]} × the "
        "noise floor."
    )
    if found.refinements:
        text += f" For the form of these effects the model also holds {joined(found.refinements)}."
    return f"{text} Left over: {found.residual_structure}." if found.residual_structure else text


def key_figures(found: Discovery[Fit]) -> list[tuple[str, str, str]]:
    """The few numbers to remember: (what, value, remark)."""
    start, floor, unit = found.start, pooled_milli(found.start)[1], milli_unit(found.start)
    first = "error before" if found.steps else "rms error"
    shown = [(first, f"{plain(pooled_milli(start)[0], 2)} {unit}", _over_floor(start, start.held_out_excess))]
    if found.steps:
        unseen = found.steps[-1].held_out_after
        shown.append(("error after", f"{plain(pooled_milli(found.end)[0], 2)} {unit}", _over_floor(found.end, unseen)))
    kind = "white noise of one mean" if start.noise.known else "scatter: the white noise is not known"
    return [*shown, ("noise floor", f"{plain(floor, 2)} {unit}", kind)]


def _over_floor(fit: Fit, unseen: float) -> str:
    return f"{plain(fit.pooled_excess)} × the floor; {plain(unseen)} × on unseen {fit.table.type.rows}"


def next_words(e: Experiment) -> str:
    """What to run next, to tell what from what, and why."""
    pairs = [f"{a} from {joined([y for x, y in e.separates if x == a], 'or')}" for a in dict(e.separates)]
    settings = ", ".join(f"{name} = {value}" for name, value in e.settings.items())
    return f"To tell {joined(pairs)}, run {e.procedure}{f' with {settings}' if settings else ''}: {e.why}."


def next_takes(e: Experiment) -> str:
    """How long it takes, and what it is expected to bring, as far as either is known."""
    if e.duration_s is None:
        return ""
    minutes = e.duration_s / 60
    takes = f"It takes {minutes:.0f} min" if minutes < LONG_MIN else f"It takes {minutes / 60:.1f} h"
    if e.expected is None:
        return f"{takes}; what it will tell cannot be computed beforehand."
    alone = e.expected.probability_alone >= CERTAIN_PROBABILITY
    told = 100 * pairs_separated(e.expected.alone if alone else e.expected.together)
    whose = "its own data" if alone else "all data together"
    return f"{takes}, and is expected to tell them apart with a probability of {min(told, 99.9):.3g} %, by {whose}."
