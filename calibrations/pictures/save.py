"""Pictures as files. The same figure gives the same bytes: fixed names inside, no dates."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib import rc_context
from matplotlib.figure import Figure

from calibrations.errors import CalibrationError
from calibrations.pictures.compact import compact
from calibrations.pictures.style import RC


class PictureError(CalibrationError):
    """A picture cannot be written: its format, or its place."""


def svg(figure: Figure) -> bytes:
    """The figure as an SVG document; its text stays text, in a font that is as wide where the first is not there."""
    text = _bytes(figure, "svg", {"Date": None, "Creator": None}).decode()
    return compact(text.replace("'DejaVu Sans'", "'DejaVu Sans', Verdana, sans-serif")).encode()


def png(figure: Figure) -> bytes:
    """The figure as a PNG, 150 dots an inch."""
    return _bytes(figure, "png", {"Software": None})


def _bytes(figure: Figure, form: str, metadata: dict[str, None]) -> bytes:
    page = io.BytesIO()
    with rc_context(RC):
        figure.savefig(page, format=form, metadata=metadata)
    return page.getvalue()


def save(figure: Figure, path: Path) -> None:
    """Write the figure to `path`, whole or not at all; its ending says which format.

    Raises PictureError for another ending than .png and .svg, or where the file cannot be written.
    """
    formats: dict[str, Callable[[Figure], bytes]] = {".png": png, ".svg": svg}
    make = formats.get(path.suffix.lower())
    if make is None:
        raise PictureError(f'{path}: pictures end in .png or .svg, not in "{path.suffix}"; rename it')
    draft = path.with_name(f".{path.name}.part")
    try:
        draft.write_bytes(make(figure))
        draft.replace(path)
    except OSError as error:
        draft.unlink(missing_ok=True)
        raise PictureError(f"{path}: the picture cannot be written: {error.strerror}") from None


def save_all(figures: Mapping[str, Figure], folder: Path, form: str) -> list[Path]:
    """Write figures by name into `folder`, made where it is not there; their paths. Raises PictureError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PictureError(f"{folder}: the folder cannot be made: {error.strerror}") from None
    paths = {folder / f"{name}.{form}": figure for name, figure in figures.items()}
    for path, figure in paths.items():
        save(figure, path)
    return list(paths)
