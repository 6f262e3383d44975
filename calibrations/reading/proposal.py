"""What a file's columns probably are: from their names, the units that they state, and the range of their values.

A proposal, for a person to confirm: `rig import` asks column by column at a terminal, and elsewhere the message about
a missing column ends with the command to copy (`tried.py`).
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from calibrations.reading.plausible import field_unit, fitting_unit, gravity_unit
from calibrations.reading.separated import Sheet, is_number, number
from calibrations.reading.units import UNITS, Mapped, name_and_unit, own_unit
from calibrations.table import AXES, KINDS, NUMBERS, OUTPUTS, Array

AXIS = r"(?:^|[^a-z])(?P<axis>[xyz])(?:[^a-z]|$)"
SCATTER = r"std|stdev|sigma|noise|scatter|deviation"
# what a name says, the first that fits; {axis} is the letter x, y or z in it
WORDS: Mapping[str, Sequence[tuple[str, str]]] = {
    "poses": (
        (r"alpha|inclin|tilt|pitch|polar|elevation", "alpha_deg"),
        (r"beta|table|azimuth|yaw|rotary|rotation|turn(?!ing)", "beta_deg"),
        (r"^dir|direction|turning|sense", "direction"),
        (r"mount", "mount_deg"),
        (r"flip|face", "flip"),
        (r"suppl|vdd|vcc|excitation", "supply_v"),
        (r"temp|thermo", "temperature_c"),
        (r"^t(_?s)?$|time|elapsed|seconds", "t_s"),
        (r"^n$|count|samples|averag", "n"),
    ),
    "positions": (
        (r"temp|thermo", "temperature_c"),
        (r"^t(_?s)?$|time|elapsed|seconds", "t_s"),
        (r"^n$|samples|averag", "n"),
        (r"gyr|omega|rate|^g[xyz]$", "g{axis}"),
        (r"mag|^m[xyz]$", "m{axis}"),
    ),
    "rates": (
        (r"temp|thermo", "temperature_c"),
        (r"^t(_?s)?$|time|elapsed|seconds", "t_s"),
        (r"^n$|samples|averag", "n"),
        (r"acc|^a[xyz]$", "a{axis}"),
        (r"gyr|omega|^g[xyz]$", "g{axis}"),
        (r"rate|speed|velocity", "rate_deg_s"),
    ),
    "motion": (
        (r"displac|distance|position|stroke", "displacement_m"),
        (r"suppl|vdd|vcc|excitation", "supply_v"),
        (r"temp|thermo", "temperature_c"),
        (r"^t(_?s)?$|time|elapsed|seconds", "t_s"),
    ),
}
SECTION = r"part|section|segment|phase|activity|label|step|^path$"  # of a session by hand, in a column of words
SCATTERS = {"poses": "v{axis}_std_v", "positions": "a{axis}_std", "rates": "g{axis}_std"}


def propose(laid: Sheet, kind: str | None = None, mapped: Sequence[Mapped] = ()) -> list[Mapped]:
    """A mapping for the columns that are not in `mapped`, which it begins with; each of our names once."""
    kind = kind or likely_kind(laid, mapped)
    if kind not in WORDS:
        return list(mapped)
    found = list(mapped)
    left = [name for name in laid.header if name not in {m.theirs for m in mapped} | NUMBERS]
    values = {name: numbers for name in left if len(numbers := values_of(laid, name))}
    guesses = by_names(laid, values, kind) if laid.named else by_values(values, kind)
    for name, ours in guesses:
        if ours not in {m.name for m in found} and ours not in laid.header and (ours != "n" or _counts(values[name])):
            found.append(Mapped(ours, name, _unit(laid, name, ours, values[name])))
    if kind == "rates":
        return _with_sections(found, laid)
    return _with_gravity(found, values) if kind == "positions" else _with_scatter(found)


def likely_kinds(laid: Sheet, mapped: Iterable[Mapped] = ()) -> list[str]:
    """The likeliest first; of a gyroscope's samples in named sections it may be that in none of them it was turned."""
    kind = likely_kind(laid, mapped)
    return ["rates", "positions"] if kind == "rates" and _section(laid) else [kind]


