"""The report on data, as `rig report` writes it and the workbench hands it over: pictures, and what makes the page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from calibrations.compare import compare
from calibrations.discover import discover
from calibrations.pictures.album import album
from calibrations.reports.report import report
from rig.asked import asked
from rig.foresight import with_next
from rig.night import Page, night_of
from rig.provenance import program, today
from rig.shaken import shaken_of


def reported(data: str, model: str | None, bench_file: Path | None, tell: Callable[[str], None]) -> Page:
    """On a model, or on the night of a soak where none is named. Raises what `asked` and `fit` raise."""
    night = night_of(data, today(), program()) if model is None else None
    return night or _on_a_model(data, model, bench_file, tell)


def _on_a_model(data: str, model: str | None, bench_file: Path | None, tell: Callable[[str], None]) -> Page:
    table, start, effects = asked(data, model, bench_file, tell)
    found = with_next(discover(table, start, effects), data, effects, bench_file, tell)
    beside = compare(table, start)
    shaken = shaken_of(data)
    pictures = album(found, beside, shaken)
    return pictures, lambda: report(found, beside, today(), program(), pictures, shaken)
