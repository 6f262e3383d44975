"""Numbers, units and lists as text, for terminal, page and report alike.

An uncertainty has two significant digits (GUM 7.2.6). A standard uncertainty is given in the concise form,
`2.500123(45) V` (GUM 7.2.2); the sign `±` is for expanded uncertainties only.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import TypeGuard

Cells = tuple[Sequence[str], Sequence[Sequence[str]]]  # head and rows of a table of text

SMALL, LARGE = -4, 6  # powers of ten beyond which a number is written with one
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
PREFIX_UNITS = ("V", "g", "deg", "K", "h", "s")  # units that take a prefix
PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"), (1e12, "p"))
MOST_DECIMALS = 12  # of the concise form; smaller uncertainties are written out
INFINITE_FREEDOM = 1e4  # degrees of freedom from which on ∞ is written
FREEDOM_ROUNDING = 1e-6  # of a number of degrees of freedom
NEGLIGIBLE = 1e-3  # share of the combined uncertainty, from which on a source shows in its digits
LEAST_MILLI = 0.1  # below, thousandths of a unit are written as millionths
LARGE_STD = 100.0  # from here on the digits in brackets would be before the decimal point


# Values with their uncertainty


def concise(value: float, std: float | None, unit_name: str = "") -> str:
    """`2.500123(45) V` in ASCII: the digits in brackets are the standard uncertainty of the last digits."""
    if not _is_known(std):
        return f"{value:.6g} {unit_name}".rstrip()
    decimals = max(0, 1 - exponent(float(f"{std:.1e}")))  # of the rounded one: 0.0998 is 0.10
    if decimals > MOST_DECIMALS or std >= LARGE_STD:
        return f"{value:.6g} +- {std:.2g} {unit_name}".rstrip()
    return f"{value:.{decimals}f}({round(std * 10**decimals)}) {unit_name}".rstrip()


def estimate_text(value: float, std: float | None) -> str:
    """`2.50013(24)`, or `−1.23(11) × 10⁻⁸`: the concise form with typographic signs; six digits without `std`."""
    if not _is_known(std):
        return minus(f"{value:.6g}")
    power = _power(value, std)
    if power == 0 and std < LARGE_STD:
        return minus(concise(value, std))
    power = power or exponent(max(abs(value), std))
    return minus(concise(value / 10.0**power, std / 10.0**power)) + times_ten_to(power)


def concise_in_prefix(value: float, std: float | None, unit_name: str) -> str:
    """`concise` in the prefix that reads best: `785.5(73) uV`, `0.00(16) mV`, `0.98510(25) V/g`."""
    factor, spelt = in_prefix(value, std, unit_name)
    return concise(value * factor, None if std is None else std * factor, spelt.replace("µ", "u"))


def estimate_in_prefix(value: float, std: float | None, unit_name: str) -> str:
    """`estimate_text` with its unit, in the prefix that reads best: `785.5(73) µV`, `−1.0(16) mV/g²`."""
    factor, spelt = in_prefix(value, std, unit_name)
    return f"{estimate_text(value * factor, None if std is None else std * factor)} {unit(spelt)}".rstrip()


def in_prefix(value: float, std: float | None, unit_name: str) -> tuple[float, str]:
    """Factor and unit of an output or a rate of it. The unit itself stays down to a tenth of it."""
    if unit_name.partition("/")[0] not in ("V", "g"):
        return 1.0, unit_name
    reach = max(abs(value), 10 * (std or 0.0))
    return (1.0, unit_name) if reach >= 0.1 or reach == 0 else add_prefix(unit_name, reach)


def positive_text(value: float, std: float | None) -> str:
    """A time or a spread, 0 or more: `2.86(42)`, or `at most 7.7` if the expanded uncertainty (k = 2) is larger."""
    if _is_known(std) and value < 2 * std:
        return f"at most {rounded(value + 2 * std, 2)}"
    return estimate_text(value, std)


def expand_uncertainty(value: float, expanded: float) -> str:
    """`2.50013 ± 0.00048`, or `(−1.23 ± 0.22) × 10⁻⁸`: a value with its expanded uncertainty."""
    power = _power(value, expanded)
    text = f"{_to_digits(value, expanded, power)} ± {_to_digits(expanded, expanded, power)}"
    return f"({text}){times_ten_to(power)}" if power else text


def value_text(value: float, uncertainty: float) -> str:
    """The value alone, to two digits of its uncertainty: `2.50013`, `−1.23 × 10⁻⁸`."""
    power = _power(value, uncertainty)
    return _to_digits(value, uncertainty, power) + (times_ten_to(power) if power else "")


def _power(value: float, uncertainty: float) -> int:
    """The power of ten that is written out: 0 unless both numbers are very small or one is large."""
    power = exponent(max(abs(value), uncertainty))
    return 0 if SMALL < power <= LARGE else power


def _to_digits(value: float, uncertainty: float, power: int) -> str:
    decimals = 1 - exponent(float(f"{uncertainty:.1e}"))
    return minus(f"{round(value, decimals) / 10.0**power:.{max(decimals + power, 0)}f}")


def _is_known(std: float | None) -> TypeGuard[float]:
    return std is not None and math.isfinite(std) and std > 0


# Values alone


def rounded(value: float, digits: int = 3) -> str:
    """A value to this number of significant digits, with a power of ten only if it is very small or large."""
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    power = exponent(float(f"{value:.{digits - 1}e}"))
    if SMALL <= power <= LARGE:
        return minus(f"{round(value, digits - 1 - power):.{max(digits - 1 - power, 0)}f}")
    return minus(f"{value / 10.0**power:.{digits - 1}f}") + times_ten_to(power)


def few_digits(value: float, digits: int = 3) -> str:
    """A value whose uncertainty is not known: a whole number in full, another one as `rounded`."""
    return minus(f"{value:.0f}") if value.is_integer() and abs(value) < 10.0**LARGE else rounded(value, digits)


def freedom_text(freedom: float) -> str:
    """Degrees of freedom, cut to a whole number, as the coverage factor has it (GUM G.4.1)."""
    return f"{math.floor(freedom + FREEDOM_ROUNDING):d}" if freedom < INFINITE_FREEDOM else "∞"


def contribution_text(std: float, combined: float) -> str:
    """A contribution to a combined standard uncertainty, in the same unit."""
    return rounded(std, 2) if std > NEGLIGIBLE * combined else "negligible"


def tick_text(value: float) -> str:
    """A mark of a logarithmic axis: `0.002`, `10⁻⁵`."""
    return rounded(value, 1).removeprefix("1 × ")


def quantity(value: float, unit_name: str) -> str:
    """A value with the prefix that reads best, in ASCII: `51.2 uV`, `0.1 mg`, `3 per mille` of a field."""
    if unit_name == "field":
        return f"{1e3 * value:.3g} per mille"
    if unit_name not in ("V", "g") or value == 0:
        return f"{value:.3g} {unit_name}"
    factor, prefix = next((f, p) for f, p in PREFIXES if abs(value) * f >= 0.1 or p == "µ")
    return f"{value * factor:.3g} {prefix.replace('µ', 'u')}{unit_name}"


def in_milli(unit_name: str) -> tuple[float, str]:
    """Factor and unit that make small outputs readable: mV, mg and mm/s^2; other units stay as they are."""
    return (1e3, f"m{unit_name}") if unit_name.partition("/")[0] in ("V", "g", "m") else (1.0, unit_name)


def milli_amount(value: float, unit_name: str, digits: int = 3) -> str:
    """A value in a unit of `in_milli`, in millionths where it is small: `0.53 mg`, `49 µg`."""
    if unit_name.startswith(("mV", "mg", "mm/s")) and 0 < abs(value) < LEAST_MILLI:
        value, unit_name = 1e3 * value, f"µ{unit_name[1:]}"
    return f"{rounded(value, digits)} {unit_name}"


def as_written(value: str | float) -> str:
    """A constant as a person wrote it: `17` for 17.0, such as a serial number that a file's header holds."""
    return f"{value:.15g}" if isinstance(value, float) else str(value)


