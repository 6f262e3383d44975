"""The report's verdict in words: a headline, a summary, the numbers to remember, and what to run next."""

from __future__ import annotations

import re
from collections.abc import Iterable

from calibrations.design.expected import CERTAIN, told_apart
from calibrations.discover import Discovery
from calibrations.experiment import Experiment
from calibrations.fit import Fit
from calibrations.numerals import plain
from calibrations.search.held_out import held_out_excess
from calibrations.units import milli, pooled_mg, rows_of

MOST_NAMED = 3  # effects in the headline
LONG_MIN = 120  # from here on, a duration is told in hours
VERDICTS = {
    "adequate": "nothing missing",
    "found": "effect found",
    "ambiguous": "not decided",
    "unexplained": "not explained",
}


def state(found: Discovery) -> str:
    """The verdict on the model that was given: as that of the discovery, or `found` where its effects complete it."""
    return "found" if found.verdict == "adequate" and found.steps else found.verdict


def headline(found: Discovery) -> str:
    """The verdict on the model that was given, in one sentence."""
    model = found.start.model.name
    if found.verdict == "unexplained":
        beside = f"Beside {_few(found.causes)}, the" if found.causes else "The"
        return f"{beside} model {model} misses something that no effect of the catalogue describes."
    if not found.steps and found.caution:
        return f"Nothing shows that the model {model} misses an effect, but this data does not determine it."
    if not found.steps:
        return f"Nothing is missing from the model {model}: what it leaves is noise."
    text = f"The model {model} misses {_few(found.causes)}"
    doubts = [f"{name} cannot be told from {joined(rivals, 'or')}" for name, rivals in found.alternatives.items()]
    return f"{text}; on this data {joined(doubts)}." if doubts else f"{text}."


def summary(found: Discovery) -> str:
    """What adding the effects does to the error, in one or two sentences, and whether that can be trusted."""
    doubts = [found.caution, found.start.table.constants.get("expired")]
    return " ".join([_error(found), *(f"But {doubt}." for doubt in doubts if doubt)])


def _error(found: Discovery) -> str:
    kind, (error, floor) = rows_of(found.start.table), pooled_mg(found.start)
    rows, unit = f"{found.start.table.n} {kind}", milli(found.start)
    if not found.steps:
        left = f" Left over: {found.residual_structure}." if found.residual_structure else ""
        return (
            f"On {rows} its rms error is {plain(error, 2)} {unit}, {plain(found.start.pooled_excess)} × the noise "
            f"floor of {plain(floor, 2)} {unit}.{left}"
        )
    unseen = plain(held_out_excess(found.start)), plain(found.steps[-1].held_out_after)
    text = (
        f"On {rows} the rms error falls from {plain(error, 2)} {unit} to {plain(pooled_mg(found.end)[0], 2)} {unit}; "
        f"the noise floor is {plain(floor, 2)} {unit}. On unseen {kind} it falls from {unseen[0]} to {unseen[1]} × the "
        "noise floor."
    )
    if found.refinements:
        text += f" For the form of these effects the model also holds {joined(found.refinements)}."
    return f"{text} Left over: {found.residual_structure}." if found.residual_structure else text


def key_figures(found: Discovery) -> list[tuple[str, str, str]]:
    """The few numbers to remember: (what, value, remark)."""
    start, floor, unit = found.start, pooled_mg(found.start)[1], milli(found.start)
    first = "error before" if found.steps else "rms error"
    shown = [(first, f"{plain(pooled_mg(start)[0], 2)} {unit}", _over_floor(start, held_out_excess(start)))]
    if found.steps:
        unseen = found.steps[-1].held_out_after
        shown.append(("error after", f"{plain(pooled_mg(found.end)[0], 2)} {unit}", _over_floor(found.end, unseen)))
    kind = "white noise of one mean" if start.noise.known else "scatter: the white noise is not known"
    return [*shown, ("noise floor", f"{plain(floor, 2)} {unit}", kind)]


def _over_floor(fit: Fit, unseen: float) -> str:
    return f"{plain(fit.pooled_excess)} × the floor; {plain(unseen)} × on unseen {rows_of(fit.table)}"


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
    alone = e.expected.probability_alone >= CERTAIN
    told = 100 * told_apart(e.expected.alone if alone else e.expected.together)
    whose = "its own data" if alone else "all data together"
    return f"{takes}, and is expected to tell them apart with a probability of {min(told, 99.9):.3g} %, by {whose}."


def joined(names: Iterable[str], word: str = "and") -> str:
    """`a`, `a and b`, `a, b and c`."""
    names = list(names)
    return f" {word} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def _few(names: tuple[str, ...]) -> str:
    """All names, or the first two and how many more."""
    return joined(names) if len(names) <= MOST_NAMED else f"{names[0]}, {names[1]} and {len(names) - 2} more effects"


def capital(text: str) -> str:
    """The text as the beginning of a sentence."""
    return text[:1].upper() + text[1:]


def unbroken(text: str) -> str:
    """The text with numbers and units that stay on one line."""
    return re.sub(r"(?<=\d) (?=mg|×|±)|(?<=[×±]) (?=\d)", "\u00a0", text)
