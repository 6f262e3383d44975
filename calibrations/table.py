"""A table of measurements: named columns, constants, and where they came from.

The kinds and their columns are those of the data files: `poses` (the mean of one dwell at known stage
angles), `positions` (the mean of one still position of unknown orientation), `motion`, `still`, `rates`.
"""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError, MissingColumn, nearest
from calibrations.frames import data_frame, html_table
from calibrations.tables import FILE_KINDS, KINDS, Kind
from calibrations.text import columns

Array = NDArray[np.float64]
Constant = str | float

# fmt: off
OPTIONAL = (
    "vy_v", "vz_v", "path", "t_s", "direction", "temperature_c", "supply_v", "mount_deg", "flip",
    "vx_std_v", "vy_std_v", "vz_std_v", "n", "ax_std", "ay_std", "az_std", "mx_std", "my_std", "mz_std",
    "gx", "gy", "gz", "gx_std", "gy_std", "gz_std", "mx", "my", "mz", "axis_x", "axis_y", "axis_z",
    "alpha_set_deg", "beta_set_deg",
)
# fmt: on
NUMBERS = {name for kind in KINDS.values() for wanted in kind.columns for name in wanted} | set(OPTIONAL) - {"path"}
AXES = ("x", "y", "z")
LIKE = 0.65  # likeness of an unknown name and a column's, at which it may be meant
MILLI = {"g": "mg", "field": "‰ of the field", "deg/s": "mdeg/s"}  # thousandths of the sensed quantity
STANDARD_GRAVITY = 9.80665
GRAVITY_M_S2 = (9.76, 9.84)  # local gravity on Earth: from the highest mountain near the equator to the poles
FIRST, LAST = 5, 3  # rows of a long table that a terminal and a notebook show
LENGTHS = ((7200.0, 3600.0, "h"), (180.0, 60.0, "min"), (-1.0, 1.0, "s"))  # of a time axis: longer than, unit, its name
HOLD = "hold "  # the paths of a soak, which switches the sensor on
LARGEST = 1e30  # in any unit: measurements are smaller, and the fourth power must still be a number
IN_MEMORY = "the table"  # how messages call a table that was read from no file