def likely_kind(laid: Sheet, mapped: Iterable[Mapped] = ()) -> str:
    """`rates` where there are a gyroscope's outputs, and a rate or named sections; `poses` where there is an angle of
    a stage, `motion` where there is a displacement, `positions` where there are three outputs; else `poses`."""
    names = {*(m.name for m in mapped), *laid.bare, *(_by_name(bare, "poses") for bare in laid.bare)}
    turned = {*names, *(_by_name(bare, "rates") for bare in laid.bare)}
    if {"rate_deg_s", "gx"} <= turned or (_section(laid) and {"gx", "gy", "gz"} <= turned):
        return "rates"
    if {"alpha_deg", "beta_deg"} & names:
        return "poses"
    if "displacement_m" in {*names, *(_by_name(bare, "motion") for bare in laid.bare)}:
        return "motion"
    if laid.named:
        return "positions" if names.issuperset(OUTPUTS["poses"]) or names & set(OUTPUTS["positions"]) else "poses"
    angles = [name for name in laid.header if _is_angle(values_of(laid, name))]
    return "poses" if len(angles) == 2 else "positions"


def missing(kind: str | None, laid: Sheet, mapped: Iterable[Mapped]) -> list[str]:
    """The columns that a table of this kind needs and that neither header nor mapping gives."""
    given = {m.name for m in mapped} | set(laid.bare)
    if kind == "rates" and "path" in given:
        given.add("rate_deg_s")  # the sections of a session tell it
    return [name for name in needed(kind, given) if name not in given]


def needed(kind: str | None, given: Collection[str]) -> tuple[str, ...]:
    """The columns that a table of this kind has at least; of several such sets the one that `given` come nearest to."""
    return min(KINDS[kind], key=lambda wanted: len(set(wanted) - set(given))) if kind else ()


def command(laid: Sheet, kind: str | None, mapped: Sequence[Mapped], constants: Sequence[str] = ()) -> str:
    """The `rig import` that does it without asking."""
    words = ["rig", "import", laid.name, *(["--kind", kind] if kind else [])]
    words += [word for m in mapped for word in ("--column", replace(m, theirs=_shortest(laid, m.theirs)).text)]
    words += [word for constant in constants for word in ("--constant", constant)]
    return shlex.join(words)


def _shortest(laid: Sheet, theirs: str) -> str:
    """Their name without the unit in it, where that is enough."""
    bare = name_and_unit(theirs)[0]
    return bare if laid.bare.count(bare) == 1 else theirs


def by_names(laid: Sheet, values: Mapping[str, Array], kind: str) -> list[tuple[str, str]]:
    """(theirs, ours) for the columns whose names say something."""
    bare = dict(zip(laid.header, laid.bare, strict=True))
    units = dict(zip(laid.header, laid.units, strict=True))
    said = [(name, _by_name(bare[name], kind) or _by_unit(bare[name], units[name])) for name in values]
    named = {ours for _, ours in said}
    nameless = iter(name for name in OUTPUTS[kind] if name not in named)
    plain = {name: next(nameless, "") for name, ours in said if not ours and _is_output(bare[name])}
    return [(name, ours or plain.get(name, "")) for name, ours in said if ours or plain.get(name)]


def by_values(values: Mapping[str, Array], kind: str) -> list[tuple[str, str]]:
    """(theirs, ours) for columns without names: time grows, angles lie on a grid, the others are outputs in order."""
    left = dict(values)
    found = []
    clock = next((name for name, v in left.items() if len(v) > 2 and np.all(np.diff(v) > 0)), None)
    if clock is not None and len(left) > 3:
        found.append((clock, "t_s"))
        left.pop(clock)
    if kind == "poses":
        angles = sorted((name for name, v in left.items() if _is_angle(v)), key=lambda name: len(np.unique(left[name])))
        found += list(zip(angles[:2], ("alpha_deg", "beta_deg"), strict=False))
        left = {name: v for name, v in left.items() if name not in angles[:2]}
    return [*found, *zip(left, OUTPUTS[kind], strict=False)]