def probability(p: float) -> str:
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


def duration(seconds: float) -> str:
    """A length of time: 0:05, 12:30, 1:02:30."""
    minutes, s = divmod(round(seconds), 60)
    hours, m = divmod(minutes, 60)
    return f"{hours}:{m:02}:{s:02}" if hours else f"{m}:{s:02}"


def size(count: int) -> str:
    """A number of bytes: 1.2 kB, 3.4 MB."""
    if count >= 1e9:
        return f"{count / 1e9:.1f} GB"
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"


def with_times(text: str) -> str:
    """The text with times of ISO 8601 in UTC as people read them: `2026-11-29 21:07:36 UTC`."""
    return re.sub(r"(\d{4}-\d\d-\d\d)T(\d\d:\d\d:\d\d)(?:\.\d+)?(?:Z|\+00:00)", r"\1 \2 UTC", text)


# Intervals and limits


def count_words(number: int, singular: str, plural: str) -> str:
    """`1 batch`, `2 batches`."""
    return f"{number} {singular if number == 1 else plural}"


def interval(low: float, high: float) -> str:
    """An interval, to a hundredth of its length: `22.32 to 23.13`, `30 to 150`."""
    return f"{to_hundredth(low, high - low)} to {to_hundredth(high, high - low)}"


def to_hundredth(value: float, length: float) -> str:
    """A value to a hundredth of `length`: `43.3` of 60; to six decimals where it is 0."""
    return f"{round(value, max(1, 1 - exponent(length)) if length > 0 else 6) + 0.0:.10g}"


