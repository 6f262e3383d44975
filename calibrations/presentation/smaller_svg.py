"""SVG documents of matplotlib in fewer bytes: fewer digits, each style once, no indentation."""

from __future__ import annotations

import re
from collections import Counter

MARKERS = re.compile(r'<g([^>]*)>\s*((?:<use [^>]*? style="([^"]*)"/>\s*)(?:<use [^>]*? style="\3"/>\s*)*)</g>')
COORDINATES = re.compile(r' (?:x|y|d|width|height)="[^"]*"')
POINTS = re.compile(r"(<g[^>]*>)<use [^>]*/>\s*</g>\s*(?:\1<use [^>]*/>\s*</g>\s*)+")
FEWEST_USES = 3  # times the same style
FINE = re.compile(r"(\.\d\d)\d+")


def compact(text: str) -> str:
    """Shorten a drawing to about a third of its bytes, without a visible change."""
    text = MARKERS.sub(_hoist_style, text)
    text = POINTS.sub(_merge_groups, text)
    text = COORDINATES.sub(_round_attribute, text)
    return re.sub(r">\n\s+<", ">\n<", text)


def _hoist_style(match: re.Match[str]) -> str:
    """The markers of one line, their common style given once."""
    attributes, markers, style = match.groups()
    repeated = f' style="{style}"'
    return f"<g{attributes}{repeated}>{markers.replace(repeated, '')}</g>"


def _merge_groups(match: re.Match[str]) -> str:
    """Neighbouring markers of the same style in one group."""
    opening, markers = match[1], match[0]
    return f"{opening}{markers.replace(opening, '').replace('</g>', '')}</g>"


def _round_attribute(match: re.Match[str]) -> str:
    """One attribute with its numbers cut to two decimals, on one line."""
    return " " + " ".join(FINE.sub(r"\1", match[0]).split())


def compact_svg(text: str) -> str:
    """Shorten a drawing for a page with many: removes digits beyond 0.1 pt, names, and words for machines."""
    text = re.sub(r"<!DOCTYPE.*?>\s*|<metadata>.*?</metadata>\s*|<\?xml.*?\?>\s*", "", text, flags=re.DOTALL)
    text = re.sub(r'<g id="[^"]*"', "<g", text).replace("font-family: 'DejaVu Sans', Verdana, sans-serif; ", "")
    text = re.sub(r' transform="rotate\(-0 [^"]*"', "", text)
    text = COORDINATES.sub(lambda match: re.sub(r"\.0(?=[ \"])", "", re.sub(r"(\.\d)\d+", r"\1", match[0])), text)
    text = re.sub(r' d="M [-\d. L]*"', lambda path: path[0].replace(" L ", " "), text)
    text = text.replace("<svg ", "<svg font-family=\"'DejaVu Sans', Verdana, sans-serif\" ", 1)
    return re.sub(r">\n(?=</?[a-z])", ">", _classes(text)) + "\n"


def _classes(text: str) -> str:
    """Repeated styles are written once."""
    often = [s for s, n in Counter(re.findall(r' style="([^"]*)"', text)).items() if n >= FEWEST_USES]
    for k, style in enumerate(often):
        text = text.replace(f' style="{style}"', f' class="s{k}"')
    return text.replace("</style>", "".join(f".s{k}{{{style}}}" for k, style in enumerate(often)) + "</style>", 1)
