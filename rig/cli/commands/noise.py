"""noise: Allan deviation and noise coefficients of a still record."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from calibrations.noise.analysis import NoiseAnalysis, analyse, noise_document
from calibrations.noise.deviations import OVERLAPPING, curve_at
from rig.cli.terminal.complete import complete_data
from rig.cli.terminal.output import Positive, emit, json_option, note, notes, picture_options
from rig.cli.terminal.progress import working
from rig.services.request import Request

if TYPE_CHECKING:
    from calibrations.noise.record import Still


@click.command("noise")
@click.argument("data", shell_complete=complete_data)
@click.option("--channel", help="Of several channels: vx, vy ... Default: all axes of the first sensor.")
@click.option("--rate", "rate_hz", type=Positive(), help="Samples a second, for an array.")
@click.option(
    "--tau",
    "tau_s",
    type=Positive(),
    multiple=True,
    help="Averaging time, s, with every overlap; repeatable. Default: octaves.",
)
@picture_options("Write pictures here.")
@json_option
def noise_command(
    data: str,
    channel: str | None,
    rate_hz: float | None,
    tau_s: tuple[float, ...],
    folder: Path | None,
    form: str,
    as_json: bool,
) -> None:
    """Show how the noise of DATA averages, and which processes it is made of.

    DATA is a table of kind still, an array of samples (.npy, with --rate), or a run with a still record: noise-floor or
    soak. It is read once and is not held in memory, except for averaging times given with --tau. Disturbances that are
    not noise (a step, an output that follows a logged column) are removed first, as `rig diagnose` does.
    """
    from calibrations.presentation.noise_text import remarks

    with working("reading the record") as progress:
        still = _record(data, channel, rate_hz, tau_s)
        progress.text = "estimating the noise coefficients"
        analysis = analyse(still)
    notes(remarks(analysis))
    notes(rounded_times(tau_s, analysis))
    if as_json:
        emit(noise_document(analysis))
    else:
        click.echo(analysis.report())
    if folder is not None:
        from calibrations.presentation.charts.noise import noise_album
        from calibrations.presentation.static import save_all

        with working("drawing the pictures"):
            paths = save_all({picture.name: picture.chart for picture in noise_album(analysis)}, folder, form)
        notes(f"written: {path}" for path in paths)


def _record(data: str, channel: str | None, rate_hz: float | None, tau_s: tuple[float, ...]) -> Still:
    """The still record; with Allan deviations at the given averaging times, if there are some."""
    from rig.services.load import still_of

    blocks: dict[str, list[Any]] | None = {} if tau_s else None
    still = still_of(Request(data, channel=channel, rate_hz=rate_hz), note, every_deviation=True, keep=blocks)
    if blocks is None:
        return still
    curves = {}
    for axis, axis_blocks in blocks.items():
        values = np.concatenate([np.asarray(block, dtype=float) for block in axis_blocks])
        curves[axis] = {**still.deviations[axis], OVERLAPPING: curve_at(values, still.rate_hz, tau_s, still.source)}
    return replace(still, deviations=curves)


def rounded_times(tau_s: Iterable[float], analysis: NoiseAnalysis) -> Iterable[str]:
    """Notes on averaging times that are not whole numbers of samples."""
    taken_s = next(iter(analysis.channels.values())).allan.tau_s.tolist()
    for requested_s, used in zip(tau_s, taken_s, strict=False):
        if not np.isclose(requested_s, used):
            yield f"An averaging time of {requested_s:g} s is not a whole number of samples: {used:g} s is used."
