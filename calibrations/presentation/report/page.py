"""The page of every report: no network, with verdict, headline, figures and provenance."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from calibrations.presentation.chart import Picture
from calibrations.presentation.static import inline


def page(template: str, **values: Any) -> str:
    """The page as HTML text: `values` in `template`, which extends `page.html`."""
    return _templates().get_template(template).render(values)


def figure(picture: Picture) -> dict[str, Any]:
    """A picture as a page takes it: drawn, with title and caption."""
    drawn = Markup(inline(picture.chart, picture.name, f"{picture.title}. {picture.caption}"))  # noqa: S704 made here
    return {"svg": drawn, "title": picture.title, "caption": picture.caption}


def figures_html(pictures: Sequence[Picture]) -> str:
    """The pictures as the reports show them, each with title and caption: HTML text."""
    shown = _templates().get_template("picture.html").module
    return "".join(str(shown.picture(figure(each))) for each in pictures)  # type: ignore[attr-defined]


@cache
def _templates() -> Environment:
    return Environment(
        loader=PackageLoader("calibrations.presentation", "report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
