"""The report on data, as `rig report` writes it and the workbench hands it over: pictures, and what makes the page."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from calibrations.compare import compare
from calibrations.discover import discover
from calibrations.pictures.album import album
from calibrations.pictures.still import still_album
from calibrations.reports.report import report
from calibrations.reports.still import still_report
from calibrations.still.compare import compare as compare_noise
from calibrations.still.diagnose import diagnose as diagnose_noise
from calibrations.still.discover import discover as discover_noise
from rig.analysis.asked import asked
from rig.analysis.asked_still import AskedStill, asked_still
from rig.analysis.night import Page, night_of
from rig.analysis.provenance import program, today
from rig.analysis.request import Request
from rig.analysis.shaken import shaken_of
from rig.planning.foresight import with_next, with_noise_next


def reported(request: Request, tell: Callable[[str], None]) -> Page:
    """On a model, or on the night of a soak where none is named. Raises what `asked` and `fit` raise."""
    night = night_of(request.data, today(), program()) if request.model is None and request.channel is None else None
    still = None if night else asked_still(request, tell)
    if still is not None:
        return _on_noise(still, request.bench_file)
    return night or _on_a_model(request, tell)


def _on_noise(asked: AskedStill, bench_file: Path | None) -> Page:
    found = with_noise_next(discover_noise(asked.still, asked.model, asked.effects), bench_file)
    beside = compare_noise(asked.still, asked.model)
    first = diagnose_noise(asked.still, asked.model, asked.effects)
    pictures = still_album(found, beside.fit)
    return pictures, lambda: still_report(found, first, beside, today(), program(), pictures)


def _on_a_model(request: Request, tell: Callable[[str], None]) -> Page:
    table, start, effects = asked(request, tell)
    found = with_next(discover(table, start, effects), request.data, effects, request.bench_file, tell)
    beside = compare(table, start)
    shaken = shaken_of(request.data)
    pictures = album(found, beside, shaken)
    return pictures, lambda: report(found, beside, today(), program(), pictures, shaken)
