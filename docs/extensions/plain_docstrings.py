"""Docstrings of this project are plain text with indented formulas and lists; Sphinx reads reStructuredText.

An indented part and a drawn tree are shown as they are written. In the other lines, the marks of reStructuredText
have no meaning, except `code`.
"""

from __future__ import annotations

import re
import textwrap
from typing import Any

from sphinx.application import Sphinx

MARKS = re.compile(r"(`[^`]+`)|([*|\\])|(\w)(_)(?!\w)")


def plain(_app: Sphinx, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Rewrite `lines` in place, as Sphinx asks."""
    made: list[str] = []
    within = False
    for line in _trees_indented(lines):
        indented = line.startswith("  ")
        if indented and not within:
            made += ["", "::", ""]
        if within and line and not indented:
            made.append("")
        within = indented or (within and not line)
        made.append(line if within else MARKS.sub(_escaped, line))
    lines[:] = made


def _trees_indented(lines: list[str]) -> list[str]:
    """A paragraph with a branch of a tree becomes an indented one."""
    paragraphs = "\n".join(lines).split("\n\n")
    drawn = [textwrap.indent(part, "    ") if re.search("^[├└]", part, re.MULTILINE) else part for part in paragraphs]
    return "\n\n".join(drawn).split("\n")


def _escaped(found: re.Match[str]) -> str:
    code, mark, letter, _ = found.groups()
    if code:
        return f"`{code}`"
    return f"\\{mark}" if mark else f"{letter}\\_"


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("autodoc-process-docstring", plain)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
