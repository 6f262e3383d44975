"""Sentences on the history of a sensor, for `rig history` and its page."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date

from calibrations.analyses.stability import Agreement, Stability
from rig.services.history import Calibration, History, Quantity
from rig.services.history_comparison import CalibrationComparison

Written = Callable[[float, int], str]


def summary(life: History) -> str:
    """Number, period and model of the calibrations."""
    calibrations = life.calibrations
    if len(calibrations) == 1:
        return f"{life.sensor}: one calibration, {calibrations[0].day}, model {life.model}"
    period = f"from {calibrations[0].day} to {calibrations[-1].day}"
    return f"{life.sensor}: {len(calibrations)} calibrations {period}, model {life.model}"


def next_due(life: History, limit_is_given: str) -> str:
    """The date of the next calibration, or the missing input for it; `limit_is_given` shows how to give a limit."""
    if life.due is not None:
        names = ", ".join(q.name for q in life.quantities if q.due == life.due)
        return f"Next calibration due on {life.due}: {names} may exceed the limit then."
    limited = [q for q in life.quantities if q.allowed is not None]
    if not limited:
        return f"A due date needs a limit: {limit_is_given}, or limits.results in the bench file."
    if without_drift := [q for q in limited if q.line is None]:
        of = "" if len(without_drift) == len(limited) else f" of {', '.join(q.name for q in without_drift)}"
        return without_drift[0].no_drift.replace("drift", f"due date{of}", 1)
    return "With this drift no calibration is due within ten years."


def closest_text(calibration: Calibration, age_days: float, on: date) -> str:
    """The calibration closest to a day, and its distance in days."""
    count = round(abs(age_days))
    side = "before" if age_days >= 0 else "after"
    distance = f"{count} day{'s' * (count > 1)} {side}" if count else "the same day"
    return f"Closest to {on}: {calibration.data}, {calibration.day}, {distance}."


def but_stale(reason: str) -> str:
    """The warning about a stale calibration."""
    return f"This calibration is stale: {reason}."


def significance(line: Stability) -> str:
    """A remark after a drift that is not significant."""
    return "" if line.drifts else ", not significant"


def chart_verdict(q: Quantity) -> str:
    """Verdict of the control chart, with its progress while the baseline is incomplete; empty without a chart."""
    if q.chart is None:
        return ""
    progress = f", {len(q.chart.values)} of {q.chart.judged}" if q.chart.verdict == "baseline" else ""
    return q.chart.verdict + progress


def agreements(
    compared: CalibrationComparison, format_number: Written
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Head and rows of a table of the shared quantities; `format_number` formats a number to a number of digits."""
    head = ("quantity", compared.one, compared.other, "difference", "U", "unit", "E_n", "")
    return head, [_agreement(name, unit, agreement, format_number) for name, (unit, agreement) in compared.rows.items()]


def _agreement(name: str, unit: str, agreement: Agreement, format_number: Written) -> tuple[str, ...]:
    verdict = "agree" if agreement.agrees else "do not agree"
    values = (
        format_number(agreement.a, 7),
        format_number(agreement.b, 7),
        format_number(agreement.difference, 2),
        format_number(agreement.expanded, 2),
    )
    return name, *values, unit, f"{agreement.e_n:.2f}", verdict
