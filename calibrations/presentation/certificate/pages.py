"""The certificate for people: one HTML page that needs no network, and a PDF, A4, in DejaVu Sans (from matplotlib)."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import matplotlib as mpl
from fpdf import FPDF
from fpdf.enums import TableBordersLayout, TextEmphasis
from fpdf.fonts import FontFace

from calibrations.presentation.certificate.content import Certificate
from calibrations.presentation.certificate.sections import sections, verdict
from calibrations.presentation.document import Facts, Page, Section, Table
from calibrations.presentation.page import html as page_html

STATES = {"": "found", "pass": "adequate", "conditional pass": "ambiguous"}


def html(c: Certificate) -> str:
    """The page as text; the same certificate gives the same page."""
    conformity = verdict(c)
    return page_html(
        Page(
            headline=c.headline,
            verdict="simulated" if c.simulated else conformity or "calibrated",
            state="ambiguous" if c.simulated else STATES.get(conformity, "unexplained"),
            subject=f"No. {c.number}, issued {c.issued}",
            summary=f"{c.sensor}, serial number {c.serial}, calibrated on {c.ended[:10]} by {c.laboratory.name}.",
            figures=[],
            sections=sections(c),
            provenance={"certificate": c.number, "issued": c.issued, "program": c.program},
        )
    )


FONT = "DejaVu"
FILES = {"": "DejaVuSans.ttf", "B": "DejaVuSans-Bold.ttf"}
SIZE, SMALL, TINY = 9.0, 7.5, 6.5
QUIET = (97, 110, 124)
INK = (31, 41, 51)
LINE = (217, 222, 228)
TITLE_AND_ROWS = 16  # mm: a title is not alone at the foot of a page
GAP = 3  # mm between a right-aligned figure and the next column
LONGEST, ROOM = 34, 4  # letters of a cell, and its margin


class _Page(FPDF):
    """A page with the certificate's number and its own at its foot."""

    def __init__(self, number: str) -> None:
        super().__init__(format="A4")
        self._number = number

    def footer(self) -> None:
        self.set_y(-12)
        self.set_font(FONT, size=TINY)
        self.set_text_color(*QUIET)
        self.cell(0, 5, f"Certificate {self._number}")
        self.cell(0, 5, f"page {self.page_no()} of {{nb}}", align="R")


def pdf(c: Certificate) -> bytes:
    """The document; the same certificate gives the same bytes."""
    page = _Page(c.number)
    folder = Path(mpl.get_data_path()) / "fonts" / "ttf"
    for style, file in FILES.items():
        page.add_font(FONT, style, folder / file)
    page.set_creation_date(datetime.fromisoformat(f"{c.issued}T00:00:00").replace(tzinfo=UTC))
    page.set_title(f"{c.headline}, No. {c.number}")
    page.set_creator(c.program)
    page.set_margins(15, 15)
    page.set_auto_page_break(True, margin=16)
    page.add_page()
    _head(page, c)
    for section in sections(c):
        _section(page, section)
    return bytes(page.output())


def _head(page: FPDF, c: Certificate) -> None:
    _write(page, c.laboratory.name, SMALL, QUIET)
    _write(page, c.headline, 16, INK, "B")
    _write(page, f"No. {c.number}, issued {c.issued}", SIZE, INK)
    conformity = verdict(c)
    statement = f" Conformity with its limits: {conformity}." if conformity else ""
    _write(page, f"{c.sensor}, serial number {c.serial}, calibrated on {c.ended[:10]}.{statement}", SIZE + 1, INK)


def _section(page: FPDF, section: Section) -> None:
    page.ln(2)
    if page.will_page_break(20):
        page.add_page()
    _write(page, section.title, 12, INK, "B")
    for block in section.blocks:
        if isinstance(block, Table):
            _table(page, block)
        elif isinstance(block, Facts):
            _facts(page, block)
        else:
            _write(page, str(block), SMALL, INK)


def _facts(page: FPDF, block: Facts) -> None:
    page.set_font(FONT, size=SMALL)
    with page.table(
        borders_layout=TableBordersLayout.NONE, first_row_as_headings=False, col_widths=(1, 4), line_height=4.2,
        text_align="LEFT",
    ) as cells:  # fmt: skip
        for name, value in block.facts:
            row = cells.row()
            row.cell(name, style=FontFace(color=QUIET))
            row.cell(value or "–")


def _table(page: FPDF, table: Table) -> None:
    if page.will_page_break(TITLE_AND_ROWS):
        page.add_page()
    _write(page, table.title, SMALL, INK, "B")
    page.set_font(FONT, size=TINY)
    page.set_draw_color(*LINE)
    aligned = tuple("RIGHT" if k in table.numbers else "LEFT" for k in range(len(table.head)))
    with page.table(
        borders_layout=TableBordersLayout.HORIZONTAL_LINES, col_widths=_widths(table), line_height=3.2,
        padding=(0.4, GAP / 2), text_align=aligned, headings_style=FontFace(emphasis=TextEmphasis.B),
    ) as cells:  # fmt: skip
        for row in (table.head, *table.rows):
            cells.row([str(cell) for cell in row])
    page.ln(1.5)


def _widths(table: Table) -> tuple[float, ...]:
    """Shares of the width by the longest cell of each column; words are not broken, and long texts of words are."""
    columns = [[str(row[k]) for row in (table.head, *table.rows)] for k in range(len(table.head))]
    longest = [max(map(len, column)) for column in columns]
    words = [max(len(word) for cell in column for word in cell.split(" ")) for column in columns]
    return tuple(float(max(min(letters, LONGEST), word) + ROOM) for letters, word in zip(longest, words, strict=True))


def _write(page: FPDF, text: str, size: float, colour: tuple[int, int, int], style: str = "") -> None:
    page.set_font(FONT, style, size)
    page.set_text_color(*colour)
    page.multi_cell(0, size * 0.5, text, new_x="LMARGIN", new_y="NEXT")
    page.set_text_color(*INK)
