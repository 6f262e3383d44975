"""What is said of a sensor's life, by `rig history` and on its page."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date

from calibrations.analyses.stability import Agreement, Stability
from rig.services.history import Calibration, Compared, History, Quantity

Written = Callable[[float, int], str]


def summary(life: History) -> str:
    """How many calibrations, of which days, by which model."""
    of = life.calibrations
    if len(of) == 1:
        return f"{life.sensor}: one calibration, {of[0].day}, by the model {life.model}"
    return f"{life.sensor}: {len(of)} calibrations from {of[0].day} to {of[-1].day}, by the model {life.model}"


def next_due(life: History, limit_is_given: str) -> str:
    """When the next calibration is due, or what that takes; `limit_is_given` is how a person gives a limit."""
    if life.due is not None:
        names = ", ".join(q.name for q in life.quantities if q.due == life.due)
        return f"Next calibration due on {life.due}: {names} may then be beyond what is allowed."
    if all(q.allowed is None for q in life.quantities):
        return f"When the next calibration is due needs a limit: {limit_is_given}, or limits.results of the bench file."
    if all(q.line is None for q in life.quantities):
        return "When the next calibration is due shows from three calibrations on, at different times."
    return "No calibration is due within ten years by the drift that these show."


def near(calibration: Calibration, age_days: float, on: date) -> str:
    """Which calibration is closest to a day, and how far from it."""
    side = "before" if age_days >= 0 else "after"
    return f"Closest to {on}: {calibration.data}, {calibration.day}, {abs(age_days):.0f} days {side}."


def but_stale(why: str) -> str:
    """The warning."""
    return f"But it is stale: {why}."


def significance(line: Stability) -> str:
    """What is to be said after a drift that may be none."""
    return "" if line.drifts else ", not significant"


def chart_verdict(q: Quantity) -> str:
    """Of its control charts; how far they are while their baseline is not complete; nothing where there is none."""
    if q.chart is None:
        return ""
    progress = f", {len(q.chart.values)} of {q.chart.judged}" if q.chart.verdict == "baseline" else ""
    return q.chart.verdict + progress


def agreements(of: Compared, written: Written) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Head and rows of a table: every quantity that both have; `written` is how a number is to so many digits."""
    head = ("quantity", of.one, of.other, "difference", "U", "unit", "E_n", "")
    return head, [_agreement(name, unit, each, written) for name, (unit, each) in of.rows.items()]


def _agreement(name: str, unit: str, each: Agreement, written: Written) -> tuple[str, ...]:
    verdict = "agree" if each.agrees else "do not agree"
    values = (written(each.a, 7), written(each.b, 7), written(each.difference, 2), written(each.expanded, 2))
    return name, *values, unit, f"{each.e_n:.2f}", verdict
