"""The report on data for `rig report` and the workbench: its pictures, and a function that makes the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calibrations.analyses.motion import MotionResult
from calibrations.discovery.results import Discovery
from calibrations.discovery.verdict import Verdict
from calibrations.errors import UnusableData
from calibrations.text import with_times
from procedures.settings import setting_label, setting_text
from rig.files import program
from rig.record import Record
from rig.record.measured import INTERRUPTIONS, MeasuredRun
from rig.results.samples import compare_with_displacement
from rig.services.load import AnalysisInput, load_request
from rig.services.next_experiment import planned
from rig.services.provenance import today
from rig.services.request import Request

if TYPE_CHECKING:
    from calibrations.design.experiment import Experiment
    from calibrations.discovery.findings import Findings
    from calibrations.effects import Effect
    from calibrations.presentation.chart import Picture
    from rig.services.session import ModelSession


def of_run(data: str) -> tuple[MotionResult | None, Mapping[str, Any]]:
    """Both models compared with the displacement sensor, None for a run of another procedure; and the run's results.

    (None, {}) where `data` is a file. Raises SensorFault, RecordError, DataError.
    """
    if Path(data).exists():
        return None, {}
    with Record.to_find(data) as record:
        measured = MeasuredRun.named(record, data)
        motion = compare_with_displacement(measured) if measured.run.procedure == "motion" else None
        return motion, measured.run.results


# The page on a soak, for `rig report RUN` without --model.


Page = tuple[list["Picture"], Callable[[], str]]


def soak_report_of(data: str, date: str, program: str) -> Page | None:
    """The pictures of a soak and the function that makes its page; None if `data` is not a run of a soak.

    Raises RecordError, DataError where it holds too little.
    """
    if not Record.is_there():
        return None
    with Record.to_read() as record:
        if data.partition("/")[0] not in {run.run for run in record.runs() if run.procedure == "soak"}:
            return None
        from calibrations.presentation.charts.soak import soak_album
        from calibrations.presentation.report.soak import soak_report
        from rig.results.soak import read_forecasts, read_soak

        measured = MeasuredRun.named(record, data)
        result, forecasts = read_soak(measured), read_forecasts(measured)
    pictures, facts = soak_album(result, forecasts), _facts(measured, date, program)
    return pictures, lambda: soak_report(result, measured.run.results, facts, pictures, forecasts)


def _facts(measured: MeasuredRun, date: str, program: str) -> Mapping[str, str]:
    run = measured.run
    sensor = [str(measured.constants[name]) for name in ("sensor", "serial") if name in measured.constants]
    return {
        "sensor": " ".join(sensor) or run.source,
        "run": f"{measured.name}, {run.state}",
        "begun": with_times(run.created),
        "ended": with_times(run.ended or "–"),
        INTERRUPTIONS: with_times(str(measured.constants.get(INTERRUPTIONS, "none"))),
        "settings": "; ".join(f"{setting_label(name)}: {setting_text(value)}" for name, value in run.settings.items()),
        **run.instruments,
        "program": program,
        "date": date,
    }


# The page on data and a model.


Searched = Callable[[Mapping[str, "Effect"]], Mapping[str, "Effect"]]


def make_report(
    request: Request,
    notify: Callable[[str], None],
    searched: Searched,
    session: Callable[[], ModelSession[Any]] | None = None,
    plans_next: bool = True,
) -> Page:
    """On a model, or on a soak where no model is named.

    Raises what `load_request` and `fit` raise, UnusableData.

    `searched` makes the effects of the search, which report its progress and may end it. `session`: opens that of a
    page, so that the page and its report show the same rows, and share the search. `plans_next`: whether the report on
    rows has the next experiment, whose plan takes longer than all else; without it, a page shows `next_of` beside it.
    """
    if request.model is None and request.channel is None:
        soak_report = soak_report_of(request.data, today(), program())
        if soak_report is not None:
            return soak_report
    if session is None:
        question, opened = load_request(request, notify), None
    else:
        opened = session()
        question = AnalysisInput(opened.data, opened.model, opened.effects)

    def search() -> Findings[Any]:
        shared = opened.first_search(searched) if opened is not None else None
        return shared or question.data.search(question.model, searched(question.effects))

    return _model_page(request, question, notify, search, plans_next)


def _model_page(
    request: Request,
    question: AnalysisInput,
    notify: Callable[[str], None],
    search: Callable[[], Findings[Any]],
    plans_next: bool,
) -> Page:
    comparison = question.data.compare(question.model)
    if (reason := comparison.rejection) is not None and reason.verdict == Verdict.NO_RESPONSE:
        raise UnusableData(f"{question.data.source}: no report is written: {reason.verdict}: {reason.text}")
    discovery = Discovery.of(search())
    is_planned = plans_next or discovery.next_experiment is None or question.data.form == "samples"
    if is_planned:
        discovery = planned(discovery, request, question.effects, notify)
    if question.data.form == "samples":
        from calibrations.presentation.charts.noise import still_album
        from calibrations.presentation.report.still import still_report

        pictures = still_album(discovery.end, comparison.fit)
        return pictures, lambda: still_report(discovery, comparison, today(), program(), pictures)
    from calibrations.presentation.charts.discovery import album
    from calibrations.presentation.report.report import report

    motion, results = of_run(request.data)
    pictures = album(discovery, comparison, motion)
    return pictures, lambda: report(discovery, comparison, today(), program(), pictures, motion, results, is_planned)


def next_of(session: ModelSession[Any], notify: Callable[[str], None]) -> Experiment | None:
    """The planned next experiment of a report that was made without it; None where it needs none.

    `notify` receives a remark if the experiment is planned for another bench than that of the data.
    """
    if session.data.form == "samples" or session.search_made is None:
        return None
    return session.with_next(Discovery.of(session.search_made), notify).next_experiment
