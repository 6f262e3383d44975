"""One column of a file on the page Import: what it means, and its unit."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui
from starlette.datastructures import QueryParams

from calibrations.importing.units import ColumnMapping, column_unit
from calibrations.text import unit as unit_text
from rig.services.importing import units_for
from rig.web.parts import words

UNUSED = ""
MEANING = ("column", "meaning", "unit")  # fields of the address, once for each column with a person's choice
Meaning = tuple[str, str]  # our name of a column, and its unit in the file


class Column:
    """One column of the file: its meaning and its unit. A unit that a person selects counts as stated."""

    def __init__(self, file_column: str, sample_text: str, look: Callable[[], None]) -> None:
        """`look` shows what would be imported with the present choices."""
        self.file_column, self.look = file_column, look
        self.stated = ""
        self.header_unit = ""
        self.proposed: Meaning = "", ""
        self.confirmed = False  # a person has answered a question about it
        with ui.element("tr"):
            with ui.element("td"):
                words(file_column)
            with ui.element("td"):
                words(sample_text, "number small")
            with ui.element("td"):
                self.name = ui.select({UNUSED: "other"}, value=UNUSED, on_change=self._rename_column)
            with ui.element("td"):
                self.unit = ui.select([], on_change=look)
        for field, label in ((self.name, "meaning"), (self.unit, "unit")):
            field.props(f'dense options-dense aria-label="{label} of {file_column}"')

    def offer(self, names: list[str], proposed: ColumnMapping | None, stated_unit: str) -> None:
        """Offer the names of a kind of table, and select the proposal."""
        self.name.set_options({UNUSED: "other", **{name: name for name in names}})
        self.name.set_value(proposed.name if proposed is not None and proposed.name in names else UNUSED)
        self.stated, self.header_unit = stated_unit, stated_unit  # after the name, whose change forgets them
        self.confirmed = False
        self._offer_units(proposed.unit if proposed is not None else "")
        self.proposed = self.chosen

    def choose(self, meaning: Meaning) -> None:
        """Select what a person has chosen before, if it is still offered."""
        name, unit = meaning
        if name not in self.name.options:
            return
        self.name.set_value(name)
        self.stated, self.confirmed = unit, True
        self._offer_units(unit)

    def _offer_units(self, unit: str) -> None:
        name = str(self.name.value or "")
        offered = units_for(name)
        default_unit = unit or column_unit(name)
        options = [*([] if column_unit(name) else [""]), *offered, default_unit]
        self.unit.set_options({unit: unit_text(unit) or "as it is" for unit in options}, value=default_unit)
        self.unit.set_visibility(bool(offered))

    def _rename_column(self) -> None:
        self.stated, self.confirmed = "", False
        fits = self.header_unit in units_for(str(self.name.value or ""))
        self._offer_units(self.header_unit if fits else "")
        self.look()

    def state(self, unit: str) -> None:
        """Set the unit that a person gives, also if it is the present one."""
        self.stated, self.confirmed = unit, True
        self.unit.set_value(unit)
        self.look()

    @property
    def mapping(self) -> ColumnMapping | None:
        """The mapping as chosen; None for a column that is not used."""
        name, unit = str(self.name.value or ""), str(self.unit.value or "")
        if name == UNUSED:
            return None
        is_default = unit == column_unit(name) and not self.stated and self.header_unit in ("", unit)
        return ColumnMapping(name, self.file_column, "" if is_default else unit)

    @property
    def chosen(self) -> Meaning:
        """Meaning and unit as chosen; the unit is "" where it is that of the meaning, and no person has stated it."""
        mapping = self.mapping
        return (mapping.name, mapping.unit) if mapping is not None else (UNUSED, "")

    @property
    def by_person(self) -> bool:
        """Whether the choice is a person's: another one than the proposal, or the answer to a question."""
        return self.confirmed or self.chosen != self.proposed


def meanings_of(given: QueryParams) -> dict[str, Meaning]:
    """By column of the file, the meaning and unit in an address."""
    columns, names, units = (given.getlist(field) for field in MEANING)
    return {column: (name, unit) for column, name, unit in zip(columns, names, units, strict=False)}
