"""Documents as HTML: one page that needs no network, with its pictures inside."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from calibrations.presentation.chart import Picture
from calibrations.presentation.document import Block, Page
from calibrations.presentation.static import inline


def html(page: Page) -> str:
    """The page as text; the same page gives the same text."""
    return templates().get_template("page.html").render(page=page)


def pictures_html(pictures: Sequence[Picture]) -> str:
    """The pictures as a page shows them, each with title and caption: HTML text."""
    macros = templates().get_template("blocks.html").module
    return "".join(str(macros.block(picture)) for picture in pictures)  # type: ignore[attr-defined]


@cache
def templates() -> Environment:
    """The templates of this package. HTML and XML escape their variables."""
    environment = Environment(
        loader=PackageLoader("calibrations.presentation"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"kind": _kind, "drawn": _markup}
    return environment


def _kind(block: Block) -> str:
    """`paragraph`, `table`, `picture` ..."""
    return "paragraph" if isinstance(block, str) else type(block).__name__.lower()


def _markup(picture: Picture) -> Markup:
    """The picture as SVG, with words for screen readers."""
    return Markup(inline(picture.chart, picture.name, f"{picture.title}. {picture.caption}"))  # noqa: S704 made here
