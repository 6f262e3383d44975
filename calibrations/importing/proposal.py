"""Proposed column mappings of a file, from its column names, units and values.

A person confirms a proposal: `rig import` asks for each column at a terminal; elsewhere the message about a missing
column ends with the command to copy (`suggestion.py`).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from calibrations.importing.cells import parse_cell
from calibrations.importing.plausible import (
    Doubt,
    field_unit,
    find_log_time_doubt,
    find_time_doubt,
    likely_unit,
    unit_at_rest,
)
from calibrations.importing.sheet import Sheet
from calibrations.importing.units import UNITS, ColumnMapping, column_unit, parse_unit, split_unit
from calibrations.table import AXES, NUMBERS, Array
from calibrations.tables import KINDS, TURN_MARKS

# names of columns by kind of table; each second list belongs to another sensor
COLUMN_NAMES: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "poses": {
        "": ("alpha_deg", "beta_deg", "vx_v", "vy_v", "vz_v", "direction", "t_s", "temperature_c", "supply_v",
             "vx_std_v", "vy_std_v", "n", "flip"),
    },
    "positions": {"": ("ax", "ay", "az", "t_s", "temperature_c", "n"), "of a magnetometer": ("mx", "my", "mz")},
    "rates": {
        "": ("rate_deg_s", "gx", "gy", "gz", "ax", "ay", "az", "axis_x", "axis_y", "axis_z", "t_s", "temperature_c",
             "n"),
        "of named sections": ("path",),
    },
    "turns": {"": ("t_s", "turn", "resting", "gx", "gy", "gz", "ax", "ay", "az", "temperature_c")},
    "motion": {"": ("t_s", "vx_v", "vy_v", "displacement_m", "temperature_c", "supply_v")},
    "still": {"": ("t_s", "vx_v", "vy_v", "vz_v", "temperature_c", "supply_v")},
}  # fmt: skip
AXIS = r"(?:^|[^a-z])(?P<axis>[xyz])(?:[^a-z]|$)"
TEMPERATURE = r"temp(?!s$|o$)|thermo"
TIME = r"^t(_?s)?$|time|elapsed|seconds|^minutes$|^hours$|zeit|^temps$|^tiempo|^tempo$"
SCATTER = r"std|stdev|sigma|noise|scatter|deviation"
# meaning of a name, the first match; {axis} is the letter x, y or z in it; some names are German or French
NAME_PATTERNS: Mapping[str, Sequence[tuple[str, str]]] = {
    "poses": (
        (r"alpha|inclin|tilt|pitch|polar|elevation|outer|neigung|^kipp|schwenk", "alpha_deg"),
        (r"beta|table|azimu|yaw|rotary|rotation|inner|turn(?!ing)|dreh|rundtisch|plateau", "beta_deg"),
        (r"^dir|direction|turning|sense", "direction"),
        (r"mount", "mount_deg"),
        (r"flip|face", "flip"),
        (r"suppl|vdd|vcc|excitation", "supply_v"),
        (TEMPERATURE, "temperature_c"),
        (TIME, "t_s"),
        (r"^n$|count|samples|averag", "n"),
    ),
    "positions": (
        (TEMPERATURE, "temperature_c"),
        (TIME, "t_s"),
        (r"^n$|samples|averag", "n"),
        (r"orient|quat", ""),
        (r"gyr|omega|rate|angular|^g[xyz]$", "g{axis}"),
        (r"mag|^m[xyz]$", "m{axis}"),
    ),
    "rates": (
        (TEMPERATURE, "temperature_c"),
        (TIME, "t_s"),
        (r"^n$|samples|averag", "n"),
        (r"orient|quat", ""),
        (r"acc|^a[xyz]$", "a{axis}"),
        (r"gyr|omega|angular|^g[xyz]$", "g{axis}"),
        (r"rate|speed|velocity", "rate_deg_s"),
    ),
    "turns": (
        (TEMPERATURE, "temperature_c"),
        (TIME, "t_s"),
        (r"orient|quat", ""),
        (r"acc|^a[xyz]$", "a{axis}"),
        (r"gyr|omega|angular|^g[xyz]$", "g{axis}"),
    ),
    "motion": (
        (r"displac|distance|position|stroke", "displacement_m"),
        (r"suppl|vdd|vcc|excitation", "supply_v"),
        (TEMPERATURE, "temperature_c"),
        (TIME, "t_s"),
    ),
}
INDEXED_NAME = re.compile(r"(?P<name>.*(?:acc|gyr|mag).*)\[(?P<index>\d)\]$", re.IGNORECASE)
SECTION = r"part|section|segment|phase|activity|label|step|^path$"  # of a session by hand, in a column of words
LONG_TABLE = 150  # rows, of the first HEAD_LINES
STD_COLUMNS = {"poses": "v{axis}_std_v", "positions": "a{axis}_std", "rates": "g{axis}_std"}


def column_names(kind: str | None = None) -> list[str]:
    """The names of columns that a file may have: of one kind of table, or of all."""
    lists = COLUMN_NAMES.values() if kind is None else [COLUMN_NAMES[kind]]
    return list(dict.fromkeys(name for names_by_kind in lists for names in names_by_kind.values() for name in names))


def propose_mapping(laid: Sheet, kind: str | None = None, mapped: Sequence[ColumnMapping] = ()) -> list[ColumnMapping]:
    """`mapped`, and a mapping for the other columns; each of our names once."""
    kind = kind or likely_kind(laid, mapped)
    if kind not in NAME_PATTERNS:
        return list(mapped)
    mapping = list(mapped)
    unmapped = [name for name in laid.header if name not in {m.file_column for m in mapped} | NUMBERS]
    values = {name: numbers for name in unmapped if len(numbers := sample_values(laid, name))}
    guesses = guess_by_names(laid, values, kind) if laid.named else guess_by_values(values, kind)
    for name, target in guesses:
        if target == "n" and not _counts(values[name], guesses):
            continue
        if target not in {m.name for m in mapping} and target not in laid.header:
            mapping.append(ColumnMapping(target, name, _unit(laid, name, target, values[name])))
    if kind == "rates":
        return _with_sections(mapping, laid)
    if kind == "positions":
        return _with_log_time(_with_gravity(mapping, values), values)
    return _with_scatter(_with_time(mapping, laid))


def second_sensor(laid: Sheet, kind: str, mapping: Sequence[ColumnMapping]) -> list[ColumnMapping]:
    """The outputs of a second sensor of the same make in the columns that `mapping` does not use; else none.

    Its names differ from those of the mapped outputs in a number only, such as imu1_acc_x and imu2_acc_x.
    """
    outputs = [m for m in mapping if m.name in (*KINDS[kind].outputs, *KINDS[kind].digital)]
    unmapped = [name for name in laid.header if laid.named and name not in {m.file_column for m in mapping}]
    twins = [
        next((name for name in unmapped if _without_digits(name) == _without_digits(m.file_column)), "")
        for m in outputs
    ]
    if len(outputs) < len(AXES) or not all(twins) or len({*twins}) < len(twins):
        return []
    return [replace(m, file_column=name) for m, name in zip(outputs, twins, strict=True)]


def _without_digits(name: str) -> str:
    return re.sub(r"\d", "", name)


def likely_kinds(laid: Sheet, mapped: Iterable[ColumnMapping] = ()) -> list[str]:
    """The likely kinds, most likely first; samples of a gyroscope in named sections may contain no turn."""
    kind = likely_kind(laid, mapped)
    return ["rates", "positions"] if kind == "rates" and _section(laid) else [kind]


def likely_kind(laid: Sheet, mapped: Iterable[ColumnMapping] = ()) -> str:
    """`rates` with a gyroscope's outputs and a rate or named sections; `poses` with a stage angle; `motion` with a
    displacement; `positions` with three outputs; else `poses`.
    """
    names = {*(m.name for m in mapped), *laid.bare, *(_meaning_of_name(unitless, "poses") for unitless in laid.bare)}
    turned = {*names, *(_meaning_of_name(unitless, "rates") for unitless in laid.bare)}
    if {"rate_deg_s", "gx"} <= turned or (_section(laid) and {"gx", "gy", "gz"} <= turned):
        return "rates"
    if {"alpha_deg", "beta_deg"} & names:
        return "poses"
    if "displacement_m" in {*names, *(_meaning_of_name(unitless, "motion") for unitless in laid.bare)}:
        return "motion"
    if laid.named:
        return (
            "positions"
            if names.issuperset(KINDS["poses"].outputs) or names & set(KINDS["positions"].outputs)
            else "poses"
        )
    angles = [name for name in laid.header if _is_angle(sample_values(laid, name))]
    return "poses" if len(angles) == 2 else "positions"


def missing_columns(kind: str | None, laid: Sheet, mapped: Iterable[ColumnMapping]) -> list[str]:
    """The columns that a table of this kind needs and that neither header nor mapping gives."""
    present = {m.name for m in mapped} | set(laid.bare)
    if kind == "rates" and ("path" in present or "turn_deg" in laid.constants):
        present.add("rate_deg_s")  # given by the sections of a session, or by whole turns
    if kind == "turns" and TURN_MARKS.isdisjoint(present):
        present |= TURN_MARKS
    return [name for name in required_columns(kind, present) if name not in present]


def required_columns(kind: str | None, present: Collection[str]) -> tuple[str, ...]:
    """The columns that a table of this kind needs; of several sets the one nearest to `present`."""
    return min(KINDS[kind].columns, key=lambda columns: len(set(columns) - set(present))) if kind else ()


def guess_by_names(laid: Sheet, values: Mapping[str, Array], kind: str) -> list[tuple[str, str]]:
    """(their name, our name) for the columns with a meaningful name."""
    unitless = dict(zip(laid.header, laid.bare, strict=True))
    units = dict(zip(laid.header, laid.units, strict=True))
    guesses = [(name, _meaning_of_column(unitless[name], units[name], kind)) for name in values]
    targets = {target for _, target in guesses}
    nameless = iter(name for name in KINDS[kind].outputs if name not in targets)
    likely = [name for name, target in guesses if not target and _is_output(unitless[name])]
    outputs = {name: next(nameless, "") for name in likely if not _contradicts(units[name], KINDS[kind].outputs[0])}
    return [(name, target or outputs.get(name, "")) for name, target in guesses if target or outputs.get(name)]


def guess_by_values(values: Mapping[str, Array], kind: str) -> list[tuple[str, str]]:
    """(their name, our name) for columns without names: time grows, angles lie on a grid, the others are outputs in
    order.
    """
    remaining = dict(values)
    guesses = []
    clock = next((name for name, v in remaining.items() if len(v) > 2 and np.all(np.diff(v) > 0)), None)
    if clock is not None and len(remaining) > 3:
        guesses.append((clock, "t_s"))
        remaining.pop(clock)
    if kind == "poses":
        angles = sorted(
            (name for name, v in remaining.items() if _is_angle(v)), key=lambda name: len(np.unique(remaining[name]))
        )
        guesses += list(zip(angles[:2], ("alpha_deg", "beta_deg"), strict=False))
        remaining = {name: v for name, v in remaining.items() if name not in angles[:2]}
        outputs = list(remaining.values())[:1]
        remaining = {name: v for name, v in remaining.items() if _resembles_output(v, outputs[0])}
    return [*guesses, *zip(remaining, KINDS[kind].outputs, strict=False)]


def _resembles_output(values: Array, output: Array) -> bool:
    """Whether numbers come near the range of an output; a temperature beside voltages does not."""
    margin = max(float(np.ptp(output)), float(np.ptp(values)), float(np.abs(output).max()))
    return bool(values.min() <= output.max() + margin and values.max() >= output.min() - margin)


def sample_values(laid: Sheet, name: str) -> Array:
    """The first values of a column; none for a column of words."""
    cells = [row[laid.header.index(name)] for row in laid.sample]
    try:
        values = np.array([parse_cell(cell) for cell in cells])
    except ValueError:
        return np.zeros(0)
    return values if np.isfinite(values).all() else np.zeros(0)


def sensor_kind(header: Iterable[str], topic: str) -> str:
    """The sensor whose three axes, or whose poses, a topic and its columns name: a, m or g; "" for none."""
    unitless = {split_unit(name)[0] for name in header}
    if {"vx_v", "alpha_deg"} & unitless:
        return "a"
    for names in (unitless & NUMBERS, {_meaning_of_name(f"{topic}_{name}", "positions") for name in unitless}):
        for sensor in "amg":
            if names.issuperset(sensor + axis for axis in AXES):
                return sensor
    return ""


def _meaning_of_name(unitless: str, kind: str) -> str:
    """Our name for theirs, "" for a name without a known meaning."""
    if (match := INDEXED_NAME.match(unitless)) and int(match["index"]) < len(AXES):
        unitless = f"{match['name']}_{AXES[int(match['index'])]}"  # accSmooth[0] of Betaflight
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", unitless)
    axis = next((m["axis"] for m in re.finditer(AXIS, re.sub(r"[^a-z]", " ", words.lower()))), "")
    lower = words.lower()
    if unitless in ("T", "Temp"):
        return "temperature_c"
    if axis and kind in STD_COLUMNS and re.search(SCATTER, lower):
        return STD_COLUMNS[kind].format(axis=axis)
    target = next((target for pattern, target in NAME_PATTERNS[kind] if re.search(pattern, lower)), None)
    if target is not None:
        return "" if "{axis}" in target and not axis else target.format(axis=axis)
    last = re.search(r"(?:^|[_\W]|^v|^u|^a|acc|out)(?P<axis>[xyz])\d*$", lower)
    axis = axis or (last["axis"] if last else "")
    return dict(zip(AXES, KINDS[kind].outputs, strict=False)).get(axis, "")


def _meaning_of_column(unitless: str, unit: str, kind: str) -> str:
    """Our name for theirs; a name whose unit is that of another quantity has the meaning of the unit."""
    target = _meaning_of_name(unitless, kind)
    return target if target and not _contradicts(unit, target) else _meaning_of_unit(unitless, unit)


def _contradicts(unit: str, target: str) -> bool:
    """Whether the stated unit is that of another quantity than our column `target`."""
    target_unit = column_unit(target)
    return bool(unit and target_unit and UNITS[unit][0] != target_unit)


def _meaning_of_unit(unitless: str, unit: str) -> str:
    """Our name by the unit alone: a temperature or a time."""
    target_unit = UNITS[unit][0] if unit else ""
    return {"degC": "temperature_c", "s": "t_s"}.get(target_unit, "") if unitless else ""


def _is_output(unitless: str) -> bool:
    return re.search(r"v?out|volt|signal|sensor|^v$|^u$|^ch|channel|ain|adc|acc", unitless.lower()) is not None


def _is_angle(values: Array) -> bool:
    """Whether numbers lie on a grid of degrees within a turn either way, and some exceed a turn in rad."""
    if not 2 * np.pi < np.max(np.abs(values), initial=0.0) <= 360:
        return False
    return bool(np.all(np.abs(values * 4 - np.round(values * 4)) < 1e-6))


def _unit(laid: Sheet, name: str, target: str, values: Array) -> str:
    """The unit that the file states, if it fits; else the one that fits the values."""
    stated_unit, target_unit = laid.units[laid.header.index(name)], column_unit(target)
    if stated_unit:
        return stated_unit if not target_unit or UNITS[stated_unit][0] == target_unit else ""
    if target == "t_s" and name.lower() in ("minutes", "hours"):
        return parse_unit(name)
    return likely_unit(target, values)


def _counts(values: Array, guesses: Collection[tuple[str, str]]) -> bool:
    """Whether numbers can count averaged samples: whole, 1 or more, and not a running row number.

    A long table without a standard deviation is a log, and its column of numbers does not count samples of a mean.
    """
    if len(values) >= LONG_TABLE and not any("_std" in target for _, target in guesses):
        return False
    running = len(values) > 2 and float(np.mean(np.diff(values) == 1)) > 0.5
    return bool(np.all(values >= 1) and np.all(values % 1 == 0)) and not running


def _section(laid: Sheet) -> str:
    """The column of words that names each row's section; "" without one."""
    words = [name for name in laid.header if laid.named and not len(sample_values(laid, name))]
    return next((name for name in words if re.search(SECTION, name.lower())), "")


