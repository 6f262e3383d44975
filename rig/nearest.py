"""The known name nearest to a misspelt one, for messages."""

from __future__ import annotations

from collections.abc import Iterable


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The name in `known` most like `name`, or None when none resembles it."""
    import difflib

    found = difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)
    return found[0] if found else None


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """The tail of a message about an unknown `name`: the nearest one, else all there are."""
    choices = sorted(known)
    near = nearest(name, choices)
    if near:
        return f" Did you mean {near!r}?"
    return f" There are: {', '.join(choices)}." if choices else ""
