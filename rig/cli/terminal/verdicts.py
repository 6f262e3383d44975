"""Results of a run in words: value, uncertainty, limit, verdict."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from calibrations.presentation.text import bound, columns, concise

SPREADS = re.compile("tolerance|wander")  # uncertainties themselves: two digits


def lines(results: Mapping[str, Any]) -> list[str]:
    """A table of the results of a run, none where it has none."""
    if not results:
        return []
    rows = [(name, _value(name, r), _limit(r["value"], r["limit"]), r["verdict"] or "") for name, r in results.items()]
    return columns(("result", "value", "limit", "verdict"), rows).splitlines()


def _value(name: str, result: Mapping[str, Any]) -> str:
    if SPREADS.search(name):
        return f"{result['value']:.2g} {result['unit']}"
    return concise(result["value"], result["std"], result["unit"])


def _limit(value: float, limit: Any) -> str:
    if limit is None:
        return "-"
    return bound(value, limit).replace("−", "-")