@dataclass(frozen=True, eq=False, repr=False)
class Table:
    """Columns of equal length (float64), text columns, and constants. Made by `from_columns` or `read_csv`."""

    kind: str
    columns: Mapping[str, Array]
    constants: Mapping[str, Constant] = field(default_factory=dict)
    source: str = IN_MEMORY
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    numbers: NDArray[np.intp] | None = None  # of the rows in what they were taken from; None: 0, 1, 2 ...
    noise: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)  # by axis: `known_noise`
    left_out: tuple[str, ...] = ()  # places of the signal chain in which no search looks for a cause

    @staticmethod
    def from_columns(
        kind: str,
        columns: Mapping[str, Iterable[float]],
        constants: Mapping[str, Constant] | None = None,
        source: str = IN_MEMORY,
        labels: Mapping[str, tuple[str, ...]] | None = None,
    ) -> Table:
        """A checked table. Raises DataError when it cannot be a table of this kind."""
        arrays = {name: _numbers(name, values, source) for name, values in columns.items()}
        for values in arrays.values():
            values.flags.writeable = False
        table = Table(kind, MappingProxyType(arrays), dict(constants or {}), source, dict(labels or {}))
        _check(table)
        return table

    @property
    def n(self) -> int:
        """Number of rows."""
        return len(next(iter(self.columns.values()), ()))

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def column(self, name: str) -> Array:
        """One column, shape (n,). Raises MissingColumn with the nearest name."""
        if name not in self.columns:
            raise MissingColumn(f'{self.source}: column "{name}" is missing{nearest(name, self.columns)}')
        return self.columns[name]

    def optional(self, name: str, default: float) -> Array:
        """One column, or a constant in its place, shape (n,)."""
        return self.columns[name] if name in self.columns else np.full(self.n, default)

    def number(self, name: str, default: float) -> float:
        """One constant as a number."""
        value = self.constants.get(name, default)
        try:
            return float(value)
        except ValueError:
            raise DataError(
                f'{self.source}: the constant "{name}" is {value!r}, not a number; correct the line '
                f"`# {name}: ...`, or remove it"
            ) from None

    def __repr__(self) -> str:
        head, rows = self._shown()
        return f"{self._title}\n\n{columns(head, rows)}"

    def _repr_html_(self) -> str:
        return html_table(*self._shown(), caption=self._title)

    @property
    def _title(self) -> str:
        texts = [
            f"{name}: {f'{value:.6g}' if isinstance(value, float) else value}" for name, value in self.constants.items()
        ]
        constants_text = f"; {', '.join(texts)}" if texts else ""
        return f"{self.n} rows of {self.kind}{f', {self.source}' if self.source != IN_MEMORY else ''}{constants_text}"

    def _shown(self) -> tuple[list[str], list[list[str]]]:
        """Head and rows of a view: all rows, or the first and last of many."""
        is_long = self.n > FIRST + LAST
        rows = [*range(FIRST), *range(self.n - LAST, self.n)] if is_long else list(range(self.n))
        cells = [
            [str(k), *(f"{v[k]:.6g}" for v in self.columns.values()), *(t[k] for t in self.labels.values())]
            for k in rows
        ]
        if is_long:
            cells.insert(FIRST, ["..."] * len(cells[0]))
        return ["", *self.columns, *self.labels], cells

    def to_dataframe(self) -> Any:
        """The columns, with those of texts, as a pandas.DataFrame; the constants are in its `attrs`.

        Raises CalibrationError where pandas is not installed.
        """
        frame = data_frame({**self.columns, **self.labels})
        frame.attrs.update(self.constants)
        return frame

    @property
    def content(self) -> str:
        """The kind for which effects are defined: that of the table, or "fields" for positions of a magnetometer.

        With an accelerometer in the same table, the constant `triad: m` selects the magnetometer.
        """
        if self.kind != "positions" or "mx" not in self.columns:
            return self.kind
        return "fields" if "ax" not in self.columns or self.constants.get("triad") == "m" else self.kind

    @property
    def type(self) -> Kind:
        """The properties of this kind of data."""
        return KINDS[self.content]

    @property
    def output_names(self) -> tuple[str, ...]:
        """The columns of outputs that an axis each was measured in."""
        return tuple(name for name in self._output_columns if name in self)

    @cached_property
    def axes(self) -> tuple[str, ...]:
        """The sensing axes that were measured, of "x", "y", "z"."""
        return tuple(axis for axis, name in zip(AXES, self._output_columns, strict=False) if name in self)

    @property
    def digital(self) -> bool:
        """Whether the outputs are not in V, in a kind whose outputs usually are."""
        return bool(self.type.digital) and self.type.outputs[0] not in self

    @property
    def _output_columns(self) -> tuple[str, ...]:
        """The columns that outputs of this table can have, in the order of the axes."""
        return self.type.digital if self.digital else self.type.outputs

    @property
    def std_names(self) -> tuple[str, ...]:
        """The columns that hold the standard deviation of the samples of each output; a table may lack them."""
        return tuple(std_column(name) for name in self.output_names)

    def output_name(self, axis: str) -> str:
        """The column of the output of one axis."""
        return self._output_columns[AXES.index(axis)]

    def output(self, axis: str) -> Array:
        """The measured output of one axis, shape (n,). Raises MissingColumn."""
        return self.column(self.output_name(axis))

    @cached_property
    def outputs(self) -> Array:
        """The measured outputs in the table's unit, shape (n, axes)."""
        return np.column_stack([self.columns[name] for name in self.output_names])

    @property
    def input_unit(self) -> str:
        """Unit of the sensed quantity: g, the local field as 1, or deg/s."""
        return self.type.input_unit

    @property
    def unit(self) -> str:
        """Unit of the outputs."""
        return ("" if self.digital else self.type.unit) or str(self.constants.get("unit", "count"))

    @property
    def gravity_m_s2(self) -> float:
        """Local gravity, m/s^2."""
        return self.number("gravity_m_s2", STANDARD_GRAVITY)

    @cached_property
    def order(self) -> NDArray[np.intp]:
        """Row numbers in order of time (of the rows themselves where no time is given)."""
        return np.argsort(self.columns["t_s"], kind="stable") if "t_s" in self else np.arange(self.n)

    def in_order(self) -> Table:
        """Rows in order of time; the same object if they already are, so that results cached for it remain valid."""
        return self if np.all(np.diff(self.order) > 0) else self.rows(self.order)

    @cached_property
    def time_s(self) -> Array:
        """Time of each row, s; one second a row where no time is given."""
        return self.columns["t_s"] if "t_s" in self else np.arange(float(self.n))

    @cached_property
    def digest(self) -> str:
        """SHA-256 of names and values; it does not depend on the format of the file."""
        h = hashlib.sha256(self.kind.encode())
        for name in sorted(self.columns):
            h.update(name.encode())
            h.update(np.ascontiguousarray(self.columns[name]).data)
        return h.hexdigest()

    def rows(self, selection: NDArray[np.bool_] | NDArray[np.intp]) -> Table:
        """The table with some of its rows."""
        row_indices: NDArray[np.intp] = np.arange(self.n)[selection]
        labels = {name: tuple(values[i] for i in row_indices) for name, values in self.labels.items()}
        columns = {name: values[row_indices] for name, values in self.columns.items()}
        return replace(self, columns=MappingProxyType(columns), labels=labels, numbers=self.numbered(row_indices))

    def with_outputs(self, outputs: Array) -> Table:
        """The table with other outputs, shape (n, axes)."""
        return replace(self, columns={**self.columns, **dict(zip(self.output_names, outputs.T, strict=True))})

    def numbered(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """The numbers of these rows for a person: of the poses of a run, or of the rows of a file, from 0."""
        return rows if self.numbers is None else self.numbers[rows]


@lru_cache(maxsize=8)
def time_origin(table: Table) -> tuple[float, str]:
    """(zero of a time axis on the clock of the table in s, its name): power-on of a soak, else the run's first row.

    A motion has the time of its first sample, also in a file. The times of another file are taken as they are.
    """
    if table.type.moving:
        return float(table.time_s[0]), " since the first stretch"
    if table.numbers is None:
        return 0.0, ""
    if any(path.startswith(HOLD) for path in table.labels.get("path", ())):
        return 0.0, " since power-on"
    return float(table.time_s[0]), " since the first pose"


def in_time(length_s: float) -> tuple[float, str]:
    """(unit in s, its name) for a time axis of this length."""
    return next((size, unit) for limit, size, unit in LENGTHS if length_s > limit)


def _numbers(name: str, values: Iterable[float], source: str) -> Array:
    """A column of its own, shape (n,). Raises DataError for texts, and for an array of another shape."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise DataError(f'{source}: the column "{name}" is not a column of numbers: {error}') from None
    if array.ndim != 1:
        raise DataError(f'{source}: the column "{name}" has the shape {array.shape}; give one number a row, shape (n,)')
    return array


def _check(table: Table) -> None:
    if table.kind not in FILE_KINDS:
        raise DataError(f'{table.source}: unknown kind of table "{table.kind}"{nearest(table.kind, FILE_KINDS)}')
    lengths = {name: len(values) for name, values in table.columns.items()}
    lengths |= {name: len(values) for name, values in table.labels.items()}
    if len(set(lengths.values())) > 1:
        raise DataError(f"{table.source}: columns of different length: {lengths}")
    if not table.n:
        raise DataError(f"{table.source}: the table has no rows")
    _check_columns(table)
    _check_numbers(table)
    _check_sizes(table)


def _check_sizes(table: Table) -> None:
    """Numbers that are none, or so large that nothing can be computed from them."""
    for name, values in table.columns.items():
        wrong_rows = np.flatnonzero(~(np.abs(values) <= LARGEST))
        if len(wrong_rows):
            fault = "not a finite number" if not np.isfinite(values[wrong_rows[0]]) else "more than anything measured"
            raise DataError(
                f'{table.source}: row {wrong_rows[0] + 1}, column "{name}" is {values[wrong_rows[0]]:g}, {fault}'
                f"{f' (and {len(wrong_rows) - 1} more)' if len(wrong_rows) > 1 else ''}; remove the row or the column"
            )


def _check_numbers(table: Table) -> None:
    """Counts, standard deviations, directions and constants that cannot be."""
    for name, values in table.columns.items():
        if name == "n":
            is_wrong, must = values < 1, "at least 1: it counts averaged samples"
        elif name == "direction":
            is_wrong, must = ~np.isin(values, (-1, 0, 1)), "1 (beta growing), -1 (falling) or 0 (unknown)"
        elif name == "flip":
            is_wrong, must = ~np.isin(values, (0, 1)), "1 (face down, turned by 180 deg about x) or 0 (face up)"
        elif "_std" in name:
            is_wrong, must = values < 0, "0 or more"
        elif name == "supply_v":
            is_wrong, must = values <= 0, "above 0: without supply there is no output"
        else:
            continue
        if is_wrong.any():
            row = int(np.argmax(is_wrong))
            raise DataError(f'{table.source}: row {row + 1}, column "{name}" is {values[row]:g}; it must be {must}')
    for name in ("filter_corner_hz", "sample_rate_hz"):
        if not table.number(name, 1.0) > 0:
            raise DataError(f'{table.source}: the constant "{name}" is {table.constants[name]}; it must be above 0')
    if abs(table.number("latitude_deg", 0.0)) > 90:
        raise DataError(
            f'{table.source}: the constant "latitude_deg" is {table.constants["latitude_deg"]}; it must be from -90 to '
            "90: north is positive"
        )
    if fault := gravity_fault(table.constants.get("gravity_m_s2", STANDARD_GRAVITY)):
        raise DataError(f'{table.source}: the constant "gravity_m_s2" is {fault}')


def std_column(output: str) -> str:
    """`vx_v` -> `vx_std_v`, `ax` -> `ax_std`: the column of the standard deviation of an output's samples."""
    return output.replace("_v", "_std_v") if output.endswith("_v") else f"{output}_std"


def gravity_fault(value: Constant) -> str | None:
    """Why `value` is no local gravity on Earth, m/s^2, with the likely mistake; None where it is one."""
    low, high = GRAVITY_M_S2
    try:
        gravity = float(value)
    except ValueError:
        point = str(value).replace(",", ".")
        hint = f"; write {point}, with a decimal point" if str(value).count(",") == 1 else ""
        return f"{value!r}, not a number{hint or f'; give it in m/s^2, {low} to {high}'}"
    if low <= gravity <= high:
        return None
    scales = {"g": STANDARD_GRAVITY, "cm/s^2": 1e-2, "mm/s^2": 1e-3}
    likely = next((unit for unit, scale in scales.items() if low <= gravity * scale <= high), None)
    hint = f"it looks like {likely}; " if likely else ""
    return f"{gravity:g}, which is not gravity at any place on Earth; {hint}give it in m/s^2, {low} to {high}"


def _check_columns(table: Table) -> None:
    sets = FILE_KINDS[table.kind].columns
    if any(all(name in table.columns for name in names) for names in sets):
        return
    required = min(sets, key=lambda names: sum(name not in table.columns for name in names))
    missing = [name for name in required if name not in table.columns]
    present = [*table.columns, *table.labels]
    unused_columns = [name for name in present if name not in required]
    raise MissingColumn(
        f'{table.source}: a table of {table.kind} needs the column "{missing[0]}"; it has: {", ".join(present)}'
        f"{_nearest_column(missing[0], unused_columns)}"
    )


def _nearest_column(missing: str, other_names: list[str]) -> str:
    hint = nearest(missing, other_names) if other_names else ""
    return hint if hint.startswith("; did you mean") else ""


def guess_kind(names: Iterable[str]) -> str:
    """The kind of table that has these columns. Raises MissingColumn when none has."""
    names = list(names)
    for kind in ("motion", "poses", "turns", "rates", "positions"):
        if any(all(name in names for name in columns) for columns in FILE_KINDS[kind].columns):
            return kind
    required = sorted({name for kind in FILE_KINDS.values() for columns in kind.columns for name in columns})
    for name in names:
        likeness = [difflib.SequenceMatcher(None, other, name).ratio() for other in required]
        if name not in required and name not in OPTIONAL and max(likeness) >= LIKE:
            likely_name = required[likeness.index(max(likeness))]  # of equals the first: ax, not mx
            raise MissingColumn(f'the column name is unknown: "{name}"; did you mean "{likely_name}"?')
    column_sets = [(kind.name, columns) for kind in FILE_KINDS.values() for columns in kind.columns]
    kind, columns = max(column_sets, key=lambda e: sum(name in names for name in e[1]))
    missing = [name for name in columns if name not in names]
    if len(missing) < len(columns):
        expected = f"{kind} need {', '.join(columns)}; there are: {', '.join(names)}"
        raise MissingColumn(f'the column "{missing[0]}" is missing: {expected}')
    raise MissingColumn(
        f"columns {', '.join(names)} do not fit any kind of table; "
        "poses need alpha_deg, beta_deg and vx_v or ax; positions need ax, ay, az"
    )
