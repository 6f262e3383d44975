"""Results in words, for a terminal: numbers to the digits that their uncertainty leaves them."""

from __future__ import annotations

import math
from pathlib import Path

from calibrations.design.expected import CERTAIN, Expected, told_apart
from calibrations.discover import Discovery
from calibrations.errors import DataError
from calibrations.evaluations.stepwise import stepwise
from calibrations.experiment import Experiment
from calibrations.fit import Fit
from calibrations.model import Estimate, Model
from calibrations.reports.words import joined
from calibrations.search.held_out import held_out_excess
from calibrations.table import Table
from rig.cli.output import columns
from rig.numerals import duration

TOO_QUIET, SOME_ROWS = 0.5, 20  # error over the noise floor that many rows do not leave by chance
PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "u"))


def with_uncertainty(e: Estimate) -> str:
    """`2.500123(45) V`: the digits in brackets are the standard uncertainty of the last digits (GUM 7.2.2)."""
    if e.std is None or not e.std > 0:
        return f"{e.value:.6g} {e.unit}"
    digits = max(0, 1 - math.floor(math.log10(float(f"{e.std:.1e}"))))  # of the rounded one: 0.0998 is 0.10
    if digits > 12 or e.std >= 100:
        return f"{e.value:.6g} +- {e.std:.2g} {e.unit}"
    return f"{e.value:.{digits}f}({round(e.std * 10**digits)}) {e.unit}"


def parameters(model: Model) -> str:
    """The model's parameters as a table."""
    rows = [
        (term.name, e.name, e.axis or "-", with_uncertainty(e) if e.identified else f"not identified: {e.why}")
        for term in model.terms
        for e in term.estimates
    ]
    return columns(("effect", "parameter", "axis", "value"), rows)


def errors(found: Fit) -> str:
    """Residual, noise floor and slow noise of each channel."""
    unit = found.problem.unit
    rows = [
        (
            channel,
            quantity(found.rmse[c], unit),
            quantity(found.noise.floor[c], unit),
            quantity(found.noise.slow[c], unit),
            f"{found.excess[c]:.2f}",
        )
        for c, channel in enumerate(found.channels)
    ]
    floor = "noise floor" if found.noise.known else "scatter (noise floor not known)"
    return columns(("axis", "rms error", floor, "slow noise", "error / floor"), rows)


def quantity(value: float, unit: str) -> str:
    """A value with the prefix that reads best: 51.2 uV, 0.10 mg; a share of the field in parts per thousand."""
    if unit == "field":
        return f"{1e3 * value:.3g} per mille"
    if unit not in ("V", "g") or value == 0:
        return f"{value:.3g} {unit}"
    factor, prefix = next((f, p) for f, p in PREFIXES if abs(value) * f >= 0.1 or p == "u")
    return f"{value * factor:.3g} {prefix}{unit}"


def discovery(result: Discovery) -> str:
    """The falling error, step by step, and the verdict."""
    verdict = _verdict(result) + too_quiet(result.end)
    return "\n".join([falling(result), "", verdict, *_rivals(result), *warning(result.caution)])


def addition(result: Discovery, data: str, out: Path) -> str:
    """The falling error with one effect added, and whether more is missing."""
    end = f"What is left is {result.end.pooled_excess:.2f} x the noise floor.{too_quiet(result.end)}"
    if result.residual_structure is not None:
        end += (
            f" It is not noise: {result.residual_structure}.\nWhat else is missing: rig diagnose {data} --model {out}"
        )
    return "\n".join([falling(result), "", end, *_rivals(result), *warning(result.caution)])


def too_quiet(found: Fit) -> str:
    """A sentence for a residual below the noise floor, which only a wrong floor leaves; else nothing."""
    if not found.noise.known or found.pooled_excess > TOO_QUIET or found.table.n < SOME_ROWS:
        return ""
    return " That is less than noise leaves: see whether the standard deviations and n are those of these means."


