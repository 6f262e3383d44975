"""Units for people, with the prefix by which numbers read best."""

from __future__ import annotations

from calibrations.numerals import unit

PREFIXED = ("V", "g", "deg", "K", "h", "s")  # units that take a prefix
PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"))


def spelt(text: str) -> str:
    """`V/g^2/sqrt(Hz)` as `V/g²/√Hz`."""
    return unit(text).replace("sqrt(Hz)", "√Hz").replace("sqrt(s)", "√s")


def prefixed(of: str, reach: float) -> tuple[float, str]:
    """What values up to `reach` are multiplied with, and their unit then; `of` is a unit as it is spelt."""
    if not of.startswith(PREFIXED):
        return 1.0, of
    factor, prefix = next(((f, p) for f, p in PREFIXES if reach * f >= 1), PREFIXES[-1])
    return factor, f"{prefix}{of}"


def labelled(name: str, of: str) -> str:
    """An axis' title: the name with its unit, where it has one."""
    return f"{name} ({of})" if of else name
