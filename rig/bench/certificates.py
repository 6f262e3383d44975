"""Calibration certificates of a bench's instruments, and which of them are no longer good on a day.

A run that begins with an expired one is marked: with an event, and with the constant `expired`, which goes with its
table into every export and report. The run itself is not refused: what it measured may still be needed.
"""

from __future__ import annotations

from datetime import date

from rig.bench import Bench, Certificate

EXPIRED = "expired"


def certificates(bench: Bench) -> dict[str, Certificate]:
    """Every certificate of the bench file: of instruments by role, of other things by the name given there."""
    own = {role: part.certificate for role, part in bench.instruments.items() if part.certificate is not None}
    return {**own, **bench.certificates}


def expired(bench: Bench, on: date) -> list[str]:
    """A sentence for each certificate that was due before the day `on`."""
    return [
        f"{name}'s certificate {certificate.number} expired on {certificate.due}"
        for name, certificate in certificates(bench).items()
        if certificate.due < on
    ]
