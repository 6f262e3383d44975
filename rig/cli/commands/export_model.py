"""export-model: write a model in the file format of PX4, ArduPilot, ROS, imucal, Kalibr or OpenVINS."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from rig.cli.terminal.complete import complete_model
from rig.cli.terminal.options import input_range
from rig.cli.terminal.output import Positive, bench_option, emit, json_option

FORMATS = ("px4", "ardupilot", "imu_calib", "imu_tk", "imucal", "kalibr", "openvins")


@click.command("export-model")
@click.argument("models", metavar="MODEL...", nargs=-1, required=True, shell_complete=complete_model)
@click.option("--for", "form", type=click.Choice(FORMATS), required=True, help="The program that reads the file.")
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="The file.")
@click.option("--slot", type=click.IntRange(1, 3), default=1, show_default=True, help="Number of the sensor there.")
@click.option("--device-id", type=int, help="As the autopilot reports it; for one model.")
@click.option("--range", "reach", type=Positive(), help="Size of the input, g or deg/s. Default: 1 g, 300 deg/s.")
@click.option(
    "--input",
    "given",
    multiple=True,
    metavar="NAME=LOW:HIGH",
    help="Range of temperature_c or another input. Default: that of the calibration's data.",
)
@click.option("--topic", default="/imu0", show_default=True, help="Topic of the measurements (kalibr, openvins).")
@click.option("--rate", "rate_hz", type=Positive(), help="Measurements a second (kalibr, openvins).")
@click.option("--accelerometer-random-walk", "walk_a", type=Positive(), help="In m/s^3/sqrt(Hz), if the data has none.")
@click.option("--gyroscope-random-walk", "walk_g", type=Positive(), help="In rad/s^2/sqrt(Hz), if the data has none.")
@bench_option
@json_option
def command(
    models: Sequence[str],
    form: str,
    out: Path,
    slot: int,
    device_id: int | None,
    reach: float | None,
    given: Sequence[str],
    topic: str,
    rate_hz: float | None,
    walk_a: float | None,
    walk_g: float | None,
    bench_file: Path | None,
    as_json: bool,
) -> None:
    """Write one or more MODELs of a unit's sensors as a file for another program.

    px4 and ardupilot take an accelerometer, a gyroscope and a magnetometer; imu_calib and imu_tk an accelerometer;
    imucal an accelerometer and a gyroscope; kalibr and openvins the noise of both. The command shows the error of each
    part that the format cannot hold.
    """
    from calibrations.exporting.autopilots import Slot
    from calibrations.exporting.formats import NOISES, export_model
    from calibrations.exporting.noise_files import Stream
    from calibrations.model.file import read_model
    from rig.files import program, require_out, write_whole
    from rig.services.compensation import export_document, export_lines
    from rig.services.request import effects_of

    if form in NOISES and rate_hz is None:
        raise click.UsageError(f"--for {form} needs the number of measurements a second: give --rate HZ")
    if device_id is not None and len(models) > 1:
        raise click.UsageError("--device-id is that of one sensor: export one model at a time")
    require_out(out, *models)
    effects = effects_of(bench_file)
    found = [read_model(model, effects) for model in models]
    walks = {"accelerometer": walk_a or 0.0, "gyroscope": walk_g or 0.0}
    comment = f"{', '.join(Path(model).name for model in models)}, written by {program()}"
    made = export_model(
        found,
        form,
        comment,
        Slot(slot - 1, device_id),
        Stream(topic, rate_hz or 0.0, walks),
        reach,
        dict(map(input_range, given)),
    )
    write_whole(out, made.text)
    if as_json:
        emit(export_document(made, form, models, out))
    else:
        click.echo("\n".join([*export_lines(made), f"written: {out}"]))
