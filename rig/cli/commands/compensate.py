"""compensate: write the inverse of a model as source code for the product."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.terminal.complete import complete_data, complete_model
from rig.cli.terminal.options import input_range
from rig.cli.terminal.output import bench_option, emit, json_option, note
from rig.cli.terminal.progress import working

if TYPE_CHECKING:
    from calibrations.compensation.inverse import Range
    from calibrations.model import Model


@click.command("compensate")
@click.argument("model", shell_complete=complete_model)
@click.option("--language", type=click.Choice(["c", "python", "json"]), required=True)
@click.option("--out", type=click.Path(file_okay=False, path_type=Path), required=True, help="Write into this folder.")
@click.option("--name", help="Name of files and functions. Default: the name of the model file.")
@click.option("--precision", type=click.Choice(["double", "float"]), default="double", show_default=True)
@click.option("--range", "reach", type=float, help="Largest value of each axis in g (deg/s; field = 1). Default: 1.5.")
@click.option(
    "--input",
    "given",
    multiple=True,
    metavar="NAME=LOW:HIGH",
    help="Range of another input, such as temperature_c=0:60.",
)
@click.option("--leave-out", "without", multiple=True, metavar="EFFECT", help="Leave an effect out.")
@click.option(
    "--data",
    shell_complete=complete_data,
    help="Test the compensation on these poses, compared with a linear model fitted to them.",
)
@click.option(
    "--picture", type=click.Path(dir_okay=False, path_type=Path), help="Write a picture of the test to this file."
)
@bench_option
@json_option
def command(
    model: str,
    language: str,
    out: Path,
    name: str | None,
    precision: str,
    reach: float | None,
    given: Sequence[str],
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
    from calibrations.compensation.inverse import compensated_residual, invert_model
    from calibrations.model.file import dump_model, read_model
    from rig.files import make_folder, write_whole
    from rig.services.compensation import compensation_lines, how_to_test, origin_of, source_files
    from rig.services.load import check_unit
    from rig.services.request import effects_of

    if picture is not None and data is None:
        raise click.UsageError("--picture shows the test of --data: also give --data DATA")
    effects = effects_of(bench_file)
    found = read_model(model, effects)
    with working("inverting the model") as progress:
        made = invert_model(found, _range(found, reach, given), without, precision)
        origin = origin_of(model, name, dump_model(found))
        files = source_files(made, language, origin)
        beside = None
        if data is not None:
            from rig.services.tables import load

            progress.text = f"testing the compensation on {data}"
            table = load(data, tell=note)
            check_unit(found, table.unit, table.source)
            beside = compensated_residual(made, table)
    make_folder(out)
    for file, text in files.items():
        write_whole(out / file, text)
    if picture is not None and beside is not None:
        from calibrations.presentation.charts.motion import compensated
        from calibrations.presentation.static import save

        save(compensated(beside), picture)
    paths = [*(str(out / file) for file in files), *([str(picture)] if picture else [])]
    if as_json:
        emit(summary(made, origin) | {"files": paths, "residual": beside.document() if beside else None})
    else:
        click.echo(
            "\n".join(
                [
                    *compensation_lines(made),
                    *(beside.lines() if beside else []),
                    *(f"written: {path}" for path in paths),
                    *how_to_test(language, str(out), origin.name),
                ]
            )
        )


def _range(model: Model, reach: float | None, given: Sequence[str]) -> Range:
    from calibrations.compensation.inverse import Range

    if reach is not None and not reach > 0:
        raise click.UsageError(f"--range is {reach:g}; it must be above 0")
    return Range.for_model(model, reach, **dict(map(input_range, given)))
