"""The import that may be meant, which has been tried: the tail of a message about a column that is missing.

The columns are those that names and values speak for (`proposal.py`). The file is taken by them and averaged as
`rig import` does it; a constant that only a person knows is tried with an example, and left open in the command.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from calibrations.errors import DataError, MissingConstant
from calibrations.reading.logs import means
from calibrations.reading.plausible import seen_from_all_sides
from calibrations.reading.proposal import command, likely_kinds, missing, needed, propose
from calibrations.reading.separated import Sheet
from calibrations.reading.units import Mapped
from calibrations.table import Constant, Table

OPEN = "YOURS"
EXAMPLES = {  # of constants: a value to try with, and what it is
    "sample_rate_hz": (100.0, "the samples a second"),
    "turn_deg": (360.0, "by how many degrees it was turned in each section"),
}
FEWEST = 4  # positions: as many as the smallest model has parameters
Take = Callable[[str, Sequence[Mapped], Mapping[str, Constant]], Table]


@dataclass(frozen=True)
class Attempt:
    """What a file was tried as: `lacking` columns, `unknown` constants, and why it cannot be, if it cannot."""

    kind: str
    columns: tuple[Mapped, ...]
    constants: Mapping[str, Constant]
    lacking: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    refused: str = ""


def advice(
    laid: Sheet, kind: str | None, mapped: Sequence[Mapped], constants: Mapping[str, Constant], take: Take
) -> str:
    """The tail of a message: the import that may be meant, ready to be copied. `take` raises DataError."""
    kinds = [kind] if kind else likely_kinds(laid, mapped)
    attempts = [_attempt(laid, each, mapped, constants, take) for each in kinds]
    return _told(laid, next((a for a in attempts if not a.refused), attempts[0]))


def _attempt(
    laid: Sheet, kind: str, mapped: Sequence[Mapped], constants: Mapping[str, Constant], take: Take
) -> Attempt:
    columns = tuple(propose(laid, kind, mapped))
    if lacking := missing(kind, laid, columns):
        return Attempt(kind, columns, constants, tuple(lacking))
    known, unknown = dict(constants), []
    while True:
        try:
            table = means(take(kind, columns, known))
            why = _not_this(table, laid)
        except MissingConstant as error:
            if error.name in known:
                why = str(error)
            else:
                known[error.name] = error.likely or EXAMPLES[error.name][0]
                unknown += [] if error.likely else [error.name]
                continue
        except DataError as error:
            why = str(error)
        return Attempt(kind, columns, known, (), tuple(unknown), why)


def _not_this(table: Table, laid: Sheet) -> str:
    """What speaks against the table that came of it; "" where nothing does."""
    if table.kind == "positions" and table.n < FEWEST:
        return f"{table.source}: {table.n} positions; no model has fewer than {FEWEST} parameters"
    if table.kind == "positions" and not laid.named and not seen_from_all_sides(table.outputs):
        return f"{table.source}: no three columns show one and the same magnitude on many sides"
    return ""


def _told(laid: Sheet, tried: Attempt) -> str:
    free = [name for name in laid.header if name not in {m.theirs for m in tried.columns}]
    cannot = len(tried.lacking) == len(needed(tried.kind, ())) or len(tried.lacking) > len(free)
    if not tried.columns or (not laid.named and (tried.lacking or tried.refused)) or (laid.named and cannot):
        theirs = "yours the name, as in vx_v=Vout:mV" if laid.named else "them a name by its number, as in vx_v=2:mV"
        return f"; --column gives one of {theirs}"
    columns = [*tried.columns, *(Mapped(name, OPEN) for name in tried.lacking)]
    said = {k: OPEN if k in tried.unknown else v for k, v in tried.constants.items()}
    words = [f"{key}={value:.15g}" if isinstance(value, float) else f"{key}={value}" for key, value in said.items()]
    line = f"\n\n    {command(laid, tried.kind, columns, words)}\n"
    if tried.refused:
        return f"\nThis comes nearest, going by names and values, but was tried in vain: {tried.refused}{line}"
    fill = f" (put {'; '.join(_blanks(tried, free))})" if tried.lacking or tried.unknown else ""
    return f"\nGoing by names and values, this takes it{fill}:{line}"


def _blanks(tried: Attempt, free: Sequence[str]) -> list[str]:
    """What a person is to fill in."""
    if tried.lacking:
        return [f"your column's name for {OPEN}: {', '.join(free)}"]
    return [f"{EXAMPLES[name][1]} for {OPEN} in {name}" for name in tried.unknown]
