"""Calibration certificates of the instruments, and which of them have expired.

A run that begins with an expired certificate gets an event, and the constant `expired` of its table, which every export
and report shows. The run is not refused, because its data may still be needed.
"""

from __future__ import annotations

from datetime import date

from rig.bench import Bench, Certificate

EXPIRED = "expired"


def certificates(bench: Bench) -> dict[str, Certificate]:
    """Every certificate of the bench file: of an instrument by its role, of another thing by its name."""
    by_role = {role: part.certificate for role, part in bench.instruments.items() if part.certificate is not None}
    return {**by_role, **bench.certificates}


def find_expired(bench: Bench, on: date) -> list[str]:
    """A sentence for each certificate that expired before the day `on`."""
    return [
        f"{name}'s certificate {certificate.number} expired on {certificate.due}"
        for name, certificate in certificates(bench).items()
        if certificate.due < on
    ]
