"""Pages that GitHub shows as well: their links, and the lists of a folder, as the site needs them.

CONTRIBUTING.md and SECURITY.md are outside docs/, and become pages of the site. The README.md of a folder lists its
pages by hand or by a program; the site's menu needs that list as a `toctree`.
"""

from __future__ import annotations

import re
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[2]
OUTSIDE = {"contributing": "CONTRIBUTING.md", "security": "SECURITY.md"}
FOLDERS = ("effects/README", "decisions/README")
UPWARDS = re.compile(r"\]\((?:\.\./)+(CONTRIBUTING|SECURITY)\.md")
LINK = re.compile(r"\]\((?!https?:|#)([^)\s]+)\)")


def read(_app: Sphinx, name: str, source: list[str]) -> None:
    """Change the text of page `name` in place, as Sphinx asks."""
    if name in OUTSIDE:
        source[0] = LINK.sub(_from_root, (ROOT / OUTSIDE[name]).read_text(encoding="utf-8"))
    source[0] = UPWARDS.sub(lambda found: f"](/{found[1].lower()}.md", source[0])
    if name in FOLDERS:
        source[0] += "\n```{toctree}\n:hidden:\n:glob:\n\n*\n```\n"


def _from_root(found: re.Match[str]) -> str:
    target = found[1]
    return f"](/{target.removeprefix('docs/')})" if target.startswith("docs/") else f"](../{target})"


def setup(app: Sphinx) -> dict[str, bool]:
    app.connect("source-read", read)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