def values_of(laid: Sheet, name: str) -> Array:
    """The first values of a column; none where it holds words."""
    cells = [row[laid.header.index(name)] for row in laid.sample]
    return np.array([number(cell) for cell in cells]) if all(map(is_number, cells)) else np.zeros(0)


def _by_name(bare: str, kind: str) -> str:
    """Our name for theirs, "" where it says nothing."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", bare)
    axis = next((m["axis"] for m in re.finditer(AXIS, re.sub(r"[^a-z]", " ", words.lower()))), "")
    lower = words.lower()
    if bare in ("T", "Temp"):
        return "temperature_c"
    if axis and kind in SCATTERS and re.search(SCATTER, lower):
        return SCATTERS[kind].format(axis=axis)
    ours = next((ours for pattern, ours in WORDS[kind] if re.search(pattern, lower)), None)
    if ours is not None:
        return "" if "{axis}" in ours and not axis else ours.format(axis=axis)
    last = re.search(r"(?:^|[_\W]|^v|^u|^a|acc|out)(?P<axis>[xyz])\d*$", lower)
    axis = axis or (last["axis"] if last else "")
    return dict(zip(AXES, OUTPUTS[kind], strict=False)).get(axis, "")


def _by_unit(bare: str, unit: str) -> str:
    """What a unit alone says: nothing is a temperature but what is in degrees of one."""
    own = UNITS[unit][0] if unit else ""
    return {"degC": "temperature_c", "s": "t_s"}.get(own, "") if bare else ""


def _is_output(bare: str) -> bool:
    return re.search(r"v?out|volt|signal|sensor|^v$|^u$|^ch|channel|ain|adc|acc", bare.lower()) is not None


def _is_angle(values: Array) -> bool:
    """Whether numbers lie on a grid of degrees within a turn either way, and some lie beyond a radian's."""
    on_grid = np.all(np.abs(values * 4 - np.round(values * 4)) < 1e-6)
    return bool(len(values) and on_grid and 2 * np.pi < np.max(np.abs(values)) <= 360)


def _unit(laid: Sheet, name: str, ours: str, values: Array) -> str:
    """The unit that the file states, where it fits; else the one that the values speak for."""
    stated, own = laid.units[laid.header.index(name)], own_unit(ours)
    if stated:
        return stated if not own or UNITS[stated][0] == own else ""
    return fitting_unit(ours, values)


def _counts(values: Array) -> bool:
    """Whether numbers may count averaged samples: whole, 1 or more, and not a row's running number, over and over."""
    running = len(values) > 2 and float(np.mean(np.diff(values) == 1)) > 0.5
    return bool(np.all(values >= 1) and np.all(values % 1 == 0)) and not running


def _section(laid: Sheet) -> str:
    """The column of words that names the section of every row; "" without one."""
    words = [name for name in laid.header if laid.named and not len(values_of(laid, name))]
    return next((name for name in words if re.search(SECTION, name.lower())), "")


def _with_sections(found: list[Mapped], laid: Sheet) -> list[Mapped]:
    """With the sections that tell the rates, where no column does."""
    given, section = {m.name for m in found} | set(laid.bare), _section(laid)
    lacks = section and not {"rate_deg_s", "path"} & given
    return [Mapped("path", section), *found] if lacks else found


def _with_scatter(found: list[Mapped]) -> list[Mapped]:
    """A standard deviation without a unit is in that of its output."""
    units = {m.name.replace("_v", "_std_v"): m.unit for m in found if m.name in OUTPUTS["poses"]}
    return [replace(m, unit=m.unit or units.get(m.name, "")) for m in found]


def _with_gravity(found: list[Mapped], values: Mapping[str, Array]) -> list[Mapped]:
    """Axes without a unit in the one that has 1 g for gravity, else in counts; of a magnetometer in uT, if in any."""
    for names, unit_of_all in ((OUTPUTS["positions"], gravity_unit), (OUTPUTS["fields"], field_unit)):
        axes = {m.name: m.theirs for m in found if m.name in names and not m.unit and m.theirs in values}
        if len(axes) == len(AXES):
            unit = unit_of_all(np.column_stack([values[theirs] for theirs in axes.values()]))
            found = [replace(m, unit=unit) if m.name in axes else m for m in found]
    return found
