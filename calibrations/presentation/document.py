"""A document as a neutral value: sections of paragraphs, facts, tables and pictures. `page` and `certificate` draw it.

A text is plain and is escaped where it is drawn; `Markup` is HTML that this program has made.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from calibrations.presentation.chart import Picture

Row = Sequence[object]


@dataclass(frozen=True)
class Remark:
    """A paragraph of small print."""

    text: str


@dataclass(frozen=True)
class Items:
    """A numbered list."""

    texts: Sequence[str]


@dataclass(frozen=True)
class Code:
    """A command to copy."""

    text: str


@dataclass(frozen=True)
class Facts:
    """Values by name."""

    facts: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Table:
    """A head, and rows of as many cells.

    `numbers` are the columns aligned to the right. `folded` tables open on a click. `details` has paragraphs below
    single rows, by the number of the row. In a `grouped` table, rows without a first cell belong to the row above.
    """

    title: str
    head: Sequence[str]
    rows: Sequence[Row]
    numbers: Collection[int] = ()
    headed: bool = True  # whether the title is shown above the table
    folded: bool = False
    grouped: bool = False
    details: Mapping[int, Sequence[str]] | None = None

    @property
    def groups(self) -> Iterator[list[tuple[Row, Sequence[str]]]]:
        """Rows that are drawn together, each with the paragraphs below it."""
        group: list[tuple[Row, Sequence[str]]] = []
        for number, row in enumerate(self.rows):
            if group and (row[0] if self.grouped else self.details is not None):
                yield group
                group = []
            group.append((row, (self.details or {}).get(number, ())))
        if group:
            yield group


Block = str | Remark | Items | Code | Facts | Table | Picture


@dataclass(frozen=True)
class Section:
    """A heading, and blocks in their order; a text is a paragraph."""

    title: str
    blocks: Sequence[Block]

    @property
    def tables(self) -> list[Table]:
        """The tables of the section."""
        return [block for block in self.blocks if isinstance(block, Table)]


@dataclass(frozen=True)
class Page:
    """A whole document. `state` names the colour of the `verdict`; `figures` are (what, value, remark)."""

    headline: str
    verdict: str
    state: str
    subject: str
    summary: str
    figures: Sequence[tuple[str, str, str]]
    sections: Sequence[Section]
    provenance: Mapping[str, str]
