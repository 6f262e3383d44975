"""The report on data, as `rig report` writes it and the workbench hands it over: pictures, and the page's maker."""

from __future__ import annotations

from collections.abc import Callable

from calibrations.discovery.verdict import Verdict
from calibrations.errors import UnusableData
from rig.services.load import loaded
from rig.services.next_experiment import planned
from rig.services.night import Page, night_of
from rig.services.provenance import program, today
from rig.services.request import Request
from rig.services.shaken import shaken_of


def reported(request: Request, tell: Callable[[str], None]) -> Page:
    """On a model, or on the night of a soak where none is named. Raises what `loaded` and `fit` raise, UnusableData."""
    night = night_of(request.data, today(), program()) if request.model is None and request.channel is None else None
    return night or _on_a_model(request, tell)


def _on_a_model(request: Request, tell: Callable[[str], None]) -> Page:
    asked = loaded(request, tell)
    beside = asked.data.compare(asked.model)
    if (reason := beside.rejection) is not None and reason.verdict == Verdict.NO_RESPONSE:
        raise UnusableData(f"{asked.data.source}: no report is written: {reason.verdict}: {reason.text}")
    found = asked.data.discover(asked.model, asked.effects)
    found = planned(found, request, asked.effects, tell)
    if asked.data.form == "samples":
        from calibrations.presentation.charts.noise import still_album
        from calibrations.presentation.report.still import still_report

        pictures = still_album(found, beside.fit)
        return pictures, lambda: still_report(found, beside, today(), program(), pictures)
    from calibrations.presentation.charts.discovery import album
    from calibrations.presentation.report.report import report

    shaken = shaken_of(request.data)
    pictures = album(found, beside, shaken)
    return pictures, lambda: report(found, beside, today(), program(), pictures, shaken)
