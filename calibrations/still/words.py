"""The verdict on a noise model in words, alike for terminal and report."""

from __future__ import annotations

from calibrations.still.diagnose import Diagnosis
from calibrations.still.record import Still
from calibrations.still.search import Search

HOUR_S = 3600.0


def of_record(still: Still) -> str:
    """What record it is: samples, rate, length."""
    hours = still.length_s / HOUR_S
    length = f"{hours:.3g} h" if hours >= 1 else f"{still.length_s:.4g} s"
    return f"{still.n} samples of {still.source} at {still.rate_hz:.6g} Hz ({length})"


def headline(result: Diagnosis) -> str:
    """The verdict of a diagnosis in a sentence or two."""
    return f"{_verdict(result)}{two_levels(result.search)}"


def two_levels(found: Search) -> str:
    """What goes between two levels, as sentences behind others; nothing where nothing does."""
    return "".join(f" {sentence(each.text)}" for each in found.telegraphs)


def _verdict(result: Diagnosis) -> str:
    if result.verdict == "adequate":
        return "nothing is missing; what is left is chance."
    first, *more = result.missing or ("",)
    also = f" With it, {' and '.join(more)} {'is' if len(more) == 1 else 'are'} missing as well." if more else ""
    if result.fit.still.hidden:
        return f"this record does not tell. {sentence(result.residual_structure)}"
    if result.verdict == "unexplained":
        beside = f" Beside that, noise is missing: {first}.{also}" if first else ""
        return f"no mixture of noise explains this. Left over: {result.residual_structure}.{beside}"
    return f"noise is missing: {first}.{also}{doubt(result.reason)}"


def sentence(told: str | None) -> str:
    """What is told, as a sentence."""
    return f"{told[0].upper()}{told[1:]}." if told else ""


def doubt(reason: str | None) -> str:
    """Why an answer is not decided, as a sentence behind it; nothing where it is."""
    return f" It is not decided: {reason}." if reason else ""
