"""Free forms that a person asks for by name, `free:PLACE`, and what data would be needed to show each.

A requested form has no sizes yet: the first fit estimates them (`calibrations.fitting.requested_forms`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calibrations.effects import Effect
from calibrations.effects.catalogue import find
from calibrations.errors import nearest
from calibrations.free_forms.effect import FreeForm, place_of
from calibrations.free_forms.form import ANGLES, TILT, TURNING_AXES
from calibrations.free_forms.place_names import PLACES, PREFIX
from calibrations.geometry.stage_path import last_turn, with_approach
from calibrations.table import Table

FEWEST_VALUES = 8  # of what drives a curve
FEWEST_TEMPERATURES = 4
FEWEST_INCLINATIONS = 4
# places that only poses of a rig can show
OF_STAGES = ("stage-angle-alpha", "stage-angle-beta", "tilt-over-time", "temperature-axes", "beta-bias", "history")
COLUMN = "column:"
KNOWN_AS = {"temperature_c": "temperature-bias", "t_s": "time-bias", "alpha_deg": "stage-angle-alpha",
            "beta_deg": "stage-angle-beta"}  # columns whose place has a name of its own  # fmt: skip


@dataclass(frozen=True)
class _Driver:
    """Where a place acts in the chain, and what must change in the data."""

    hook: str
    needs: str  # "beta", "inclination", "inclinations", "sides", "temperature", "time", "axes" or "column"


DRIVERS = {
    "stage-angle-alpha": _Driver("pose", "inclinations"),
    "stage-angle-beta": _Driver("pose", "beta"),
    "tilt-over-time": _Driver("pose", "time"),
    "own-response": _Driver("transduction", "beta"),
    "cross-response": _Driver("transduction", "beta"),
    "z-response": _Driver("transduction", "inclinations"),
    "scale-over-cross": _Driver("transduction", "beta"),
    "scale-over-z": _Driver("transduction", "inclinations"),
    "force": _Driver("transduction", "inclinations"),
    "history": _Driver("transduction", "sides"),
    "beta-bias": _Driver("transduction", "inclinations"),
    "temperature-bias": _Driver("transduction", "temperature"),
    "temperature-scale": _Driver("transduction", "temperature"),
    "temperature-axes": _Driver("transduction", "temperature"),
    "time-bias": _Driver("transduction", "time"),
    "time-scale": _Driver("transduction", "time"),
    "output": _Driver("output", "axes"),
}


class RequestedForm(FreeForm):
    """free-form: a smooth function of unknown form acts at one place of the signal chain.

        V += f_i(x)          x: what drives the place; f: a penalised spline, of a size that the data show

    Symptom   the residual is a smooth curve over what drives the place.
    Excited by  data in which x changes.
    Confused with  catalogue effects that act at the same place; their forms are drawn through the curve.
    Source    Wood (2017), 5.8; Patterson and Thompson (1971).
    """

    def __init__(self, place: str) -> None:
        """A form without sizes, and therefore without parameters."""
        self.forms = ()
        self.place = place
        self.name = f"{PREFIX}{place}"
        self.summary = f"{PLACES.get(place, 'output over the logged column')}, of unknown form"
        self.places = frozenset({DRIVERS[place].hook if place in DRIVERS else "transduction"})
        self.formula = _formula(place)

    def lacks(self, table: Table) -> str | None:
        """Which data the table would need to show the form, or None."""
        return shortage(self.place, table)


def resolve_effect(name: str, effects: Mapping[str, Effect]) -> Effect:
    """The effect of the catalogue, or the free form `free:PLACE`, of that name.

    Raises UnknownName or ModelError with the nearest name.
    """
    return RequestedForm(place_of(name)) if name.startswith(PREFIX) else find(name, effects)


def shortage(place: str, table: Table) -> str | None:
    """The data that a free form at `place` still needs, in words that follow its name; None where the data suffice."""
    fewest, rows = table.type.fewest_for_form, table.type.rows
    if table.n < fewest:
        return f"needs {fewest} {rows} or more, and the data has {table.n}; measure more {rows}"
    if place.startswith(COLUMN):
        return _short_column(place.removeprefix(COLUMN), table)
    required = DRIVERS[place].needs
    if not table.type.stage_angles:
        if place in OF_STAGES:
            return f"needs a sweep of poses: stages move the sensor little, or not at all, in {table.type.name}"
        required = required if required in ("temperature", "time", "axes") else ""
    match required:
        case "":
            return None
        case "beta":
            return _shortage_of_values("angles beta", table, "beta_deg", FEWEST_VALUES, "use steps of 30 deg or less")
        case "inclinations":
            return _shortage_of_values("inclinations alpha", table, "alpha_deg", FEWEST_INCLINATIONS,
                        "measure at other inclinations as well, such as 30, 60, 90 and 150 deg")  # fmt: skip
        case "temperature":
            return _shortage_of_values("temperatures", table, "temperature_c", FEWEST_TEMPERATURES,
                        "measure while the temperature changes")  # fmt: skip
        case "time":
            return None if "t_s" in table else "needs the column t_s, the time of each pose"
        case "sides":
            return _short_sides(table)
    return None if len(table.axes) > 1 else (
        "needs the outputs of two axes or more, because one axis cannot separate the converter from its own response; "
        "use free:own-response"
    )  # fmt: skip


def _shortage_of_values(subject: str, table: Table, column: str, fewest: int, advice: str) -> str | None:
    if column not in table:
        return f"needs the column {column}"
    values = table.column(column)
    span = float(np.ptp(values)) or 1.0
    distinct = len(np.unique(np.round((np.mod(values, 360) if column == "beta_deg" else values) / span, 4)))
    if distinct >= fewest:
        return None
    count_words = f"one only, {values[0]:g}" if distinct == 1 else f"{distinct}"
    return f"needs {fewest} different {subject} or more, and the data has {count_words}; {advice}"


def _short_sides(table: Table) -> str | None:
    if "direction" not in table and "t_s" not in table:
        return "needs the column direction, or t_s, to know from which side each pose was approached"
    logged = table.column("direction") if "direction" in table else np.zeros(table.n)
    turn = np.where(logged != 0, logged, last_turn(with_approach(table, 0.0)))
    if np.ptp(turn) > 0:
        return None
    return "needs poses that beta approaches from both sides, and here it comes from one only; turn both ways"


def _short_column(name: str, table: Table) -> str | None:
    if name in KNOWN_AS:
        return f"has a place of its own; use {PREFIX}{KNOWN_AS[name]}"
    if name == "std":
        names = table.std_names
        missing = [n for n in names if n not in table]
        if missing:
            return f"needs the standard deviations of the samples, column {', '.join(missing)}"
        constant = [n for n in names if not np.ptp(table.column(n)) > 0]
        return f"needs standard deviations that change, and {constant[0]} is constant" if constant else None
    if name not in table:
        logged = [c for c in table.columns if c not in table.output_names and c not in KNOWN_AS]
        return f"needs the column {name}, which the data does not have{nearest(name, logged)}"
    if not np.ptp(table.column(name)) > 0:
        value = table.column(name)[0]
        return f"needs a column that changes, and {name} is constant ({value:g}); measure while it changes"
    return None


def _formula(place: str) -> str:
    if place in ("stage-angle-alpha", "stage-angle-beta"):
        angle = next(a for a in ANGLES if place.endswith(a))
        return f"{angle} <- {angle} + f({angle})"
    if place == TILT:
        return "the base turns about x, y, z by f_x(t), f_y(t), f_z(t)"
    if place == TURNING_AXES:
        return "V += a_j f_i(T) + a_z g_i(T)"
    x = {"own-response": "a_i", "cross-response": "a_j", "z-response": "a_z", "output": "V", "force": "a"}
    factor = "a_i " if place.startswith("scale-over") or place.endswith("-scale") else ""
    arguments = {"scale-over-cross": "a_j", "scale-over-z": "a_z", "history": "a, on the way to the pose"}
    end = {"temperature-bias": "T", "temperature-scale": "T", "time-bias": "t", "time-scale": "t", "beta-bias": "beta"}
    return f"V += {factor}f_i({(x | arguments | end).get(place, place.removeprefix(COLUMN))})"