def _with_sections(mapping: list[ColumnMapping], laid: Sheet) -> list[ColumnMapping]:
    """The mapping with the section column, where no column gives the rate."""
    present, section = {m.name for m in mapping} | set(laid.bare), _section(laid)
    lacks = section and not {"rate_deg_s", "path"} & present
    return [ColumnMapping("path", section), *mapping] if lacks else mapping


def time_doubt(laid: Sheet, mapped: Iterable[ColumnMapping]) -> Doubt | None:
    """The doubt about the unit of the time, as the first rows show it; None where a unit is stated."""
    columns = {m.name: m.file_column for m in mapped}
    clock = next((m for m in mapped if m.name == "t_s" and not m.unit), None)
    angles = [sample_values(laid, columns[name]) for name in ("alpha_deg", "beta_deg") if name in columns]
    if clock is None or not angles or not all(map(len, angles)):
        return None
    time_s = sample_values(laid, clock.file_column)
    return find_time_doubt(time_s, np.column_stack(angles)) if len(time_s) else None


def _with_time(mapping: list[ColumnMapping], laid: Sheet) -> list[ColumnMapping]:
    """The mapping in which a time that cannot be in s has the unit that fits."""
    doubt = time_doubt(laid, mapping)
    return [replace(m, unit=doubt[1]) if doubt and m.name == "t_s" else m for m in mapping]


