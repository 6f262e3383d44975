"""YAML of other people: data only, of bounded size however often it refers to itself.

The safe loader makes no objects but numbers, texts, dates, lists and mappings. An alias repeats a part without a copy;
nine levels of nine aliases are a page of text and a billion parts for whoever walks through them, so parts are counted
as they would be walked.
"""

from __future__ import annotations

from typing import Any

import yaml

LONGEST = 1 << 18  # characters: a bench with everything has a hundredth
MOST_PARTS = 100_000


def load_yaml(text: str) -> Any:
    """The document in `text`. Raises ValueError for what is no YAML, is too large, or contains itself."""
    if len(text) > LONGEST:
        raise ValueError(f"{len(text)} characters are more than the {LONGEST} that are read")
    try:
        document = yaml.safe_load(text)
        _require_bounded(document)
    except RecursionError:
        raise ValueError("its parts are nested too deeply") from None
    except (yaml.YAMLError, ArithmeticError, LookupError, TypeError, AttributeError) as error:
        raise ValueError(" ".join(str(error).split())) from None
    return document


def _require_bounded(document: Any) -> None:
    """Raises ValueError for a document of too many parts, counting what aliases repeat."""
    sizes: dict[int, int | None] = {}  # of parts that are done; None while they are being counted

    def size(part: Any) -> int:
        if not isinstance(part, (dict, list)):
            return 1
        if id(part) not in sizes:
            sizes[id(part)] = None
            parts = [*part, *part.values()] if isinstance(part, dict) else part
            sizes[id(part)] = 1 + sum(map(size, parts))
        if (found := sizes[id(part)]) is None:
            raise ValueError("a part of it contains itself")
        if found > MOST_PARTS:
            raise ValueError(f"it has more than {MOST_PARTS} parts; write it without aliases that repeat aliases")
        return found

    size(document)
