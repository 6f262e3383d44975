"""What results may come to before a sensor has to be calibrated again: of the bench file, and as a person says it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from rig.errors import RigError
from rig.services.history import Limit


def limits_of(bench_file: Path | None) -> dict[str, Limit]:
    """The ranges in the bench file's `limits.results`; a magnitude says nothing of a change. Raises BenchError."""
    if bench_file is None:
        return {}
    from rig.bench import read_bench

    return {name: each for name, each in read_bench(bench_file).result_limits.items() if isinstance(each, tuple)}


def changes(given: Iterable[str]) -> dict[str, float]:
    """`bias-x=0.005`: the greatest change since the last calibration, by result's name. Raises RigError."""
    return dict(_change(text) for text in given)


def _change(text: str) -> tuple[str, float]:
    name, _, number = text.partition("=")
    try:
        change = abs(float(number))
    except ValueError:
        change = math.nan
    if not math.isfinite(change):
        raise RigError(f"the limit {text!r} is none: write NAME=CHANGE, as in bias-x=0.005")
    return name, change
