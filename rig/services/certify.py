"""A certificate of data and a model: for `rig certificate` and the workbench."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from calibrations.effects import Effect
from calibrations.fitting.fit import fit
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.presentation.certificate.content import Certificate
from calibrations.presentation.certificate.results import figures, require_reference
from calibrations.table import Table
from rig.bench import Bench
from rig.services.issue import CertificateDetails, issue, limits


@dataclass(frozen=True)
class Certified:
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


def certified(subject: Certified, number: str = "", customer: str = "") -> Certificate:
    """The certificate. Raises ModelError for data without a reference; UnusableData, UnknownName, RecordError."""
    require_reference(subject.table.source, subject.table.kind)
    earlier, name = subject.model, subject.name
    if subject.before is not None:
        earlier, name = read_model(subject.before, subject.effects), Path(subject.before).name
    fresh = bool(earlier.params) and earlier.provenance.get("data_sha256") != subject.table.digest
    fitted = fit(subject.model, subject.table)
    figured = figures(fitted, earlier if fresh else None, limits(subject.data, subject.bench))
    created = str(earlier.provenance.get("created", "of unknown date"))[:10]
    details = CertificateDetails(number, customer, f"the model {name}, {created}" if fresh else "")
    return issue(subject.data, fitted, figured, subject.bench, details)


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
