"""compensate and export-model: a model for use in other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.terminal.complete import complete_data, complete_model
from rig.cli.terminal.options import input_range
from rig.cli.terminal.output import (
    FOLDER,
    Positive,
    bench_option,
    emit,
    json_option,
    note,
    out_option,
    range_option,
    require_outputs,
)
from rig.cli.terminal.progress import working
from rig.files import make_folder, program, write_whole
from rig.services.request import effects_of

if TYPE_CHECKING:
    from calibrations.compensation.inverse import Range, Residual
    from calibrations.model import Model


@click.command("compensate")
@click.argument("model", shell_complete=complete_model)
@click.option("--language", type=click.Choice(["c", "python", "json"]), required=True)
@click.option("--out", type=FOLDER, required=True, help="Write into this folder.")
@click.option("--name", help="Name of files and functions. Default: the name of the model file.")
@click.option("--precision", type=click.Choice(["double", "float"]), default="double", show_default=True)
@click.option("--range", "reach", type=float, help="Largest value of each axis in g (deg/s; field = 1). Default: 1.5.")
@range_option("Range of another input, such as temperature_c=0:60.")
@click.option("--leave-out", "without", multiple=True, metavar="EFFECT", help="Leave an effect out.")
@click.option(
    "--data",
    shell_complete=complete_data,
    help="Test the compensation on these poses, compared with a linear model fitted to them.",
)
@out_option("Write a picture of the test to this file.", "--picture")
@bench_option
@json_option
def compensate_command(
    model: str,
    language: str,
    out: Path,
    name: str | None,
    precision: str,
    reach: float | None,
    ranges: Sequence[str],
    without: Sequence[str],
    data: str | None,
    picture: Path | None,
    bench_file: Path | None,
    as_json: bool,
) -> None:
    """Write the inverse of MODEL: from voltages to accelerations along the reference axes.

    The code corrects every effect that can be inverted at run time; for the others it states the error that remains.
    The number of steps is fixed, with a proof that it is enough over the whole range.
    """
    from calibrations.compensation.document import summary
    from calibrations.compensation.inverse import compensate_residual, invert_model
    from calibrations.model.file import dump_model, read_model
    from rig.services.compensation import compensation_lines, instruction_for_test, origin_of, source_files
    from rig.services.load import check_unit

    if picture is not None and data is None:
        raise click.UsageError("--picture shows the test of --data: also give --data DATA")
    effects = effects_of(bench_file)
    source_model = read_model(model, effects)
    with working("inverting the model") as progress:
        compensation = invert_model(source_model, _range(source_model, reach, ranges), without, precision)
        origin = origin_of(model, name, dump_model(source_model))
        files = source_files(compensation, language, origin)
        residual = None
        if data is not None:
            from rig.services.tables import load

            progress.text = f"testing the compensation on {data}"
            table = load(data, notify=note)
            check_unit(source_model, table.unit, table.source)
            residual = compensate_residual(compensation, table)
    make_folder(out)
    require_outputs(*(out / file for file in files))
    for file, text in files.items():
        write_whole(out / file, text)
    _draw(residual, picture)
    paths = [*(str(out / file) for file in files), *([str(picture)] if picture else [])]
    if as_json:
        emit(summary(compensation, origin) | {"files": paths, "residual": residual.document() if residual else None})
        return
    lines = [*compensation_lines(compensation), *(residual.lines() if residual else [])]
    lines += [*(f"written: {path}" for path in paths), *instruction_for_test(language, str(out), origin.name)]
    click.echo("\n".join(lines))


def _draw(residual: Residual | None, picture: Path | None) -> None:
    """The picture of the test, where both are given."""
    if picture is not None and residual is not None:
        from calibrations.presentation.charts.motion import compensated_chart
        from calibrations.presentation.static import save

        save(compensated_chart(residual), picture)


def _range(model: Model, reach: float | None, ranges: Sequence[str]) -> Range:
    from calibrations.compensation.inverse import Range

    if reach is not None and not reach > 0:
        raise click.UsageError(f"--range is {reach:g}; it must be above 0")
    return Range.for_model(model, reach, **dict(map(input_range, ranges)))


FORMATS = ("px4", "ardupilot", "imu_calib", "imu_tk", "imucal", "kalibr", "openvins")


@click.command("export-model")
@click.argument("models", metavar="MODEL...", nargs=-1, required=True, shell_complete=complete_model)
@click.option("--for", "form", type=click.Choice(FORMATS), required=True, help="The program that reads the file.")
@out_option("The file.", required=True)
@click.option("--slot", type=click.IntRange(1, 3), default=1, show_default=True, help="Number of the sensor there.")
@click.option("--device-id", type=int, help="As the autopilot reports it; for one model.")
@click.option("--range", "reach", type=Positive(), help="Size of the input, g or deg/s. Default: 1 g, 300 deg/s.")
@range_option("Range of temperature_c or another input. Default: that of the calibration's data.")
@click.option("--topic", default="/imu0", show_default=True, help="Topic of the measurements (kalibr, openvins).")
@click.option("--rate", "rate_hz", type=Positive(), help="Measurements a second (kalibr, openvins).")
@click.option("--accelerometer-random-walk", "walk_a", type=Positive(), help="In m/s^3/sqrt(Hz), if the data has none.")
@click.option("--gyroscope-random-walk", "walk_g", type=Positive(), help="In rad/s^2/sqrt(Hz), if the data has none.")
@bench_option
@json_option
def export_model_command(
    models: Sequence[str],
    form: str,
    out: Path,
    slot: int,
    device_id: int | None,
    reach: float | None,
    ranges: Sequence[str],
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
    from calibrations.exporting.noise_files import ExportSettings
    from calibrations.model.file import read_model
    from rig.services.compensation import export_document, export_lines

    if form in NOISES and rate_hz is None:
        raise click.UsageError(f"--for {form} needs the number of measurements a second: give --rate HZ")
    if device_id is not None and len(models) > 1:
        raise click.UsageError("--device-id names one sensor; export one model at a time")
    effects = effects_of(bench_file)
    source_models = [read_model(model, effects) for model in models]
    walks = {"accelerometer": walk_a or 0.0, "gyroscope": walk_g or 0.0}
    comment = f"{', '.join(Path(model).name for model in models)}, written by {program()}"
    exported = export_model(
        source_models,
        form,
        comment,
        Slot(slot - 1, device_id),
        ExportSettings(topic, rate_hz or 0.0, walks),
        reach,
        dict(map(input_range, ranges)),
    )
    write_whole(out, exported.text)
    if as_json:
        emit(export_document(exported, form, models, out))
    else:
        click.echo("\n".join([*export_lines(exported), f"written: {out}"]))
