"""Names that an input can have in every language that is written: a column of a user's own may have any name."""

from __future__ import annotations

import re
from keyword import iskeyword

IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
TAKEN = re.compile(
    r"t\d+|in|out|step|math|memory|a[xyz]|v[xyz]|m\d+[xyz]"  # of the sources themselves
    r"|auto|case|char|const|default|do|double|enum|extern|float|goto|inline|int|long|register|restrict|short|signed"
    r"|sizeof|static|struct|switch|typedef|union|unsigned|void|volatile"  # of C
    r"|abs|min|max|fabs|sqrt|exp|log|sin|cos"  # functions
)


def can_be_written(name: str) -> bool:
    """Whether a source can have an input of that name beside its own words."""
    return bool(IDENTIFIER.fullmatch(name)) and not iskeyword(name) and not TAKEN.fullmatch(name)
