"""Doubts about a table before any model is fitted: times, repeated values, rounding, constants.

A doubt is a sentence with the observation, its place, and the action to take. The program still uses a table with
doubts: a saturated output or a coarse converter is a property of the sensor, and a person decides.

equal values   exactly one value in several rows, where nearly all other rows differ: saturation at an end of the
               range, a placeholder for a missing reading inside it
clipped turns  an output of a gyroscope that repeats its extreme value in a turn
rounding       all outputs are multiples of a step that adds more than the noise of a mean
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from calibrations.criteria import (
    DISTINCT_SHARE,
    EARTH_UT,
    EQUAL_SHARE,
    FAR_FROM_OTHERS,
    FEWEST_EQUAL,
    FEWEST_RESPONSE_ROWS,
    RATE_AGREES,
    TIMES_NEXT,
    VISIBLE_STEP,
)
from calibrations.fitting.table_noise import excess_over_ellipsoid, scatter
from calibrations.geometry.sphere import sphere_radius
from calibrations.importing.plausible import find_time_doubt
from calibrations.means.noise import norm_std, rms, robust_std, white_std
from calibrations.table import Array, Table

FIELD_UNITS = {"nT": 1e3, "mG": 10.0, "G": 1e-2, "mT": 1e-3}  # of one uT
END_OF_RANGE = 0.25  # of the range of the other values: farther away is no end of the range
FEWEST_ON_ELLIPSOID = 15  # rows: nine parameters, and some to test them
WIDEST = 10.0  # times the noise of a mean, by the widest form of a kind


def doubts(table: Table) -> tuple[str, ...]:
    """All doubts about a table, () for a healthy one."""
    checks = (_times, _copies, _equal_values, _clipped_turns, _check_rounding, _field, _check_most_general_model)
    return tuple(text for check in checks for text in check(table))


def _times(table: Table) -> Iterator[str]:
    """Times that stop, repeat, or are too short or too long for a stage."""
    if "t_s" not in table or table.n < FEWEST_RESPONSE_ROWS:
        return
    t_s = table.column("t_s")
    if np.ptp(t_s) == 0:
        yield "t_s never changes: the order of the rows is not known, nor slow noise; give times, or remove the column"
        return
    if table.kind == "motion":
        yield from _sample_rate(table, t_s)
        return
    repeated = int(np.count_nonzero(np.diff(np.sort(t_s)) == 0))
    if repeated and not table.type.overlapping:
        yield (
            f"{repeated} rows have the same time as another row: the clock restarted, or the file contains two files. "
            "The rows are ordered by t_s; correct the times, or separate the files"
        )
    elif table.type.stage_angles:
        poses = np.column_stack([table.column("alpha_deg"), table.column("beta_deg")])[table.order]
        if (doubt := find_time_doubt(t_s[table.order], poses)) is not None:
            unit = f"; if it is in {doubt[1]}, import it with --column t_s=t_s:{doubt[1]}" if doubt[1] else ""
            yield f"t_s {doubt[0]}, in which no stage turns{unit or '; check its unit'}"


def _sample_rate(table: Table, t_s: Array) -> Iterator[str]:
    stated_hz, step_s = table.number("sample_rate_hz", 0.0), float(np.median(np.diff(t_s)))
    if stated_hz > 0 and step_s > 0 and abs(1 / step_s / stated_hz - 1) > RATE_AGREES:
        yield (
            f"t_s gives {1 / step_s:.4g} samples a second, and the constant sample_rate_hz is {stated_hz:g}; "
            "correct the unit of t_s (s), or the constant"
        )


def _equal_values(table: Table) -> Iterator[str]:
    """Exactly one value in several rows of an output or a temperature."""
    if not (table.type.means or table.type.stage_angles):
        return
    for name in (*table.output_names, *(n for n in ("temperature_c", "supply_v") if n in table)):
        values = table.column(name)
        levels, counts = np.unique(values, return_counts=True)
        if len(levels) < 2:
            continue
        mode = int(np.argmax(counts))
        count, value = int(counts[mode]), float(levels[mode])
        # An output may be clipped at both ends of its range.
        inner = (levels != value) & (levels > levels[0]) & (levels < levels[-1])
        if count < TIMES_NEXT * np.max(counts[inner], initial=1):
            continue  # a coarse reading repeats many values by chance
        other_rows = table.n - count
        if count < max(FEWEST_EQUAL, EQUAL_SHARE * table.n) or len(levels) - 1 < DISTINCT_SHARE * other_rows:
            continue
        other_values = values[values != value]
        repetition = f"{name} is exactly {value:g} in {count} of {table.n} rows, and the others all differ"
        distance = max(value - other_values.max(), other_values.min() - value)
        if name in table.output_names and 0 < distance < END_OF_RANGE * np.ptp(other_values):
            end = "highest" if value > other_values.max() else "lowest"
            yield (
                f"{repetition}: at its {end} value the output or the converter is saturated; take a wider range, or "
                "leave these rows out"
            )
        elif distance < 0 or abs(value - np.median(other_values)) > FAR_FROM_OTHERS * robust_std(
            other_values - np.median(other_values)
        ):
            yield f"{repetition}: it may mark a missing reading, or the reading is stuck; remove these rows"


def _clipped_turns(table: Table) -> Iterator[str]:
    """Turns in which an output reached the end of its range."""
    if table.kind != "turns":
        return
    from calibrations.geometry.clipped_turns import clipped_turns_warning  # other tables have no turns

    if warning := clipped_turns_warning(table):
        yield warning


def _copies(table: Table) -> Iterator[str]:
    """Columns with equal values, and a reference that does not move."""
    names = table.output_names
    for k, name in enumerate(names):
        for earlier in names[:k]:
            if np.ptp(table.column(name)) > 0 and np.array_equal(table.column(name), table.column(earlier)):
                yield f"{name} is equal to {earlier} in every row: one channel was read twice; check the channels"
    if table.kind == "motion" and np.ptp(table.column("displacement_m")) == 0:
        yield "displacement_m never changes: the displacement sensor is stuck or not connected; measure again"


def _check_rounding(table: Table) -> Iterator[str]:
    """Outputs in steps that add more than the noise of a mean."""
    white = white_std(table)
    if white is None or not table.type.known_input or table.n < FEWEST_RESPONSE_ROWS:
        return
    for k, name in enumerate(table.output_names):
        levels = np.unique(table.outputs[:, k])
        if len(levels) < 3:
            continue
        step = float(np.diff(levels).min())
        floor = float(rms(white[:, k]))
        if step / np.sqrt(12) < VISIBLE_STEP * floor:
            continue
        steps = (levels - levels[0]) / step
        if np.max(np.abs(steps - np.round(steps))) < 1e-3:
            yield (
                f"all values of {name} are multiples of {step:.3g} {table.unit}, {step / floor:.0f} times the noise of "
                "a mean: they were rounded; use values with all their digits"
            )


def _field(table: Table) -> Iterator[str]:
    """A field that is not the earth's in the stated unit."""
    if not table.type.field or table.unit != "uT":
        return
    size = sphere_radius(table)
    if EARTH_UT[0] <= size <= EARTH_UT[1]:
        return
    unit = next((u for u, size_in_ut in FIELD_UNITS.items() if EARTH_UT[0] <= size / size_in_ut <= EARTH_UT[1]), None)
    fits = f"the outputs look like {unit}: state this unit" if unit else "check the unit, or state `counts`"
    yield f"the field is {size:.4g} uT, and the earth's is {EARTH_UT[0]:g} to {EARTH_UT[1]:g} uT; {fits}"


def _check_most_general_model(table: Table) -> Iterator[str]:
    """Rows that even the most general model of their kind does not describe."""
    white = white_std(table)
    if white is None or not (table.type.widest_form or table.type.magnitude):
        return
    magnitude = table.type.magnitude
    remainder = excess_over_ellipsoid(table)[:, None] if magnitude and table.n > FEWEST_ON_ELLIPSOID else scatter(table)
    if remainder is None:
        return
    floor = rms((norm_std(table, white) / sphere_radius(table)).T) if magnitude else rms(white.T)
    times = float(np.max(rms(remainder) / floor))
    if times > WIDEST:
        yield (
            f"after the fit of {table.type.widest_form or 'an ellipsoid'}, the residual is {times:.0f} times the noise "
            "of the means: no error of a sensor explains it; check for saturated or missing readings, columns that are "
            "shifted by a row and two sensors in one file; the std columns must be standard deviations of single "
            "samples"
        )
