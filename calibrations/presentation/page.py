"""Documents as HTML: one page that needs no network, with its pictures inside; and results in a notebook."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from html import escape

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


def result_html(text: str, pictures: Sequence[Picture]) -> str:
    """`text`, then `pictures` with titles and captions. Their ids are those of this output alone: a notebook is one
    page, and clip paths of the same id in two outputs would be exchanged.
    """
    mark = hashlib.sha256(text.encode()).hexdigest()[:8]
    figures = pictures_html([replace(picture, name=f"{picture.name}-{mark}") for picture in pictures])
    return (
        f'<pre style="white-space: pre-wrap">{escape(text)}</pre>'
        f'<div style="max-width: 60em; background: white; color: black">{figures}</div>'
    )


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
    return Markup(inline(picture.chart, picture.name, picture.words))  # noqa: S704 made here
