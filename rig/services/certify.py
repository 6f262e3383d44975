"""A certificate of data and a model: for `rig certificate` and the workbench.

The record has the operator, the procedure, the instruments, the time, the place and the samples of a run. A file has no
rig: the certificate says so, and its rows have digests of their own numbers.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, date, datetime
from pathlib import Path

import numpy as np

from calibrations.criteria import COVERAGE_FACTOR
from calibrations.effects import Effect
from calibrations.fitting.fit import Fit, fit
from calibrations.geometry.earth import normal_gravity
from calibrations.model import Model
from calibrations.model.file import dump_model, read_model
from calibrations.presentation.certificate.content import (
    UNSTATED,
    Certificate,
    Condition,
    Figures,
    Instrument,
    Laboratory,
    Sample,
)
from calibrations.presentation.certificate.results import figures, require_reference
from calibrations.presentation.charts.discovery import brief
from calibrations.progress import report
from calibrations.table import Table
from calibrations.text import as_written
from procedures.settings import setting_label, setting_text
from rig.bench import Bench
from rig.bench.certificates import EXPIRED, certificates
from rig.files import program
from rig.record import Record, Run
from rig.record.codec import digest_of
from rig.record.measured import PROGRAM_CHANGED, MeasuredRun
from rig.services.provenance import today

# condition's column -> name and unit
CONDITIONS = {"temperature_c": ("temperature", "C"), "supply_v": ("supply voltage", "V")}
GRAVITY_ANOMALY_M_S2 = 5e-4  # standard deviation of gravity about the normal one: 50 mGal
UNKNOWN_HEIGHT_M_S2 = 2e-3  # of a laboratory between the sea and 2000 m
PLACES = ("alpha_deg", "beta_deg", "direction", "path")


@dataclass(frozen=True)
class CertificateInput:
    """The input of a certificate: a table, a model with the name that people use, and the bench.

    `before`: name or file of the model in use until now; None: `model`, if it has values from other data.
    """

    data: str
    table: Table
    model: Model
    name: str
    effects: Mapping[str, Effect]
    bench: Bench | None = None
    before: str | None = None


def certified(subject: CertificateInput, number: str = "", customer: str = "") -> Certificate:
    """The certificate, with the laboratory of the bench (that of the run where None is given).

    Raises ModelError for data without a reference; UnusableData, UnknownName, RecordError.
    """
    data = subject.data
    require_reference(subject.table.source, subject.table.kind)
    with _open_run(data) as measured:
        run = measured.run if measured is not None else None
        bench = subject.bench or (_bench(run) if run is not None and run.bench else None)
        fitted, figured, before = _results(subject, bench.result_limits if bench is not None else {})
        table = fitted.table
        samples = tuple(_samples(table, measured))
    laboratory, bench_customer = _laboratory(bench)
    sensor, serial, manufacturer = _identity(table)
    end_time = (run.ended or run.created) if run is not None else datetime.now(UTC).isoformat(timespec="seconds")
    model_digest = hashlib.sha256(dump_model(fitted.model).encode()).hexdigest()
    digest = hashlib.sha256(f"{table.digest}{model_digest}".encode()).hexdigest()
    source_name = measured.name.replace("/", "-") if measured is not None else Path(data).stem
    return Certificate(
        number=number or f"{source_name}-{digest[:8]}",
        issued=today(),
        program=program(),
        laboratory=laboratory,
        customer=customer or bench_customer or UNSTATED,
        sensor=sensor,
        serial=serial,
        manufacturer=manufacturer,
        rig=bench.name if bench is not None else "measured elsewhere",
        instruments=tuple(_instruments(run, end_time[:10])) if run is not None else (),
        procedure=run.procedure if run is not None else "data of a file",
        facts=_facts(run, table),
        began=run.created if run is not None else end_time,
        ended=end_time,
        gravity_m_s2=table.gravity_m_s2,
        conditions=tuple(_conditions(table)),
        before=before,
        figures=figured,
        samples=samples,
        data=data if run is not None else Path(data).name,
        data_sha256=table.digest,
        model_sha256=model_digest,
        remarks=(*_remarks(run, bench), *_program_remarks(table), *_gravity_remarks(table)),
        reference=_reference(table),
        simulated=bool(_list_simulated_roles(run)),
    )


def failed_results(certificate: Certificate) -> list[str]:
    """The results that exceed their limits."""
    return [o.name for o in certificate.figures.outcomes if o.decision is not None and o.decision.statement == "fail"]


def format_certificate(certificate: Certificate, form: str) -> str | bytes:
    """The certificate in the form .html, .pdf or .xml."""
    from calibrations.presentation.certificate.dcc import dcc
    from calibrations.presentation.certificate.pages import html, pdf

    if form == ".pdf":
        return pdf(certificate)
    return html(certificate) if form == ".html" else dcc(certificate)


def certificate_head(certificate: Certificate) -> str:
    """Headline, number, and the statement of conformity."""
    from calibrations.presentation.certificate.sections import verdict

    conformity = verdict(certificate)
    remark = f"; conformity: {conformity}" if conformity else ""
    return f"{certificate.headline}, No. {certificate.number}{remark}"


def _results(subject: CertificateInput, limits: Mapping[str, float | tuple[float, float]]) -> tuple[Fit, Figures, str]:
    """The fit, its figures, and in words the model in use until now, where it has values from other data."""
    earlier, name = subject.model, subject.name
    if subject.before is not None:
        earlier, name = read_model(subject.before, subject.effects), Path(subject.before).name
    fresh = bool(earlier.params) and earlier.provenance.get("data_sha256") != subject.table.digest
    report(f"Fitting {brief(subject.model.name)}")
    fitted = fit(subject.model, subject.table)
    figured = figures(fitted, earlier if fresh else None, limits)
    created = str(earlier.provenance.get("created", "of unknown date"))[:10]
    return fitted, figured, f"the model {name}, {created}" if fresh else ""


@contextmanager
def _open_run(data: str) -> Iterator[MeasuredRun | None]:
    """The run, while its record is open; None for a file."""
    if Path(data).is_file():
        yield None
        return
    with Record.to_find(data) as record:
        yield MeasuredRun.named(record, data)


def _laboratory(bench: Bench | None) -> tuple[Laboratory, str]:
    """The laboratory and its customer, as far as the bench file states them."""
    if bench is None or (lab := bench.laboratory) is None:
        return Laboratory(), ""
    return Laboratory(**lab.model_dump(exclude={"customer"})), lab.customer


def _identity(table: Table) -> list[str]:
    """Type, serial number and manufacturer of the sensor."""
    names = ("sensor", "serial", "manufacturer")
    return [as_written(table.constants[name]) if name in table.constants else UNSTATED for name in names]


def _bench(run: Run) -> Bench:
    return Bench.model_validate(run.bench)


def _instruments(run: Run, on: str) -> Iterator[Instrument]:
    """Every instrument of the run, as it identified itself, and items that have a certificate and no role."""
    if not run.bench:
        return
    bench = _bench(run)
    papers = certificates(bench)
    for role, part in bench.instruments.items():
        identity = run.identities.get(role, {})
        paper = papers.pop(role, None)
        number, due = (paper.number, str(paper.due)) if paper is not None else ("", "")
        expired = paper is not None and paper.due < date.fromisoformat(on)
        yield Instrument(
            role,
            identity.get("model") or part.driver,
            identity.get("serial", ""),
            identity.get("firmware", ""),
            number,
            due,
            expired,
        )
    for name, paper in papers.items():
        yield Instrument(name, name, "", "", paper.number, str(paper.due), paper.due < date.fromisoformat(on))


def _facts(run: Run | None, table: Table) -> dict[str, str]:
    """How it was measured."""
    facts = {"rows": str(table.n), "columns": ", ".join(table.columns)}
    if run is None:
        return facts
    settings = {
        setting_label(name): setting_text(value)
        for name, value in run.settings.items()
        if value not in (None, "") and not isinstance(value, Mapping)
    }
    return {"run": run.run, "state": run.state, **facts, **settings}


def _reference(table: Table) -> str:
    """The instruments that the sensor was compared with."""
    if table.type.field:
        return "the local magnetic field, constant in place and time; its strength is not known"
    if table.type.turning:
        return "angular rate, deg/s, about the stated axes, as of a rate table or of whole turns"
    quantity = "its direction from the stage angles" if table.type.stage_angles else "its magnitude alone"
    return f"local gravity, {table.gravity_m_s2:.6g} m/s²; {quantity}"


def _program_remarks(table: Table) -> Iterator[str]:
    """Whether another program, or another procedure, measured a part of the data."""
    if PROGRAM_CHANGED in table.constants:
        yield f"The program or the procedure changed during the run, {table.constants[PROGRAM_CHANGED]}."


def _gravity_remarks(table: Table) -> Iterator[str]:
    """Whether the stated gravity can be that of the stated place; nothing where the latitude is not stated."""
    if table.input_unit != "g" or "latitude_deg" not in table.constants:
        return
    height_m = table.number("height_m", 0.0)
    expected = normal_gravity(table.number("latitude_deg", 0.0), height_m)
    off, std = table.gravity_m_s2 - expected, np.hypot(table.number("gravity_std_m_s2", 0.0), GRAVITY_ANOMALY_M_S2)
    if "height_m" not in table.constants:
        std = np.hypot(std, UNKNOWN_HEIGHT_M_S2)
    if abs(off) > COVERAGE_FACTOR * std:
        yield (
            f"Check: the stated local gravity of {table.gravity_m_s2:.6g} m/s² differs by {off:+.2g} m/s² from "
            f"{expected:.6g} m/s² at the stated latitude and {height_m:g} m (uncertainty "
            f"{COVERAGE_FACTOR * std:.2g} m/s²). Correct gravity_m_s2, latitude_deg or height_m in the bench file."
        )


def _conditions(table: Table) -> Iterator[Condition]:
    for column, (name, unit) in CONDITIONS.items():
        if column in table:
            values = table.column(column)
            yield Condition(name, unit, float(values.min()), float(values.mean()), float(values.max()))


def _list_simulated_roles(run: Run | None) -> list[str]:
    """The roles of the run's instruments that were simulated."""
    if run is None or not run.bench:
        return []
    return [role for role, part in _bench(run).instruments.items() if part.simulated]


