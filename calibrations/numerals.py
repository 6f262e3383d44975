"""Numbers for print: a value to the digits that its uncertainty leaves it, after the GUM (7.2.6: two digits)."""

from __future__ import annotations

import math
from collections.abc import Sequence

SMALL, LARGE = -4, 6  # powers of ten beyond which a number is written with one
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def measured(value: float, std: float | None) -> str:
    """`2.50013 ± 0.00024`, or `(-1.23 ± 0.11) × 10⁻⁸`; six digits where the uncertainty is not known."""
    if std is None or not (math.isfinite(std) and std > 0):
        return minus(f"{value:.6g}")
    decimals = 1 - exponent(float(f"{std:.1e}"))
    power = exponent(max(abs(value), std))
    if SMALL < power <= LARGE:
        shown = max(decimals, 0)
        return minus(f"{round(value, decimals):.{shown}f} ± {round(std, decimals):.{shown}f}")
    shown = decimals + power
    return minus(f"({value / 10.0**power:.{shown}f} ± {std / 10.0**power:.{shown}f})") + times_ten_to(power)


def as_written(value: str | float) -> str:
    """A constant as a person wrote it: `17` for 17.0, such as a serial number that a file's header holds."""
    return f"{value:.15g}" if isinstance(value, float) else str(value)


def bound(value: float, limit: float | Sequence[float]) -> str:
    """A limit as `value` meets it: `0 to 12`; of a magnitude the side that it is on, `at most 3` or `at least −3`."""
    if isinstance(limit, Sequence):
        return minus(f"{limit[0]:g} to {limit[1]:g}")
    return f"at most {limit:g}" if value >= 0 else minus(f"at least {-limit:g}")


def plain(value: float, digits: int = 3) -> str:
    """A value to so many significant digits, with a power of ten only where it is very small or large."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    power = exponent(float(f"{value:.{digits - 1}e}"))
    if SMALL <= power <= LARGE:
        return minus(f"{round(value, digits - 1 - power):.{max(digits - 1 - power, 0)}f}")
    return minus(f"{value / 10.0**power:.{digits - 1}f}") + times_ten_to(power)


def stretch(low: float, high: float) -> str:
    """Where something is, to a hundredth of its length: `22.32 to 23.13`, `30 to 150`."""
    decimals = max(1, 1 - exponent(high - low)) if high > low else 6
    return f"{round(low, decimals):.10g} to {round(high, decimals):.10g}"


def chance(p: float) -> str:
    """A p-value or a probability: `0.02`, `7 × 10⁻¹¹`, `below 10⁻³⁰⁰`."""
    if p < 1e-300:
        return f"below{times_ten_to(-300)}".replace(" ×", "")
    if p < 1e-3:
        power = exponent(float(f"{p:.0e}"))
        return f"{p / 10.0**power:.0f}{times_ten_to(power)}"
    return f"{p:.2g}"


def percent(share: float) -> str:
    """`3.3 %`, `100 %`."""
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"


def unit(text: str) -> str:
    """`V/g^2` as `V/g²`, `degC` as `°C`; nothing for a pure number."""
    head, *powers = text.replace("degC", "°C").split("^")
    return "" if text == "1" else head + "".join(p[:1].translate(SUPERSCRIPT) + p[1:] for p in powers)


def exponent(value: float) -> int:
    """The power of ten of the first digit."""
    return math.floor(math.log10(abs(value)))


def times_ten_to(power: int) -> str:
    """` × 10⁻⁸`."""
    return f" × 10{str(power).translate(SUPERSCRIPT)}"


def minus(text: str) -> str:
    """With a true minus sign."""
    return text.replace("-", "−")
