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
from rig.analysis.shaken import shaken_of
from rig.planning.foresight import with_next, with_noise_next


def reported(
    data: str,
    model: str | None,
    bench_file: Path | None,
    tell: Callable[[str], None],
    sampled: tuple[str | None, float | None] = (None, None),
) -> Page:
    """On a model, or on the night of a soak where none is named. Raises what `asked` and `fit` raise.

    `sampled` is the channel and the rate of a still record, where they are given.
    """
    night = night_of(data, today(), program()) if model is None else None
    still = None if night else asked_still(data, model, bench_file, *sampled, tell)
    if still is not None:
        return _on_noise(still, bench_file)
    return night or _on_a_model(data, model, bench_file, tell)


def _on_noise(asked: AskedStill, bench_file: Path | None) -> Page:
    found = with_noise_next(discover_noise(asked.still, asked.model, asked.effects), bench_file)
    beside = compare_noise(asked.still, asked.model)
    first = diagnose_noise(asked.still, asked.model, asked.effects)
    pictures = still_album(found, beside.fit)
    return pictures, lambda: still_report(found, first, beside, today(), program(), pictures)


def _on_a_model(data: str, model: str | None, bench_file: Path | None, tell: Callable[[str], None]) -> Page:
    table, start, effects = asked(data, model, bench_file, tell)
    found = with_next(discover(table, start, effects), data, effects, bench_file, tell)
    beside = compare(table, start)
    shaken = shaken_of(data)
    pictures = album(found, beside, shaken)
    return pictures, lambda: report(found, beside, today(), program(), pictures, shaken)
