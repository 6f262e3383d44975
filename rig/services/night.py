"""The page on a soak, for `rig report RUN`: asked for by the run's procedure, unless a model is named."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from rig.record import Record
from rig.record.measured import Measured

if TYPE_CHECKING:
    from calibrations.presentation.chart import Picture

Page = tuple[list["Picture"], Callable[[], str]]


def night_of(data: str, date: str, program: str) -> Page | None:
    """The pictures of a soak and what makes its page; None where `data` is no run of a soak.

    Raises RecordError, DataError where it holds too little.
    """
    if not Record.is_there():
        return None
    with Record.to_read() as record:
        if data.partition("/")[0] not in {run.run for run in record.runs() if run.procedure == "soak"}:
            return None
        from calibrations.presentation.charts.soak import soak_album
        from calibrations.presentation.report.soak import soak_report
        from rig.results.soak import foreseen_of, night

        measured = Measured.named(record, data)
        found, foreseen = night(measured), foreseen_of(measured)
    pictures, facts = soak_album(found, foreseen), _facts(measured, date, program)
    return pictures, lambda: soak_report(found, measured.run.results, facts, pictures, foreseen)


def _facts(measured: Measured, date: str, program: str) -> Mapping[str, str]:
    run = measured.run
    sensor = [str(measured.constants[name]) for name in ("sensor", "serial") if name in measured.constants]
    said = {
        role: " ".join(str(part) for part in identity.values() if part) for role, identity in run.identities.items()
    }
    return {
        "sensor": " ".join(sensor) or run.source,
        "run": f"{measured.name}, {run.state}",
        "begun": run.created,
        "ended": run.ended or "–",
        "settings": ", ".join(f"{name} {value}" for name, value in run.settings.items()),
        **said,
        "program": program,
        "date": date,
    }
