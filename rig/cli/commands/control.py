"""control: control charts of the check standard; is the rig in control?"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from calibrations.criteria import BASELINE_RUNS, FEWEST_RUNS
from calibrations.text import columns
from rig.cli.terminal.complete import complete_sensor
from rig.cli.terminal.output import emit, json_option
from rig.record import Record
from rig.services.control import HEAD, OUT, Controlled, controlled, row, signals, worst


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
@click.option("--pictures", "folder", type=click.Path(file_okay=False, path_type=Path), help="Write the charts here.")
@click.option("--format", "form", type=click.Choice(["png", "svg"]), default="png", show_default=True)
@json_option
def command(sensor: str | None, baseline: int, since: str | None, folder: Path | None, form: str, as_json: bool) -> int:
    """Show control charts of `rig run check-standard` for SENSOR (its serial number), or for all check standards.

    The first runs set the limits. A later run outside them is out of control; so is a slow drift of the weighted mean.
    Exit status 1: out of control.
    """
    with Record.to_read() as record:
        found = controlled(record.runs(), sensor, baseline, since)
    written = _write(found, folder, form) if folder else []
    if as_json:
        emit({"schema": "rig.control/1", "verdict": worst(found), "charts": [_document(each) for each in found]})
    else:
        click.echo(columns(HEAD, map(row, found)))
        lines = [line for each in found for line in signals(each)]
        click.echo("\n".join([*lines, *(f"written: {path}" for path in written), worst(found)]))
    return int(worst(found) == OUT)


def _document(each: Controlled) -> dict[str, Any]:
    chart = each.chart
    signals = [("individuals", k) for k in chart.jumps] + [("ewma", k) for k in chart.drifts]
    return {
        "sensor": each.sensor,
        "quantity": each.quantity,
        "unit": each.unit,
        "verdict": chart.verdict,
        "baseline": chart.judged,
        "centre": chart.centre,
        "sigma": chart.sigma,
        "limits": [chart.centre - chart.reach, chart.centre + chart.reach],
        "range_limit": chart.range_limit,
        "runs": list(each.runs),
        "values": chart.values.tolist(),
        "ewma": chart.ewma.tolist(),
        "ewma_limits": [[chart.centre - reach, chart.centre + reach] for reach in chart.ewma_reach.tolist()],
        "signals": [{"chart": name, "run": each.runs[k]} for name, k in signals],
    }


def _write(found: list[Controlled], folder: Path, form: str) -> list[Path]:
    """One picture for each sensor."""
    from calibrations.presentation.charts.history import control_charts
    from calibrations.presentation.static import save_all

    figures = {}
    for sensor in dict.fromkeys(each.sensor for each in found):
        mine = [each for each in found if each.sensor == sensor]
        name = "".join(letter if letter.isalnum() else "-" for letter in sensor)
        charts, units = {each.quantity: each.chart for each in mine}, {each.quantity: each.unit for each in mine}
        figures[f"control-{name}"] = control_charts(charts, units)
    return save_all(figures, folder, form)
