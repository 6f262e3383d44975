"""The certificate as one HTML page that needs no network."""

from __future__ import annotations

from calibrations.certificates.content import Certificate
from calibrations.certificates.sections import sections, verdict
from calibrations.reports.page import page

STATES = {"": "found", "pass": "adequate", "conditional pass": "ambiguous"}


def html(c: Certificate) -> str:
    """The page as text; the same certificate gives the same page."""
    told = verdict(c)
    return page(
        "certificate.html",
        headline=c.headline,
        verdict="simulated" if c.simulated else told or "calibrated",
        state="ambiguous" if c.simulated else STATES.get(told, "unexplained"),
        what=f"No. {c.number}, issued {c.issued}",
        summary=f"{c.sensor}, serial number {c.serial}, calibrated on {c.ended[:10]} by {c.laboratory.name}.",
        figures=[],
        sections=sections(c),
        provenance={"certificate": c.number, "issued": c.issued, "program": c.program},
    )
