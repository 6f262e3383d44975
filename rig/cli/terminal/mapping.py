"""A person at a terminal says which column of a file is what; a proposal is there to be confirmed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import click

from calibrations.errors import DataError, nearest
from calibrations.importing.foreign import PATH, check_unit
from calibrations.importing.proposal import import_command, likely_kind, missing_columns, propose_mapping, sample_values
from calibrations.importing.sheet import Sheet
from calibrations.importing.units import ColumnMapping, parse_unit
from calibrations.table import NUMBERS
from rig.cli.terminal.output import note

LEAVE = "-"
CHOICES = {
    "poses": "alpha_deg beta_deg vx_v vy_v vz_v direction t_s temperature_c supply_v vx_std_v vy_std_v n flip",
    "positions": "ax ay az t_s temperature_c n; of a magnetometer mx my mz",
    "rates": "rate_deg_s gx gy gz ax ay az axis_x axis_y axis_z t_s temperature_c n; of named sections path",
    "motion": "t_s vx_v vy_v displacement_m temperature_c supply_v",
}


def ask_mapping(
    laid: Sheet, kind: str | None, mapped: Sequence[ColumnMapping], constants: Sequence[str]
) -> tuple[str, list[ColumnMapping]]:
    """The kind of table and the whole mapping, as the person confirms it; the command that repeats it is printed.

    Raises click.Abort where the person gives up.
    """
    note(f"{laid.name} has columns that are not called as here. Which is what?")
    if kind is None:
        kinds = click.Choice(sorted(CHOICES))
        told = "Held at known stage angles (poses), put down by hand (positions), turned (rates), or shaken (motion)"
        kind = str(click.prompt(told, default=likely_kind(laid, mapped), type=kinds, err=True))
    note(
        f"\nOur columns: {CHOICES.get(kind, '')}\nEnter takes what stands in brackets, {LEAVE} none; or type a column,"
    )
    note("with a unit where it is another (vx_v:mV), or a unit alone (mV).\n")
    whole = _columns(laid, kind, mapped)
    while lacking := missing_columns(kind, laid, whole):
        note(f"\nA table of {kind} needs {', '.join(lacking)} too. Once more:\n")
        whole = _columns(laid, kind, mapped)
    note(f"\nThe same again, without questions:\n    {import_command(laid, kind, whole, constants)}\n")
    return kind, whole


def _columns(laid: Sheet, kind: str, mapped: Sequence[ColumnMapping]) -> list[ColumnMapping]:
    """One question for each column that has no name of ours."""
    whole = list(mapped)
    proposals = {m.theirs: m for m in propose_mapping(laid, kind, mapped)}
    open_ones = [t for t, bare in zip(laid.header, laid.bare, strict=True) if bare not in NUMBERS]
    for theirs in open_ones:
        if theirs not in {m.theirs for m in mapped} and (m := _column(laid, theirs, proposals.get(theirs), whole)):
            whole.append(m)
    return whole


def _column(
    laid: Sheet, theirs: str, proposal: ColumnMapping | None, before: Sequence[ColumnMapping]
) -> ColumnMapping | None:
    """What a person calls one column; asked until it can be."""
    values = sample_values(laid, theirs)
    shown = f"{values.min():g} .. {values.max():g}" if len(values) else f'"{laid.sample[0][laid.header.index(theirs)]}"'
    default = proposal.text.partition("=")[0] + (f":{proposal.unit}" if proposal.unit else "") if proposal else LEAVE
    while True:
        answer = str(click.prompt(f"  {theirs:16} {shown:24}", default=default, err=True)).strip()
        try:
            return _understood(answer, theirs, proposal, before, laid.name)
        except DataError as error:
            note(f"    {error}")


def _understood(
    answer: str, theirs: str, proposal: ColumnMapping | None, before: Sequence[ColumnMapping], source: str
) -> ColumnMapping | None:
    """The column that `answer` means, None for none. Raises DataError."""
    if answer == LEAVE:
        return None
    if proposal is not None and parse_unit(answer) and answer not in NUMBERS:
        return check_unit(replace(proposal, unit=parse_unit(answer)), source)
    name, colon, unit = answer.partition(":")
    if name not in NUMBERS | {PATH}:
        raise DataError(f'"{name}" is none of our columns{nearest(name, " ".join(CHOICES.values()).split())}')
    if name in {m.name for m in before}:
        raise DataError(f"{name} is taken already")
    if colon and not parse_unit(unit):
        raise DataError(f'"{unit}" is no unit that is known here')
    return check_unit(ColumnMapping(name, theirs, parse_unit(unit)), source)
