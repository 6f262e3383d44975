"""A likely import, which was tried: the end of a message about a missing column.

The columns are those that names and values suggest (`proposal.py`). They are converted and averaged as `rig import`
does it. A constant that only a person knows is tried with an example value, and is a placeholder in the command.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from calibrations.criteria import FEWEST_POSITIONS
from calibrations.errors import DataError, MissingConstant
from calibrations.importing.plausible import covers_all_directions
from calibrations.importing.proposal import (
    likely_kinds,
    missing_columns,
    propose_mapping,
    required_columns,
    second_sensor,
)
from calibrations.importing.raw_logs import average_raw_log
from calibrations.importing.sheet import Sheet
from calibrations.importing.units import ColumnMapping, split_unit
from calibrations.table import Constant, Table

PLACEHOLDER = "YOURS"
EXAMPLES = {  # of constants: a value to try, and its meaning
    "sample_rate_hz": (100.0, "the sample rate in Hz"),
    "turn_deg": (360.0, "the angle of each turn in deg"),
}
ImportSheet = Callable[[str, Sequence[ColumnMapping], Mapping[str, Constant]], Table]


@dataclass(frozen=True)
class Attempt:
    """A tried import: `lacking` columns, `unknown` constants, and the reason if it was refused."""

    kind: str
    columns: tuple[ColumnMapping, ...]
    constants: Mapping[str, Constant]
    lacking: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    refused: str = ""


def import_command(
    laid: Sheet, kind: str | None, mapped: Sequence[ColumnMapping], constants: Sequence[str] = ()
) -> str:
    """The `rig import` command with this mapping."""
    topic = ["--topic", laid.topic] if laid.topic else []
    words = ["rig", "import", laid.name, *topic, *(["--kind", kind] if kind else [])]
    words += [
        word for m in mapped for word in ("--column", replace(m, file_column=_shortest(laid, m.file_column)).text)
    ]
    words += [word for constant in constants for word in ("--constant", constant)]
    return shlex.join(words)


def _shortest(laid: Sheet, column: str) -> str:
    """The file's column name without its unit, where that is unique."""
    unitless = split_unit(column)[0]
    return unitless if laid.bare.count(unitless) == 1 else column


def suggest_import(
    laid: Sheet, kind: str | None, mapped: Sequence[ColumnMapping], constants: Mapping[str, Constant], take: ImportSheet
) -> str:
    """The end of an error message: a likely import command. `import_sheet` raises DataError."""
    kinds = [kind] if kind else likely_kinds(laid, mapped)
    attempts = [_attempt(laid, likely, mapped, constants, take) for likely in kinds]
    return _suggestion(laid, next((a for a in attempts if not a.refused), attempts[0]))


def _attempt(
    laid: Sheet, kind: str, mapped: Sequence[ColumnMapping], constants: Mapping[str, Constant], take: ImportSheet
) -> Attempt:
    columns = tuple(propose_mapping(laid, kind, mapped))
    if lacking := missing_columns(kind, laid, columns):
        return Attempt(kind, columns, constants, tuple(lacking))
    merged, unknown = dict(constants), []
    while True:
        try:
            table = average_raw_log(take(kind, columns, merged))
            objection = _objection(table, laid)
        except MissingConstant as error:
            if error.name in merged:
                objection = str(error)
            else:
                merged[error.name] = error.likely or EXAMPLES[error.name][0]
                unknown += [] if error.likely else [error.name]
                continue
        except DataError as error:
            objection = str(error)
        return Attempt(kind, columns, merged, (), tuple(unknown), objection)


def _objection(table: Table, laid: Sheet) -> str:
    """The reason why the tried table is implausible; "" for none."""
    if table.type.magnitude and table.n < FEWEST_POSITIONS:
        return f"{table.source}: {table.n} positions; no model has fewer than {FEWEST_POSITIONS} parameters"
    if table.type.magnitude and not laid.named and not covers_all_directions(table.outputs):
        return f"{table.source}: no three columns keep their magnitude over many directions"
    return ""


def _suggestion(laid: Sheet, attempt: Attempt) -> str:
    free = [name for name in laid.header if name not in {m.file_column for m in attempt.columns}]
    cannot = len(attempt.lacking) == len(required_columns(attempt.kind, ())) or len(attempt.lacking) > len(free)
    if not attempt.columns or (not laid.named and (attempt.lacking or attempt.refused)) or (laid.named and cannot):
        example = "such as vx_v=Vout:mV" if laid.named else "by its number, such as vx_v=2:mV"
        return f"; name a column with --column, {example}"
    columns = [*attempt.columns, *(ColumnMapping(name, PLACEHOLDER) for name in attempt.lacking)]
    constants = {k: PLACEHOLDER if k in attempt.unknown else v for k, v in attempt.constants.items()}
    words = [
        f"{key}={value:.15g}" if isinstance(value, float) else f"{key}={value}" for key, value in constants.items()
    ]
    line = f"\n\n    {import_command(laid, attempt.kind, columns, words)}\n"
    if attempt.refused:
        return f"\nThe most likely import fails: {attempt.refused}{line}"
    fill = f" (put {'; '.join(_placeholders(attempt, free))})" if attempt.lacking or attempt.unknown else ""
    return f"\nThe names and values suggest this import{fill}:{line}{_other_sensor(laid, attempt.kind, columns, words)}"


def _other_sensor(laid: Sheet, kind: str, columns: Sequence[ColumnMapping], constants: Sequence[str]) -> str:
    """The import of a second sensor in the same columns; "" without one."""
    others = {m.name: m for m in second_sensor(laid, kind, columns)}
    if not others:
        return ""
    command = import_command(laid, kind, [others.get(m.name, m) for m in columns], constants)
    return f"\nThe file has a second sensor, {', '.join(m.file_column for m in others.values())}:\n\n    {command}\n"


def _placeholders(attempt: Attempt, free: Sequence[str]) -> list[str]:
    """The entries that a person has to fill in."""
    if attempt.lacking:
        return [f"your column's name for {PLACEHOLDER}: {', '.join(free)}"]
    return [f"{EXAMPLES[name][1]} for {PLACEHOLDER} in {name}" for name in attempt.unknown]
