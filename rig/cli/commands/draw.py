"""draw: draw the stages and the mounting of the sensor, as an SVG file or in the terminal."""

from __future__ import annotations

import math
from pathlib import Path

import click

from rig.cli.terminal.output import emit, json_option


def _svg(context: click.Context, parameter: click.Parameter, out: Path | None) -> Path | None:  # noqa: ARG001
    if out is not None and out.suffix.lower() != ".svg":
        raise click.BadParameter(f"{out}: a drawing is an SVG file; name it {out.with_suffix('.svg').name}")
    return out


def _finite(context: click.Context, parameter: click.Parameter, deg: float) -> float:  # noqa: ARG001
    if not math.isfinite(deg):
        raise click.BadParameter(f"{deg:g} is not an angle")
    return deg


@click.command("draw")
@click.option("--alpha", default=0.0, callback=_finite, metavar="DEG", help="Angle of alpha, which tilts the table.")
@click.option("--beta", default=0.0, callback=_finite, metavar="DEG", help="Angle of beta, which turns the table.")
@click.option("--mount", default=0.0, callback=_finite, metavar="DEG", help="Rotation of the sensor about its z axis.")
@click.option("--flip", default=0, type=click.IntRange(0, 1), help="1: the sensor is mounted face down.")
@click.option(
    "--out",
    type=click.Path(dir_okay=False, path_type=Path),
    callback=_svg,
    help="Write the drawing to this file, FILE.svg.",
)
@json_option
def command(alpha: float, beta: float, mount: float, flip: int, out: Path | None, as_json: bool) -> None:
    """Draw the stages and the mounting of the sensor, and print its specific force at rest.

    Without --out, a sketch of the table appears in the terminal.
    """
    from rig.drawings import Attitude, page, sketch
    from rig.files import write_whole

    attitude = Attitude(alpha, beta, mount, flip)
    if out is not None:
        write_whole(out, page(attitude))
    force_g = dict(zip("xyz", attitude.specific_force_g, strict=True))
    if as_json:
        emit({"schema": "rig.drawing/1", "out": str(out) if out else None, "specific_force_g": force_g})
        return
    specific_force = ", ".join(f"{axis} {value:+.4f}" for axis, value in force_g.items())
    shown = [f"written: {out}"] if out else [*sketch(attitude), "o: pin 1; view from above the table"]
    click.echo("\n".join([attitude.words, *shown, f"Specific force at rest, in g: {specific_force}"]))
