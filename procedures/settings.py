"""The settings of a procedure, read from text. They are the keywords of its function, with their annotated types.

A line `name  meaning` in the docstring of the function says what a setting means.

Types: float, int, bool, str, a `Literal` of texts, `tuple[float, ...]` as 90,30,150, and `tuple[str, ...]`: the name of
a file, whose lines are the value.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

from drivers.errors import did_you_mean
from procedures.catalogue import Procedure
from procedures.errors import SettingError

Value = Any
YES_OR_NO = ("yes", "no")
SHARED = {  # settings that mean the same in every procedure
    "dwell_s": "How long samples are averaged at each pose.",
    "settle_s": "How long the stages stand still before samples are taken.",
    "block_s": "A record is saved in blocks of this length; a fault costs at most one block.",
}
UNITS = {
    "deg_s": "deg/s",
    "m_s2": "m/s^2",
    "deg": "deg",
    "hz": "Hz",
    "um": "um",
    "percent": "%",
    "c": "°C",
    "g": "g",
    "s": "s",
}  # ends of names


def parse(procedure: Procedure, entries: Mapping[str, Value]) -> dict[str, Value]:
    """All settings of `procedure`: its defaults, replaced by `entries` (texts, or values of a file).

    Raises SettingError for an unknown name, with a suggestion, and for a value of the wrong type.
    """
    defaults = procedure.defaults
    types = get_type_hints(procedure.function)
    for name in entries:
        if name not in defaults:
            raise SettingError(f"{procedure.name} has no setting {name!r}.{did_you_mean(name, defaults)}")
    return defaults | {
        name: _value(f"{procedure.name}: the setting {name}", types.get(name, str), value)
        for name, value in entries.items()
    }


def meaning(procedure: Procedure, name: str) -> str:
    """What a setting means: its line in the docstring of the procedure's function, else as in every procedure."""
    doc = inspect.cleandoc(procedure.function.__doc__ or "")
    line = re.search(rf"^{name}  +(.*(?:\n  .*)*)", doc, re.MULTILINE)
    return " ".join(line[1].split()) if line else SHARED.get(name, "")


def choices(procedure: Procedure) -> dict[str, tuple[str, ...]]:
    """The settings that have a list of allowed texts, with this list."""
    types = get_type_hints(procedure.function)
    choices_by_name = {
        name: tuple(map(str, get_args(kind))) for name, kind in types.items() if get_origin(kind) is Literal
    }
    return choices_by_name | {name: YES_OR_NO for name, kind in types.items() if kind is bool}


def split_unit(name: str) -> tuple[str, str]:
    """`step_deg` as (`step`, `deg`); the unit is "" for a name without one."""
    end = next((end for end in UNITS if name.endswith(f"_{end}")), "")
    return name.removesuffix(f"_{end}"), UNITS.get(end, "")


COUNTS = {
    "reference_every": "poses between two references",
    "times": "times (tumbles of each sort)",
    "cycles": "cycles (of temperature)",
    "mounts": "mounts (edges upright)",
}


def setting_label(name: str) -> str:
    """`step_deg` as `step (deg)`, `size_um` as `size (µm)`; a count with what it counts."""
    if name in COUNTS:
        return COUNTS[name]
    head, unit_name = split_unit(name)
    spelt = {"um": "µm", "m/s^2": "m/s²"}.get(unit_name, unit_name)
    return f"{head.replace('_', ' ')} ({spelt})" if spelt else head.replace("_", " ")


def setting_text(value: Value) -> str:
    """The text of a value, as a person types it."""
    if isinstance(value, (list, tuple)):
        return ",".join(map(setting_text, value))
    if isinstance(value, bool):
        return YES_OR_NO[not value]
    return f"{value:g}" if isinstance(value, float) else str(value)


def _value(subject: str, kind: Any, value: Value) -> Value:
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    try:
        if choices:
            return choices[[str(choice) for choice in choices].index(str(value))]
        if get_origin(kind) is tuple:
            return tuple(_scalar(get_args(kind)[0], part) for part in _parts(subject, kind, value))
        return _scalar(kind, value)
    except (ValueError, TypeError):
        listed = f"one of {', '.join(map(str, choices))}"
        expected = listed if choices else _KIND_TEXTS.get(kind, "numbers such as 90,30")
        raise SettingError(f"{subject} is {value!r}; give {expected}") from None


def _parts(subject: str, kind: Any, value: Value) -> Sequence[Value]:
    if not isinstance(value, str):
        return list(value)
    return value.split(",") if get_args(kind)[0] is not str else _lines(subject, Path(value))


def _lines(subject: str, path: Path) -> list[str]:
    """The lines of a file. Raises SettingError for a file that cannot be read."""
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not a text file"
        raise SettingError(f"{subject}: cannot read the file {path}: {reason}; give another file") from None


def _scalar(kind: Any, value: Value) -> Value:
    return _READERS.get(kind, kind)(value)


def _number(value: Value) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError
    return number


def _yes_or_no(value: Value) -> bool:
    switches = {"true": True, "yes": True, "false": False, "no": False}
    if (text := str(value).lower()) not in switches:
        raise ValueError
    return switches[text]


_READERS: Mapping[Any, Callable[[Value], Value]] = {float: _number, bool: _yes_or_no}
_KIND_TEXTS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text"}
