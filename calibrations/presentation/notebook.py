"""Results in a notebook: the text of the terminal, and the pictures of the report."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from html import escape

from calibrations.presentation.chart import Picture
from calibrations.presentation.page import pictures_html


def result_html(text: str, pictures: Sequence[Picture]) -> str:
    """`text`, then `pictures` with titles and captions. Their ids are those of this output alone: a notebook is one
    page, and clip paths of the same id in two outputs would be exchanged.
    """
    mark = hashlib.sha256(text.encode()).hexdigest()[:8]
    figures = pictures_html([replace(picture, name=f"{picture.name}-{mark}") for picture in pictures])
    return f'<pre>{escape(text)}</pre><div style="max-width: 60em; background: white; color: black">{figures}</div>'
