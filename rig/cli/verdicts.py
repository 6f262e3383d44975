"""Results of a run in words: value, uncertainty, limit, verdict."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from calibrations.model import Estimate
from rig.cli.output import columns
from rig.cli.words import with_uncertainty


def lines(results: Mapping[str, Any]) -> list[str]:
    """A table of the results of a run, none where it has none."""
    if not results:
        return []
    rows = [
        (
            name,
            with_uncertainty(Estimate(name, "", r["value"], r["std"], r["unit"])),
            _limit(r["limit"]),
            r["verdict"] or "",
        )
        for name, r in results.items()
    ]
    return columns(("result", "value", "limit", "verdict"), rows).splitlines()


def _value(name: str, result: Mapping[str, Any]) -> str:
    return with_uncertainty(Estimate(name, "", result["value"], result["std"], result["unit"]))


def _limit(limit: Any) -> str:
    if limit is None:
        return "-"
    return f"{limit[0]:g} .. {limit[1]:g}" if isinstance(limit, (list, tuple)) else f"+-{limit:g}"
