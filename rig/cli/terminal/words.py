"""Results as text for a terminal."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calibrations.discovery.patterns import Pattern
from calibrations.discovery.results import Discovery
from calibrations.discovery.verdict import Verdict
from calibrations.effects import Effect
from calibrations.errors import DataError
from calibrations.model import Model, Term
from calibrations.presentation.answers import discovery_text, discovery_verdict
from calibrations.table import Table
from calibrations.text import columns, duration, quantity
from rig.cli.terminal.output import note
from rig.services import next_experiment
from rig.services.next_experiment import Answer
from rig.services.request import Request

if TYPE_CHECKING:
    from calibrations.design.expected import ExpectedResult
    from calibrations.design.experiment import Experiment


def parameters(model: Model) -> str:
    """The model's parameters as a table."""
    rows = []
    for term in model.terms:
        rows += [(term.name, e.name, e.axis or "-", e.text) for e in term.quantities]
        rows += [(term.name, "curve", axis or "-", f"{n} coefficients") for axis, n in term.coefficients.items()]
    return columns(("effect", "parameter", "axis", "value"), rows)


def short_discovery(result: Discovery[Any]) -> str:
    """The verdict on a still record and a line for each effect; the rest is behind --all."""
    lines = [discovery_verdict(result, _next(result)), *map(_line, result.end.model.terms)]
    if result.steps:
        floor = result.findings.data.floor
        lines.insert(
            1, f"Error: {result.start.pooled_excess:.3g} times {floor} before, {result.end.pooled_excess:.3g} after."
        )
    return "\n".join([*lines, "The error after each step and every parameter: --all"])


def _line(term: Term) -> str:
    """An effect and its parameters in one line."""
    several = len(term.effect.parameters) > 1
    parts = [
        " ".join(filter(None, (e.name if several else "", e.axis, e.text if e.identified else "not identified")))
        for e in term.quantities
    ]
    parts += [f"curve {axis} of {n} coefficients" for axis, n in term.coefficients.items()]
    return f"  {term.name}: {', '.join(parts)}"


def with_planned_experiment(result: Answer, request: Request, effects: Mapping[str, Effect]) -> Answer:
    """The result with its next experiment as a command; remarks go to standard error."""
    return next_experiment.planned(result, request, effects, note)


def discovery(result: Discovery[Any]) -> str:
    """The error after each step, the verdict, and the next experiment."""
    return discovery_text(result, _next(result))


def _next(result: Discovery[Any]) -> list[str]:
    """Lines on the next experiment."""
    return experiment(result.next_experiment, result.findings.data.source) if result.next_experiment else []


def addition(result: Discovery[Any], data: str, out: Path) -> str:
    """The error with one more effect, and the verdict."""
    text = discovery(result)
    if result.verdict not in (Verdict.ADEQUATE, Verdict.NO_RESPONSE):
        text += f"\nTo find the missing effect: rig diagnose {shlex.quote(data)} --model {shlex.quote(str(out))}"
    return text


def experiment(e: Experiment, data: str) -> list[str]:
    """The next experiment: reason, command, duration, expected result."""
    lines = [f"{'To separate them' if e.separates else 'Next experiment'}: {e.why}."]
    if e.command:
        duration_words = [duration(e.duration_s)] if e.duration_s else []
        lines += [f"    {e.command}", f"    {', '.join([*duration_words, _brings(e.expected, data)])}"]
    return lines


def _brings(expected: ExpectedResult | None, data: str) -> str:
    """Expected result of an experiment, from its own data if they are enough."""
    if expected is None:
        return "its result cannot be predicted"
    all_data = f"all data: rig discover {data.replace(' + ', ' ')} NEW-RUN"
    return (
        f"separation {math.sqrt(expected.decisive):.3g} standard deviations, correct with a probability of "
        f"{expected.percent}, from {'its own data' if expected.suffices_alone else all_data}"
    )


def warning(cautions: Iterable[str | None]) -> list[str]:
    """Warnings against a small error that means little."""
    return [f"Caution: {caution}." for caution in cautions if caution]


def paper(table: Table) -> str:
    """The stepwise estimate of the paper on the same data, or the reason why there is none."""
    from calibrations.analyses.stepwise import estimate_stepwise  # of `fit` on poses alone

    try:
        result = estimate_stepwise(table)
    except DataError as error:
        return f"No stepwise estimate (Ang): {error}"
    unit = table.unit
    rows = [
        (axis, quantity(result.linear_rmse_v[k], unit), quantity(result.rmse_v[k], unit), f"{tilt.twice_mg:.3g} mg")
        for k, (axis, tilt) in enumerate(zip("xy", result.tilts, strict=True))
    ]
    head = ("axis", "manufacturer (1)-(3)", "paper (4)-(17)", "tilt corrected twice by (20)-(21)")
    return "Stepwise estimate (Ang) on the same data, rms error:\n" + columns(head, rows)


# A pattern of the residual as an effect of your own.


def own_effect(pattern: Pattern | None, model: str, request: Request) -> dict[str, Any] | None:
    """Expression, name, and the command that adds the pattern to `model`; None without an expression."""
    if pattern is None or not pattern.expression:
        return None
    words = ["rig", "add", pattern.expression, "--name", pattern.name, "--model", model, "--data", request.data]
    words += ["--out", f"{pattern.name}.yaml", *(["--bench", str(request.bench_file)] if request.bench_file else [])]
    return {"expression": pattern.expression, "name": pattern.name, "command": shlex.join(words)}


def pattern_advice(pattern: Pattern | None, model: str, request: Request) -> list[str]:
    """The remedy for a pattern of the residual."""
    if effect := own_effect(pattern, model, request):
        return [
            "To add this pattern to the model as your own effect:",
            f"    {effect['command']}",
        ]
    if pattern is not None and pattern.poses and not Path(data := request.data).exists():
        return [f"Look at these poses: rig show {data} --poses. rig exclude {data} POSE excludes one, with a reason."]
    return []
