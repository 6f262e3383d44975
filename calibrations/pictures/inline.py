"""A picture as part of an HTML page: nothing that reaches beyond the page, and names that no other picture has."""

from __future__ import annotations

import re
from html import escape

from matplotlib.figure import Figure

from calibrations.pictures.save import svg

DROPPED = (r"<metadata>.*?</metadata>", r"<style.*?</style>", r' xmlns(:\w+)?="[^"]*"', r' (width|height)="[\d.]+pt"')


def inline(figure: Figure, name: str, words: str) -> str:
    """The figure as an SVG element whose ids begin with `name`; `words` are for those who cannot see it."""
    text = svg(figure).decode()
    text = text[text.index("<svg") :].strip()
    for pattern in DROPPED:
        text = re.sub(pattern, "", text, flags=re.DOTALL)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = text.replace("url(#", f"url(#{name}-").replace("xlink:href", "href").replace('href="#', f'href="#{name}-')
    return text.replace("<svg", f'<svg role="img" aria-label="{escape(words)}"', 1)