def _with_log_time(mapping: list[ColumnMapping], values: Mapping[str, Array]) -> list[ColumnMapping]:
    """The mapping in which the time of a log has the unit that gives a likely sample rate."""
    logs = {m for m in mapping if m.name == "t_s" and not m.unit and len(values.get(m.file_column, ())) >= LONG_TABLE}
    doubts = {m: find_log_time_doubt(values[m.file_column], m.file_column) for m in logs}
    return [replace(m, unit=doubt[1]) if (doubt := doubts.get(m)) else m for m in mapping]


def _with_scatter(mapping: list[ColumnMapping]) -> list[ColumnMapping]:
    """The mapping in which a standard deviation has its output's unit."""
    units = {m.name.replace("_v", "_std_v"): m.unit for m in mapping if m.name in KINDS["poses"].outputs}
    return [replace(m, unit=m.unit or units.get(m.name, "")) for m in mapping]


def _with_gravity(mapping: list[ColumnMapping], values: Mapping[str, Array]) -> list[ColumnMapping]:
    """The mapping in which axes have the unit that fits them at rest; axes of a magnetometer uT, where it fits."""
    for names, unit_of_all in ((KINDS["positions"].outputs, unit_at_rest), (KINDS["fields"].outputs, field_unit)):
        axes = {m.name: m.file_column for m in mapping if m.name in names and not m.unit and m.file_column in values}
        if len(axes) == len(AXES):
            unit = unit_of_all(np.column_stack([values[column] for column in axes.values()]))
            mapping = [replace(m, unit=unit) if m.name in axes else m for m in mapping]
    return mapping
