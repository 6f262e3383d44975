"""noise: Allan deviation and noise coefficients of a still record."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import click

from rig.cli.output import Positive, emit, json_option, notes


@click.command("noise")
@click.argument("data")
@click.option("--channel", help="Of several channels: vx, vy ... Default: the first.")
@click.option("--rate", "rate_hz", type=Positive(), help="Samples a second, for an array.")
@click.option(
    "--tau",
    "tau_s",
    type=Positive(),
    multiple=True,
    help="Averaging time, s, with every overlap; repeatable. Default: octaves.",
)
@click.option("--pictures", "folder", type=click.Path(file_okay=False, path_type=Path), help="Write pictures here.")
@click.option("--format", "form", type=click.Choice(["png", "svg"]), default="png", show_default=True)
@json_option
def command(
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
    soak. It is read once, and never held in memory as a whole, unless times are asked for with --tau.
    """
    import numpy as np

    from calibrations.noise_analysis.analysis import analyse
    from calibrations.noise_analysis.asked_times import KIND, curve_at
    from calibrations.noise_analysis.document import noise_document
    from calibrations.still.disturbed import disturbed
    from calibrations.still.documents import disturbed_document
    from rig.analysis.still import stream
    from rig.cli.noise_words import remarks, summary, whole_samples
    from rig.record.store import Record

    with nullcontext() if Path(data).exists() or data.endswith(".npy") else Record.to_find(data) as record:
        samples = stream(record, data, channel, rate_hz)
        source = data if record is None else f"run {data}"
        if samples.others:
            source += f", channel {samples.channel} (--channel takes another: {', '.join(samples.others)})"
        if tau_s:
            whole = np.concatenate([np.asarray(block, dtype=float) for block in samples.blocks])
            samples = replace(samples, blocks=iter([whole]))
        found = analyse(samples.blocks, samples.rate_hz, samples.unit, source, samples.corner_hz)
        if tau_s:
            found = replace(found, curves={**found.curves, KIND: curve_at(whole, found.rate_hz, tau_s, source)})
    told = disturbed(found, samples.channel, samples.logged)
    notes(remarks(samples, found, told))
    notes(whole_samples(tau_s, found))
    if as_json:
        emit(noise_document(found) | disturbed_document(told))
    else:
        click.echo(summary(samples, found, told))
    if folder is not None:
        from calibrations.pictures.noise import noise_album
        from calibrations.pictures.save import save_all

        written = save_all({picture.name: picture.figure for picture in noise_album(found)}, folder, form)
        notes(f"written: {path}" for path in written)
