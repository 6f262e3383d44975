"""report: write a self-contained page on data and model, or its pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rig.cli.terminal.complete import complete_data
from rig.cli.terminal.options import request_options
from rig.cli.terminal.output import emit, model_option, note
from rig.cli.terminal.progress import working

if TYPE_CHECKING:
    from rig.services.request import Request


@click.command("report")
@click.argument("data", shell_complete=complete_data)
@model_option
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), help="Write the page to this HTML file.")
@click.option("--pictures", "folder", type=click.Path(file_okay=False, path_type=Path), help="Write all pictures here.")
@click.option("--format", "form", type=click.Choice(["png", "svg"]), default="png", show_default=True)
@request_options
def command(request: Request, out: Path | None, folder: Path | None, form: str, as_json: bool) -> None:
    """Write a page on DATA (a file or a run) and a model: missing effects, and the completed model.

    The page is one file and needs no network. For a soak without --model it shows the soak. --pictures writes the
    pictures, with or without the page.
    """
    if out is None and folder is None:
        raise click.UsageError("nothing to write: give --out FILE.html, --pictures FOLDER, or both")
    from calibrations.presentation.static import save_all
    from rig.files import write_whole
    from rig.services.load import require_output
    from rig.services.report import reported

    require_output(request, out)
    with working("fitting the model and searching for missing effects") as progress:
        pictures, page = reported(request, note, progress.searched)
        progress.text = "drawing the pictures"
        if out is not None:
            write_whole(out, page())
        written = save_all({picture.name: picture.chart for picture in pictures}, folder, form) if folder else []
    if as_json:
        emit({"schema": "rig.report/1", "out": str(out) if out else None, "pictures": [str(p) for p in written]})
    else:
        for path in [*([out] if out else []), *written]:
            click.echo(f"written: {path}")