def falling(result: Discovery) -> str:
    """The error of each model, as a table with bars."""
    first = result.start
    rows = [(first.model.name, f"{first.pooled_excess:.2f}", f"{held_out_excess(first):.2f}", _bar(first, first))]
    rows += [
        (f"+ {s.name}", f"{s.after.pooled_excess:.2f}", f"{s.held_out_after:.2f}", _bar(s.after, first))
        for s in result.steps
    ]
    return columns(("model", "error / floor", "unseen poses", ""), rows)


def _rivals(result: Discovery) -> list[str]:
    lines = [f"This data cannot tell {name} from {joined(rivals)}." for name, rivals in result.alternatives.items()]
    return [*lines, *experiment(result.next_experiment, result.start.table.source)] if result.next_experiment else lines


def experiment(e: Experiment, data: str) -> list[str]:
    """Why the next experiment can tell, its command line, what it takes, and what it is expected to bring."""
    lines = [f"{'To tell them apart' if e.separates else 'What to do next'}: {e.why}."]
    if e.command:
        takes = [duration(e.duration_s)] if e.duration_s else []
        lines += [f"    {e.command}", f"    {', '.join([*takes, _brings(e.expected, data)])}"]
    return lines


def _brings(expected: Expected | None, data: str) -> str:
    """What an experiment is expected to tell, by its own data where they are enough."""
    if expected is None:
        return "what it will tell is not computed"
    alone = expected.probability_alone >= CERTAIN
    value = expected.alone if alone else expected.together
    judged = "by its own data" if alone else f"by all together: rig discover {data.replace(' + ', ' ')} ITS-RUN"
    chance = min(100 * told_apart(value), 99.9)
    return f"{math.sqrt(value):.3g} standard deviations apart, told with a probability of {chance:.3g} %, {judged}"


def warning(caution: str | None) -> list[str]:
    """A line that keeps a reader from trusting a small residual, where there is reason to."""
    return [f"But {caution}."] if caution else []


def _bar(found: Fit, first: Fit) -> str:
    """A bar as long as the logarithm of the error over the noise floor."""
    longest = math.log(max(first.pooled_excess, 1.1))
    return "#" * max(1, round(40 * math.log(max(found.pooled_excess, 1.0)) / longest)) if longest > 0 else "#"


def _verdict(result: Discovery) -> str:
    end, start = result.end.pooled_excess, result.start.pooled_excess
    left = f"What is left, {end:.2f} x the noise floor,"
    if not result.steps:
        if result.verdict == "unexplained":
            return f"Unexplained: nothing in the catalogue describes what is left: {result.residual_structure}."
        if result.verdict == "ambiguous":
            return "Nothing shows that an effect is missing, but these data could not show all."
        return "Nothing is missing: what is left is noise."
    what = f"Missing {'was' if len(result.causes) == 1 else 'were'} {joined(result.causes)}"
    refines = "refines" if len(result.refinements) == 1 else "refine"
    extra = f"; {joined(result.refinements)} {refines} the form" if result.refinements else ""
    if result.verdict == "unexplained":
        return (
            f"{what}{extra}: the error falls to 1/{start / end:.0f}. {left} still is more than noise, and no "
            f"effect of the catalogue describes it: {result.residual_structure}."
        )
    if result.residual_structure is not None:
        return (
            f"{what}{extra}: the error falls to 1/{start / end:.0f}. {left} still is more than noise: "
            f"{result.residual_structure}. It may be the form of {joined(result.causes, 'or')}, which the catalogue "
            "has only approximately, or one more cause."
        )
    return f"{what}{extra}. {left} has no pattern."


def paper(table: Table) -> str:
    """The paper's stepwise estimate on the same data, or why there is none."""
    try:
        result = stepwise(table)
    except DataError as error:
        return f"The paper's stepwise estimate cannot be made: {error}"
    rows = [
        (axis, quantity(result.linear_rmse_v[k], "V"), quantity(result.rmse_v[k], "V"), f"{tilt.twice_mg:.3g} mg")
        for k, (axis, tilt) in enumerate(zip("xy", result.tilts, strict=True))
    ]
    head = ("axis", "manufacturer (1)-(3)", "paper (4)-(17)", "tilt that (20)-(21) would correct twice")
    return "The paper's stepwise estimate on the same data, rms error:\n" + columns(head, rows)
