"""Results on still records in words, for a terminal."""

from __future__ import annotations

from calibrations.still.allan import averaged
from calibrations.still.compare import Comparison
from calibrations.still.diagnose import Diagnosis
from calibrations.still.discover import Discovery
from calibrations.still.documents import mismatch, why
from calibrations.still.fit import NoiseFit
from calibrations.still.held_out import held_out_excess
from calibrations.still.words import doubt, headline, of_record, sentence, two_levels
from rig.cli.output import columns
from rig.cli.words import experiment, parameters, quantity

SHOWN = 6
HEAD = (
    "model", "log-likelihood gained", "lost without it alone", "mismatch / chance", "on the other half",
    "mismatch of the Allan deviation",
)  # fmt: skip
LOST = 2  # a column that one step alone does not need


def compared(result: Comparison, model: str, data: str) -> str:
    """Allan deviations measured and modelled, and where they differ."""
    lines = [f"{model} beside {of_record(result.fit.still)}", "", _errors(result.fit), "", _curves(result), ""]
    if result.adequate:
        return "\n".join([*lines, "The model fails nowhere: what is left is chance."])
    lines.append("It fails, worst first:\n" + "\n".join(f"  {place.text}" for place in result.fails))
    return "\n".join([*lines, "", f"Which noise is missing: rig diagnose {data} --model {model}"])


def fitted(found: NoiseFit, out: str | None) -> str:
    """Coefficients with their uncertainties."""
    head = f"{found.model.name} fitted to {of_record(found.still)}\n\n{parameters(found.model)}\n\n{_errors(found)}"
    return f"{head}\n\nwritten to {out}" if out else head


def diagnosed(result: Diagnosis, model: str, data: str, bench: str) -> str:
    """The verdict, the candidates, and what to do."""
    lines = [f"{model} on {of_record(result.fit.still)}: {headline(result)}", ""]
    rows = [
        (
            c.name,
            f"{result.held_out_before:.3g} -> {c.held_out_after:.3g}",
            f"{c.gain / 2:.4g}" if c.gain > 1e-6 else "0",
            f"{c.p_value:.1g}",
            f"{c.probability:.3f}",
            ", ".join(c.indistinguishable_from) or "-",
        )
        for c in result.candidates[:SHOWN]
    ]
    head = (
        "candidate",
        "mismatch on the other half / chance",
        "log-likelihood",
        "p-value",
        "probability",
        "not told apart from",
    )
    lines += [columns(head, rows), ""] if rows else []
    if result.missing:
        best = next(c for c in result.candidates if c.name == result.missing[0])
        lines += [f"{best.name}: {why(best, result)}", "", f"    {best.effect.formula.splitlines()[0]}", ""]
        lines.append(f"Add it: rig add {best.name} --model {model} --data {data} --out model.yaml{bench}")
    if result.next_experiment:
        lines += experiment(result.next_experiment, data)
    return "\n".join(lines).rstrip()


def discovered(result: Discovery, data: str, out: str | None) -> str:
    """The falling error, the verdict, and the final model."""
    lines = [
        of_record(result.start.still),
        "",
        _falling(result),
        *_beyond(result.end),
        "",
        _verdict(result) + two_levels(result.search),
    ]
    lines += experiment(result.next_experiment, data) if result.next_experiment else []
    lines += ["", parameters(result.end.model)]
    return "\n".join([*lines, *(["", f"written to {out}"] if out else [])])


def added(result: Discovery, data: str, out: str) -> str:
    """The falling error with one effect added, and whether more is missing."""
    lines = [f"{result.steps[0].name} added to {result.start.model.name}", "", _falling(result), ""]
    if result.residual_structure:
        lines.append(f"Something is left: {result.residual_structure}.")
        lines.append(f"What else is missing: rig diagnose {data} --model {out}")
    else:
        lines.append(f"Nothing more is missing.{doubt(result.reason)}")
    lines += experiment(result.next_experiment, data) if result.next_experiment else []
    return "\n".join([*lines, "", parameters(result.end.model), "", f"written to {out}"])


def _verdict(result: Discovery) -> str:
    names = " and ".join(result.causes)
    missing = f"Missing {'was' if len(result.causes) == 1 else 'were'} {names}."
    if result.start.still.hidden:
        return f"Nothing is told. {sentence(result.residual_structure)}"
    if result.verdict == "unexplained":
        beside = f"Beside {names}, there" if names else "There"
        return f"Unexplained. {beside} is something that no mixture of noise is: {result.residual_structure}."
    return missing + doubt(result.reason) if names else "Nothing is missing: what is left is chance."


def _beyond(found: NoiseFit) -> list[str]:
    """Lines that the log-likelihood knows nothing of."""
    if any(line.frequency_hz > each.channel.highest_hz for each in found.channels for line in each.lines):
        return ["Lines beyond half the corner of the low-pass are outside of what is fitted, and gain no likelihood."]
    return []


def _falling(result: Discovery) -> str:
    first, cleaned = result.start, result.cleaned
    rows = [_row(first.model.name, first)]
    if cleaned is not None:
        rows.append(_row("less what no noise is", cleaned, cleaned.log_likelihood - first.log_likelihood))
    several = len(result.steps) > 1
    rows += [_row(f"+ {s.name}", s.after, s.gained, s.alone if several else None) for s in result.steps]
    chosen = [k for k in range(len(HEAD)) if k != LOST or several]
    return columns([HEAD[k] for k in chosen], [[row[k] for k in chosen] for row in rows])


def _row(name: str, found: NoiseFit, gained: float | None = None, lost: float | None = None) -> tuple[str, ...]:
    """In the order of HEAD. What is gained depends on what is above, and adds up; what is lost does not."""
    off = ", ".join(f"{100 * value:.3g} %" for value in mismatch(found).values())
    unseen = held_out_excess(found.model, found.still)
    shown = ["" if value is None else f"{value:+.5g}" for value in (gained, None if lost is None else -lost)]
    return name, *shown, f"{found.pooled_excess:.2f}", f"{unseen:.2f}", off


def _errors(found: NoiseFit) -> str:
    rows = []
    for each in found.channels:
        curve = averaged(each, found.still.allan[each.channel.axis])
        rows.append(
            (
                each.channel.axis,
                f"{100 * each.mismatch:.3g} %",
                f"{100 * each.floor:.3g} %",
                f"{each.excess:.2f}",
                f"{100 * curve.mismatch:.3g} %",
                f"{100 * curve.by_chance:.3g} %",
            )
        )
    return columns(
        ("axis", "mismatch of the spectrum", "by chance", "ratio", "of the Allan deviation", "by chance"), rows
    )


def _curves(result: Comparison) -> str:
    unit, rows = result.fit.still.unit, []
    for each, curve in zip(result.fit.channels, result.averaged, strict=True):
        for k, tau in enumerate(curve.tau_s):
            shown = [quantity(float(x[k]), unit) for x in (curve.measured, curve.low, curve.high, curve.modelled)]
            off = f"{curve.deviations[k]:+.1f}" if abs(curve.deviations[k]) >= 0.05 else "0"
            rows.append((each.channel.axis, f"{tau:.4g}", shown[0], f"{shown[1]} .. {shown[2]}", shown[3], off))
    return columns(("axis", "time (s)", "Allan deviation", "95 % interval", "model", "deviations off"), rows)
