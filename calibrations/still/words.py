"""The verdict on a noise model in words, alike for terminal and report."""

from __future__ import annotations

from calibrations.still.diagnose import Diagnosis
from calibrations.still.record import Still

HOUR_S = 3600.0


def of_record(still: Still) -> str:
    """What record it is: samples, rate, length."""
    hours = still.length_s / HOUR_S
    length = f"{hours:.3g} h" if hours >= 1 else f"{still.length_s:.4g} s"
    return f"{still.n} samples of {still.source} at {still.rate_hz:.6g} Hz ({length})"


def headline(result: Diagnosis) -> str:
    """The verdict of a diagnosis in a sentence."""
    if result.verdict == "adequate":
        return "nothing is missing; what is left is chance."
    if result.verdict == "unexplained":
        return f"no mixture of noise explains this. Left over: {result.residual_structure}."
    first, *more = result.missing
    also = f" With it, {' and '.join(more)} {'is' if len(more) == 1 else 'are'} missing as well." if more else ""
    rivals = {
        name: c.indistinguishable_from for c in result.candidates for name in [c.name] if c.indistinguishable_from
    }
    doubts = [f"{name} cannot be told from {' or '.join(names)}" for name, names in rivals.items()]
    if result.verdict == "ambiguous":
        return f"noise is missing: {first}; on this record {' and '.join(doubts)}.{also}"
    return f"noise is missing: {first}.{also}"