def _remarks(run: Run | None, bench: Bench | None) -> Iterator[str]:
    if roles := _list_simulated_roles(run):
        yield f"These instruments were simulated: {', '.join(roles)}. This document certifies no sensor."
    if run is not None and EXPIRED in run.constants:
        yield f"{run.constants[EXPIRED]}: measurements with it are not traceable."
    if run is not None and run.state != "complete":
        yield f"The run is {run.state}; the certificate covers the data that it has."
    if bench is None or bench.laboratory is None or bench.laboratory.name == UNSTATED:
        yield "The bench file does not name the laboratory (key laboratory)."


def _samples(table: Table, measured: MeasuredRun | None) -> Iterator[Sample]:
    """Every row of the table, with the digest of its block of samples, or of its own numbers without samples."""
    digests: dict[int, str] = {}
    if measured is not None and measured.run.bench:  # of the whole block, also where a batch shares it
        digests = {recorded.number: digest_of(recorded.samples) for recorded in measured.record.kept(measured.run.run)}
    numbers = table.numbered(np.arange(table.n))
    for i, number in enumerate(numbers.tolist()):
        values = np.array([column[i] for column in table.columns.values()])
        yield Sample(
            number=number,
            t_s=float(table.column("t_s")[i]) if "t_s" in table else None,
            place=_place(table, i),
            means=tuple(table.outputs[i].tolist()),
            n=int(table.optional("n", 1.0)[i]),
            sha256=digests.get(number) or hashlib.sha256(values.tobytes()).hexdigest(),
        )


def _place(table: Table, i: int) -> str:
    words = [f"{name.removesuffix('_deg')} {table.column(name)[i]:g}" for name in PLACES[:3] if name in table]
    return ", ".join([*words, *([table.labels["path"][i]] if "path" in table.labels else [])]) or "–"
