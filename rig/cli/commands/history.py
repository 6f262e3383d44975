"""history and control: the calibrations of a sensor, and the control charts of a rig."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import click

from calibrations.analyses.stability import YEAR_DAYS, Agreement
from calibrations.criteria import BASELINE_RUNS, FEWEST_RUNS
from calibrations.text import columns, concise_in_prefix
from drivers.errors import did_you_mean
from rig.cli.terminal.complete import complete_model, complete_sensor
from rig.cli.terminal.output import bench_option, emit, json_option, note, picture_options
from rig.cli.terminal.progress import working
from rig.record import Record
from rig.services.control import HEAD, OUT, ControlledQuantity, make_charts, row, signals, worst
from rig.services.history import Calibration, History, Quantity, changes, closest, history, latest, limits_of, stale
from rig.services.history_comparison import CalibrationComparison, compare_days, compare_rigs, compare_sensors
from rig.services.history_words import (
    agreements,
    but_stale,
    chart_verdict,
    closest_text,
    next_due,
    significance,
    summary,
)
from rig.services.request import effects_of

Near = tuple[Calibration, float] | None  # the calibration closest to a day, and its age on that day in days
DAY = click.DateTime(["%Y-%m-%d"])


@click.command("history")
@click.argument("sensor", shell_complete=complete_sensor)
@click.option(
    "--model",
    default="linear",
    shell_complete=complete_model,
    show_default=True,
    help="Model for the calibration of every run.",
)
@click.option("--quantity", "chosen", multiple=True, metavar="NAME", help="Only this quantity; repeatable.")
@click.option(
    "--limit",
    "changes_given",
    multiple=True,
    metavar="NAME=CHANGE",
    help="Largest allowed change since the last calibration; repeatable.",
)
@click.option(
    "--baseline",
    type=click.IntRange(min=FEWEST_RUNS),
    default=BASELINE_RUNS,
    help="Number of calibrations that set the control limits.",
)
@click.option("--at", "on", type=DAY, help="Find the calibration closest to this day, and check its age.")
@click.option("--between", nargs=2, type=DAY, help="Compare the calibrations closest to two days.")
@click.option("--beside", help="Compare with the last calibration of another sensor.")
@click.option("--rigs", nargs=2, help="Compare two rigs by all calibrations of this sensor on them.")
@picture_options("Write pictures into this folder.")
@bench_option
@json_option
def history_command(
    sensor: str,
    model: str,
    chosen: Sequence[str],
    changes_given: Sequence[str],
    baseline: int,
    on: Any,
    between: tuple[Any, Any] | None,
    beside: str | None,
    rigs: tuple[str, str] | None,
    folder: Path | None,
    form: str,
    bench_file: Path | None,
    as_json: bool,
) -> int:
    """Show the calibrations of SENSOR (its serial number): drift, control charts, due dates.

    The next calibration is due when the drift with its uncertainty may exceed a limit: limits.results in the bench
    file, or --limit. Exit status 1: the calibration at --at is stale, or a comparison does not agree.
    """
    from calibrations.model.file import read_model

    model_read = read_model(model, effects_of(bench_file))
    limits = changes(changes_given)
    with working("fitting the calibrations"), Record.to_read() as record:
        life = _select_quantities(
            history(record, sensor, model_read, limits_of(bench_file) | limits, baseline), chosen, limits
        )
        last = latest(record, beside, model_read) if beside is not None else None
    compared = [] if beside is None or last is None else [compare_sensors(life, beside, last)]
    compared += [compare_days(life, *(day.date() for day in between))] if between else []
    compared += [compare_rigs(life.calibrations, *rigs)] if rigs else []
    compared = [_chosen_rows(comparison, life) for comparison in compared]
    day = on.date() if on is not None else None
    calibration = closest(life.calibrations, day) if day is not None else None
    staleness = stale(life, *calibration) if calibration is not None else None
    paths = _draw(life, folder, form) if folder is not None else []
    if as_json:
        emit(document(life, calibration, staleness, compared))
    else:
        text = [*lines(life), *near_lines(calibration, day, staleness), *format_comparison(compared)]
        click.echo("\n".join([*text, *(f"written: {path}" for path in paths)]))
    return int(staleness is not None or not all(comparison.agree for comparison in compared))


def _select_quantities(life: History, names: Sequence[str], limited: Iterable[str]) -> History:
    """The history of the chosen quantities. Raises UsageError for an unknown quantity."""
    quantity_names = [q.name for q in life.quantities]
    for name in (*names, *limited):
        if name not in quantity_names:
            raise click.UsageError(
                f"the model {life.model} has no quantity {name!r}.{did_you_mean(name, quantity_names)}"
            )
    quantities = tuple(q for q in life.quantities if not names or q.name in names)
    return replace(life, quantities=quantities)


def _chosen_rows(compared: CalibrationComparison, life: History) -> CalibrationComparison:
    """The rows of the chosen quantities."""
    names = {q.name for q in life.quantities}
    return replace(compared, rows={name: row for name, row in compared.rows.items() if name in names})


def _draw(life: History, folder: Path, form: str) -> list[Path]:
    """The calibrations over time, and a control chart of each quantity."""
    from calibrations.presentation.charts.history import control_charts, lives
    from calibrations.presentation.static import save_all
    from rig.services.charts import life_of

    figures = {"life": lives([life_of(q) for q in life.quantities])}
    charts = {q.name: q.chart for q in life.quantities if q.chart is not None}
    if charts:
        figures["charts"] = control_charts(charts, {q.name: q.unit for q in life.quantities})
    return save_all(figures, folder, form)


# The history as tables and as JSON; the page uses the same sentences.


def lines(life: History) -> Iterator[str]:
    calibrations = life.calibrations
    yield summary(life)
    yield ""
    head = ("date", "data", "rig", *(q.name for q in life.quantities))
    yield columns(head, [_row(calibration, life.quantities) for calibration in calibrations])
    yield ""
    yield columns(("quantity", "drift a year", "scatter", "chart", "allowed", "due"), map(_stability, life.quantities))
    yield ""
    yield next_due(life, "--limit bias-x=0.005")
    yield from (f"{calibration.data}: {calibration.expired}." for calibration in calibrations if calibration.expired)
    yield from life.warnings
    for data, reason in life.passed_over.items():
        note(f"Not used: {data}: {reason}")


def _row(calibration: Calibration, quantities: Sequence[Quantity]) -> tuple[str, ...]:
    values = (calibration.values.get(q.name) for q in quantities)
    texts = ("-" if v is None else concise_in_prefix(v.value, v.std, v.unit) for v in values)
    return calibration.day, calibration.data, calibration.rig, *texts


def _stability(q: Quantity) -> tuple[str, ...]:
    line, verdict = q.line, chart_verdict(q) or "-"
    if line is None:
        return q.name, "-", "-", verdict, _limits_text(q), "-"
    drift = f"{concise_in_prefix(YEAR_DAYS * line.slope, YEAR_DAYS * line.slope_std, q.unit)}{significance(line)}"
    return q.name, drift, f"{line.scatter:.2g} {q.unit}", verdict, _limits_text(q), str(q.due or "-")


def _limits_text(q: Quantity) -> str:
    return "-" if q.allowed is None else f"{q.allowed[0]:.6g} .. {q.allowed[1]:.6g}"


def near_lines(closest: Near, on: date | None, staleness: str | None) -> Iterator[str]:
    if closest is not None and on is not None:
        yield closest_text(*closest, on)
    if staleness is not None:
        yield but_stale(staleness)


def format_comparison(compared: Sequence[CalibrationComparison]) -> Iterator[str]:
    for comparison in compared:
        yield f"\n{comparison.one} compared with {comparison.other}"
        yield columns(*agreements(comparison, lambda value, digits: f"{value:.{digits}g}"))


def document(
    life: History, closest: Near, staleness: str | None, compared: Sequence[CalibrationComparison]
) -> dict[str, Any]:
    return {
        "schema": "rig.history/1",
        "sensor": life.sensor,
        "model": life.model,
        "due": str(life.due) if life.due else None,
        "calibrations": [
            {"data": c.data, "at": c.at.isoformat(), "rig": c.rig, "expired": c.expired,
             "values": {name: vars(v) for name, v in c.values.items()}}
            for c in life.calibrations
        ],
        "quantities": [_quantity_document(q) for q in life.quantities],
        "passed_over": dict(life.passed_over),
        "warnings": list(life.warnings),
        "closest": None if closest is None else {"data": closest[0].data, "age_days": closest[1], "stale": staleness},
        "compared": [
            {"one": c.one, "other": c.other, "quantities": _agreements(c.rows)} for c in compared
        ],
    }  # fmt: skip


def _quantity_document(q: Quantity) -> dict[str, Any]:
    line = q.line
    return {
        "name": q.name,
        "unit": q.unit,
        "drift_per_year": None if line is None else YEAR_DAYS * line.slope,
        "drift_per_year_std": None if line is None else YEAR_DAYS * line.slope_std,
        "scatter": None if line is None else line.scatter,
        "chart": None if q.chart is None else q.chart.verdict,
        "allowed": None if q.allowed is None else list(q.allowed),
        "due": str(q.due) if q.due else None,
    }


def _agreements(rows: Mapping[str, tuple[str, Agreement]]) -> dict[str, Any]:
    return {
        name: {"difference": a.difference, "expanded": a.expanded, "e_n": a.e_n, "unit": unit, "agrees": a.agrees}
        for name, (unit, a) in rows.items()
    }


@click.command("control")
@click.argument("sensor", shell_complete=complete_sensor, required=False)
@click.option(
    "--baseline",
    type=click.IntRange(min=FEWEST_RUNS),
    default=BASELINE_RUNS,
    show_default=True,
    help="Runs that set the limits.",
)
@click.option("--since", metavar="RUN", help="Start with this run, for example the first one after a repair.")
@picture_options("Write the charts here.")
@json_option
def control_command(
    sensor: str | None, baseline: int, since: str | None, folder: Path | None, form: str, as_json: bool
) -> int:
    """Show control charts of `rig run check-standard` for SENSOR (its serial number), or for all check standards.

    The first runs set the limits. A later run outside them is out of control; so is a slow drift of the weighted mean.
    Exit status 1: out of control.
    """
    with Record.to_read() as record:
        quantities = make_charts(record.runs(), sensor, baseline, since)
    paths = _draw_charts(quantities, folder, form) if folder else []
    if as_json:
        emit(
            {
                "schema": "rig.control/1",
                "verdict": worst(quantities),
                "charts": [_chart_document(quantity) for quantity in quantities],
            }
        )
    else:
        click.echo(columns(HEAD, map(row, quantities)))
        lines = [line for quantity in quantities for line in signals(quantity)]
        click.echo("\n".join([*lines, *(f"written: {path}" for path in paths), worst(quantities)]))
    return int(worst(quantities) == OUT)


def _chart_document(controlled: ControlledQuantity) -> dict[str, Any]:
    chart = controlled.chart
    signals = [("individuals", k) for k in chart.jumps] + [("ewma", k) for k in chart.drifts]
    return {
        "sensor": controlled.sensor,
        "quantity": controlled.quantity,
        "unit": controlled.unit,
        "verdict": chart.verdict,
        "baseline": chart.judged,
        "centre": chart.centre,
        "sigma": chart.sigma,
        "limits": [chart.centre - chart.reach, chart.centre + chart.reach],
        "range_limit": chart.range_limit,
        "runs": list(controlled.runs),
        "values": chart.values.tolist(),
        "ewma": chart.ewma.tolist(),
        "ewma_limits": [[chart.centre - reach, chart.centre + reach] for reach in chart.ewma_reach.tolist()],
        "signals": [{"chart": name, "run": controlled.runs[k]} for name, k in signals],
    }


def _draw_charts(quantities: list[ControlledQuantity], folder: Path, form: str) -> list[Path]:
    """One picture for each sensor."""
    from calibrations.presentation.charts.history import control_charts
    from calibrations.presentation.static import save_all

    figures = {}
    for sensor in dict.fromkeys(quantity.sensor for quantity in quantities):
        of_sensor = [quantity for quantity in quantities if quantity.sensor == sensor]
        name = "".join(letter if letter.isalnum() else "-" for letter in sensor)
        charts = {quantity.quantity: quantity.chart for quantity in of_sensor}
        figures[f"control-{name}"] = control_charts(
            charts, {quantity.quantity: quantity.unit for quantity in of_sensor}
        )
    return save_all(figures, folder, form)