def bound(value: float, limit: float | Sequence[float]) -> str:
    """A limit for `value`: `0 to 12`; of a magnitude the side of `value`, `at most 3` or `at least −3`."""
    if isinstance(limit, Sequence):
        return minus(f"{limit[0]:g} to {limit[1]:g}")
    return f"at most {limit:g}" if value >= 0 else minus(f"at least {-limit:g}")


# Units


def unit(text: str) -> str:
    """`V/g^2/sqrt(Hz)` as `V/g²/√Hz`, `V*s` as `V·s`, `degC` as `°C`; nothing for a pure number."""
    text = text.replace("degC", "°C").replace("sqrt(Hz)", "√Hz").replace("sqrt(s)", "√s").replace("*", "·")
    head, *powers = text.split("^")
    return "" if text == "1" else head + "".join(p[:1].translate(SUPERSCRIPT) + p[1:] for p in powers)


def add_prefix(unit_name: str, reach: float) -> tuple[float, str]:
    """(factor, unit with prefix) for values up to `reach` in the unit `unit_name`, as `unit` writes it."""
    if not unit_name.startswith(PREFIX_UNITS):
        return 1.0, unit_name
    factor, letter = prefix(reach)
    return factor, f"{letter}{unit_name}"


def prefix(size: float) -> tuple[float, str]:
    """(factor, prefix) that make a number of this size 1 or more; none where no prefix does."""
    return next(((factor, letter) for factor, letter in PREFIXES if abs(size) * factor >= 1), PREFIXES[0])


def axis_label(name: str, unit_name: str) -> str:
    """An axis label: the name with its unit, where it has one."""
    return f"{name} ({unit_name})" if unit_name else name


# Words


def join_words(names: Iterable[str], word: str = "and") -> str:
    """`a`, `a and b`, `a, b and c`."""
    names = list(names)
    return f" {word} ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def parameter_words(key: str) -> str:
    """A parameter by its key in words: `the scale factor of x`, `the nonorthogonality of x and y`."""
    name, _, axes = key.rpartition(".") if set(key.rpartition(".")[2]) <= set("xyz") else (key, "", "")
    words = re.sub(r"[-_.]", " ", name.removeprefix("axis-").replace("gyro-", "gyroscope "))
    return f"the {words} of {join_words(dict.fromkeys(axes))}" if axes else f"the {words}"


def capital(text: str) -> str:
    """The text with a capital first letter."""
    return text[:1].upper() + text[1:]


def keep_units_together(text: str) -> str:
    """The text with no line break between a number and its unit."""
    return re.sub(r"(?<=\d) (?=mg|×|±)|(?<=[×±]) (?=\d)", "\u00a0", text)


def columns(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table for a terminal: columns aligned to the left, two spaces apart."""
    cells = [tuple(head), *[tuple(str(cell) for cell in row) for row in rows]]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in cells]
    return "\n".join(line.rstrip() for line in lines)


# Parts of numbers


def exponent(value: float) -> int:
    """The power of ten of the first digit."""
    return math.floor(math.log10(abs(value)))


def times_ten_to(power: int) -> str:
    """` × 10⁻⁸`."""
    return f" × 10{str(power).translate(SUPERSCRIPT)}"


def minus(text: str) -> str:
    """The text with true minus signs."""
    return text.replace("-", "−")


def typeset(text: str) -> str:
    """A sentence of a terminal, which is ASCII, with the signs of a page or a report: −, ±, ×, µ, °C."""
    signs = re.sub(r"(?<![\w.)\]-])-(?=\d|[xyz]\b)", "−", text.replace("+-", "±"))
    signs = re.sub(r"(?<=[\d)] )u(?=[Vg]\b)", "µ", signs)
    signs = re.sub(r"(?<=\d) (deg)?C\b", " °C", signs)
    return re.sub(r"(?<=\d) x (?=the |that |its )", " × ", signs)


def sentence(text: str) -> str:
    """The text as a sentence."""
    return f"{text[0].upper()}{text[1:]}." if text else ""
