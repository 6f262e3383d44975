"""Still records in words, alike for terminal and report."""

from __future__ import annotations

from calibrations.noise.record import Still

HOUR_S = 3600.0


def of_record(still: Still) -> str:
    """What record it is: samples, rate, length."""
    hours = still.length_s / HOUR_S
    length = f"{hours:.3g} h" if hours >= 1 else f"{still.length_s:.4g} s"
    return f"{still.n} samples of {still.source} at {still.rate_hz:.6g} Hz ({length})"


def sentence(text: str) -> str:
    """The text as a sentence."""
    return f"{text[0].upper()}{text[1:]}." if text else ""
