"""Files of arrays as topics: HDF5, MATLAB, NumPy, Parquet, Excel.

Arrays with the same number of rows in one group (an HDF5 group, a MATLAB struct, a .npz) are the columns of one topic.
An array of three columns is three axes, `acc` -> `acc_x`, `acc_y`, `acc_z`; of other widths, columns by number from 1.
Single numbers and texts are constants.
"""

from __future__ import annotations

import csv
import io
import zlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Literal
from zipfile import ZipFile

import numpy as np

from calibrations.errors import DataError
from calibrations.files import LARGEST_BYTES
from calibrations.importing.cells import number_or_text
from calibrations.importing.topics import Cells, Topic, library, require_size
from calibrations.importing.units import parse_unit
from calibrations.table import AXES, Array, Constant

MOST_COLUMNS = 64  # of one array; a longer second dimension is an image or a spectrum
DEEPEST = 8  # groups in groups
MOST_CELLS = 10_000_000  # of a worksheet: a full one has 17e9


@dataclass
class Group:
    """The arrays of one group, each with its shape, unit and reader; and its constants."""

    name: str
    arrays: dict[str, tuple[tuple[int, ...], str, Callable[[], Any]]] = field(default_factory=dict)
    constants: dict[str, Constant] = field(default_factory=dict)

    def topics(self) -> list[Topic]:
        """The topics of the group, one for each number of rows."""
        by_rows: defaultdict[int, list[str]] = defaultdict(list)
        for name, (shape, _, _) in self.arrays.items():
            if (rows := _rows(shape)) > 1:
                by_rows[rows].append(name)
        single = len(by_rows) == 1
        prefix = f"{self.name}/" if self.name else ""
        return [
            self._topic((self.name or names[0]) if single else prefix + names[0], rows, names)
            for rows, names in by_rows.items()
        ]

    def _topic(self, name: str, rows: int, names: list[str]) -> Topic:
        is_only_array = len(names) == 1 and len(self.arrays) == 1
        header = [
            column
            for array in names
            for column in _columns(array, self.arrays[array][0], self.arrays[array][1], is_only_array)
        ]

        def cells() -> Cells:
            columns: dict[str, Array] = {}
            for array in names:
                shape, unit, read = self.arrays[array]
                values = _upright(np.asarray(read(), dtype=np.float64), rows)
                columns |= dict(zip(_columns(array, shape, unit, is_only_array), values.T.copy(), strict=True))
            return columns

        return Topic(name, tuple(header), rows, cells, constants=self.constants)


def _rows(shape: tuple[int, ...]) -> int:
    """Number of rows of an array, 0 for one that is no table: (n,), (n, few), or (few, n) as MATLAB often has it."""
    if len(shape) == 1:
        return shape[0]
    if len(shape) == 2 and min(shape) <= MOST_COLUMNS and min(shape) > 0:
        return shape[1] if _lies(shape) else shape[0]
    return 0


def _lies(shape: tuple[int, ...]) -> bool:
    """Whether the samples run along the second dimension."""
    return shape[0] < shape[1] and (shape[0] in (1, 3) or shape[1] > MOST_COLUMNS)


def _upright(values: Array, rows: int) -> Array:
    """The array with shape (rows, columns)."""
    if values.ndim == 1:
        return values.reshape(rows, -1)
    return values.T if _lies(values.shape) else values


def _columns(name: str, shape: tuple[int, ...], unit: str, is_only_array: bool) -> list[str]:
    """The names of an array's columns. A lone array of several columns is a table without a header."""
    width = int(np.prod(shape)) // _rows(shape)
    bracket = f" ({unit})" if unit else ""
    if width == 1:
        return [name + bracket]
    if is_only_array and width != len(AXES):
        return [str(k + 1) for k in range(width)]
    ends = AXES if width == len(AXES) else [str(k + 1) for k in range(width)]
    return [f"{name}_{end}{bracket}" for end in ends]


def _constant(value: Any) -> Constant | None:
    """A single number or text as a constant, None for another value."""
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    if isinstance(value, str):
        return value
    try:
        values = np.asarray(value)
        return float(values.reshape(-1)[0]) if values.size == 1 and values.dtype.kind in "iufb" else None
    except (TypeError, ValueError):
        return None


def _add(group: Group, name: str, value: Any) -> None:
    """Add an array in memory to a group: numbers, a structured array, or a constant."""
    values = np.asarray(value)
    if values.dtype.names:
        for field_name in values.dtype.names:
            _add(group, field_name, values[field_name])
    elif values.dtype.kind in "iufb" and values.size > 1:
        group.arrays[name] = (values.shape, "", lambda: values)
    elif values.dtype.kind in "mM" and values.ndim == 1 and len(values) > 1:
        seconds = (values - (values[0] if values.dtype.kind == "M" else values.dtype.type(0))) / np.timedelta64(1, "s")
        group.arrays[name] = (values.shape, "s", lambda: seconds)
    elif (constant := _constant(value.item() if values.size == 1 and values.dtype.kind in "US" else value)) is not None:
        group.constants[name] = constant


def npy_topics(path: Path) -> list[Topic]:
    """The array of a NumPy file. Raises DataError."""
    with path.open("rb") as file:
        values = _load(path, lambda: np.load(file, allow_pickle=False))
    group = Group("")
    _add(group, "values", values)
    return group.topics()


def npz_topics(path: Path) -> list[Topic]:
    """The arrays of a NumPy archive. Raises DataError."""
    require_size(path, _zip_bytes(path))
    group = Group("")
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            _add(group, name, _load(path, partial(archive.__getitem__, name)))
    return group.topics()


def _load(path: Path, load: Callable[[], Any]) -> Any:
    try:
        return load()
    except ValueError as error:
        if "allow_pickle" not in str(error):
            raise
        raise DataError(
            f"{path}: holds Python objects, which are not read because they may run code; "
            "save plain arrays with numpy.save(..., allow_pickle=False)"
        ) from None


def _zip_bytes(path: Path) -> int:
    with ZipFile(path) as archive:
        return sum(info.file_size for info in archive.infolist())


def hdf5_topics(path: Path) -> list[Topic]:
    """The groups of an HDF5 file or a MATLAB file of version 7.3 (HDF5 with transposed arrays). Raises DataError."""
    h5py = library("h5py", "formats", path, "an HDF5 file (or MATLAB 7.3)")
    with h5py.File(path, "r") as file:
        groups = list(_hdf5_groups(h5py, path, file, "", 0))
    return [topic for group in groups for topic in group.topics()]


def _hdf5_groups(h5py: Any, path: Path, node: Any, name: str, depth: int) -> Iterator[Group]:
    group = Group(name)
    for key, value in node.attrs.items():
        if not key.startswith(("MATLAB", "CLASS", "TITLE", "VERSION", "PYTABLES", "pandas")):
            constant = _constant(value)
            group.constants |= {} if constant is None else {key: constant}
    for key in node:
        child = node.get(key)
        if isinstance(child, h5py.Dataset):
            _add_dataset(path, group, key, child)
    yield group
    for key in node:
        is_link = isinstance(node.get(key, getlink=True), (h5py.SoftLink, h5py.ExternalLink))
        if not is_link and not key.startswith("#") and isinstance(node.get(key), h5py.Group):
            if depth >= DEEPEST:
                raise DataError(f"{path}: has groups more than {DEEPEST} deep; export the measurements as one table")
            yield from _hdf5_groups(h5py, path, node[key], f"{name}/{key}" if name else key, depth + 1)


def _add_dataset(path: Path, group: Group, key: str, data: Any) -> None:
    if data.shape is None or data.attrs.get("MATLAB_class") in (b"char", b"cell", b"function_handle"):
        return
    matlab, dataset_path = "MATLAB_class" in data.attrs, data.name
    if data.dtype.names:
        for name in data.dtype.names:
            kind, inner = data.dtype[name].base.kind, data.dtype[name].shape
            if kind in "iufb":
                require_size(path, data.size * 8)
                group.arrays[name] = ((*data.shape, *inner), "", _later(path, dataset_path, False, name))
    elif data.dtype.kind in "iufb" and data.size > 1:
        require_size(path, data.size * 8)
        unit = next((parse_unit(str(_constant(data.attrs[k]))) for k in ("units", "unit") if k in data.attrs), "")
        shape = tuple(reversed(data.shape)) if matlab else data.shape
        group.arrays[key] = (shape, unit, _later(path, dataset_path, matlab))
    elif data.size == 1:
        constant = _constant(data[()])
        group.constants |= {} if constant is None else {key: constant}


def _later(path: Path, dataset_path: str, transposed: bool, column: str | None = None) -> Callable[[], Any]:
    def read() -> Any:
        import h5py

        with h5py.File(path, "r") as file:
            values = file[dataset_path][()]
        values = values if column is None else values[column]
        return values.T if transposed else values

    return read


def matlab_topics(path: Path) -> list[Topic]:
    """The variables and structs of a MATLAB file of version 5 to 7.2. Raises DataError."""
    from scipy.io import loadmat

    from calibrations.importing.matlab_elements import require_sound

    require_size(path, _matlab_bytes(path))
    require_sound(path)
    variables = loadmat(path, squeeze_me=False, struct_as_record=True)
    public_variables = {name: value for name, value in variables.items() if not name.startswith("__")}
    return [topic for group in _matlab_groups(public_variables, "", 0) for topic in group.topics()]


def _matlab_groups(variables: Mapping[str, Any], name: str, depth: int) -> Iterator[Group]:
    group, inner = Group(name), {}
    for key, value in variables.items():
        values = np.asarray(value)
        if values.dtype.names and values.size == 1 and depth < DEEPEST:
            record = values.reshape(-1)[0]
            inner[key] = {field_name: record[field_name] for field_name in values.dtype.names}
        elif values.dtype.kind in "iufbUS":
            _add(group, key, values)
    yield group
    for key, record in inner.items():
        yield from _matlab_groups(record, f"{name}.{key}" if name else key, depth + 1)


def _matlab_bytes(path: Path) -> int:
    """The unpacked size of the variables: compressed ones are unpacked piece by piece, up to the limit, and dropped."""
    total = 0
    with path.open("rb") as file:
        order: Literal["little", "big"] = "little" if file.read(128)[126:] == b"IM" else "big"
        while len(tag := file.read(8)) == 8:
            kind = int.from_bytes(tag[:4], order)
            size = int.from_bytes(tag[4:], order)
            if kind != 15:
                total += size
                file.seek(size, 1)
                continue
            unpack, remaining = zlib.decompressobj(), size
            while remaining > 0 and total <= LARGEST_BYTES and (chunk := file.read(min(remaining, 1 << 16))):
                remaining -= len(chunk)
                while chunk and total <= LARGEST_BYTES:
                    total += len(unpack.decompress(chunk, 1 << 20))
                    chunk = unpack.unconsumed_tail
            file.seek(remaining, 1)
    return total


def parquet_topics(path: Path) -> list[Topic]:
    """The table of a Parquet file. Raises DataError."""
    parquet = library("pyarrow.parquet", "formats", path, "a Parquet file")
    with parquet.ParquetFile(path) as file:
        rows, schema = file.metadata.num_rows, file.schema_arrow
        require_size(path, sum(file.metadata.row_group(k).total_byte_size for k in range(file.metadata.num_row_groups)))
    require_size(path, 8 * rows * len(schema.names))
    constants = {
        key.decode("utf-8", "replace"): number_or_text(value.decode("utf-8", "replace"))
        for key, value in (schema.metadata or {}).items()
        if key not in (b"pandas", b"ARROW:schema")
    }
    return [Topic("table", tuple(schema.names), rows, lambda: _parquet_cells(parquet, path), constants=constants)]


def _parquet_cells(parquet: Any, path: Path) -> Cells:
    import pyarrow as pa

    cells: dict[str, Array | tuple[str, ...]] = {}
    table = parquet.read_table(path)
    for name, column in zip(table.column_names, table.columns, strict=True):
        kind = column.type
        if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
            steps = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
            values = column.cast(pa.int64()).to_numpy()
            cells[f"{name} (s)"] = (values - (values[0] if pa.types.is_timestamp(kind) else 0)) * steps
        elif pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_boolean(kind):
            cells[name] = np.asarray(column.to_numpy(), dtype=np.float64)
        elif pa.types.is_decimal(kind):
            cells[name] = np.asarray(column.cast(pa.float64()).to_numpy(), dtype=np.float64)
        elif pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_dictionary(kind):
            cells[name] = tuple("" if v is None else str(v) for v in column.to_pylist())
        elif pa.types.is_fixed_size_list(kind) or pa.types.is_list(kind):
            values = np.array(column.to_pylist(), dtype=np.float64)
            if values.ndim == 2 and values.shape[1] <= MOST_COLUMNS:
                cells |= dict(zip(_columns(name, values.shape, "", False), values.T.copy(), strict=True))
    return cells


def excel_topics(path: Path) -> list[Topic]:
    """The worksheets of an Excel workbook, each read as a text of cells: titles, units and constants as in a CSV file.

    Raises DataError.
    """
    openpyxl = library("openpyxl", "formats", path, "an Excel workbook")
    require_size(path, _zip_bytes(path))
    book = openpyxl.load_workbook(io.BytesIO(path.read_bytes()), read_only=True, data_only=True)
    try:
        sizes = {sheet.title: (sheet.max_row or 0, sheet.max_column or 0) for sheet in book.worksheets}
        heads = {sheet.title: _first_row(sheet) for sheet in book.worksheets}
    finally:
        book.close()
    filled = {name: head for name, head in heads.items() if head}
    return [
        Topic(name, head, sizes[name][0], text=partial(_worksheet, openpyxl, path, name))
        for name, head in filled.items()
    ]


def _first_row(sheet: Any) -> tuple[str, ...]:
    """The first of the widest rows: the header, or numbers without a header."""
    widest: list[str] = []
    for row in sheet.iter_rows(max_row=20, values_only=True):
        cells = [str(v) for v in row if v is not None]
        widest = cells if len(cells) > len(widest) else widest
    return tuple(widest)


def _first_column(sheet: Any) -> int:
    """The first column, from 1, with a cell in the rows of the header and below it."""
    rows = [row for row in sheet.iter_rows(max_row=20, values_only=True) if sum(v is not None for v in row) > 1]
    return 1 + min((next(k for k, v in enumerate(row) if v is not None) for row in rows), default=0)


def _worksheet(openpyxl: Any, path: Path, name: str) -> str:
    text, cells = io.StringIO(), 0
    book = openpyxl.load_workbook(io.BytesIO(path.read_bytes()), read_only=True, data_only=True)
    try:
        writer = csv.writer(text, lineterminator="\n")
        first = _first_column(book[name])
        for row in book[name].iter_rows(min_col=first, values_only=True):
            cells += len(row)
            if cells > MOST_CELLS:
                raise DataError(f"{path}: sheet {name} has more than {MOST_CELLS} cells; save it as CSV")
            writer.writerow(["" if v is None else repr(v) if isinstance(v, float) else str(v) for v in row])
    finally:
        book.close()
    return text.getvalue()
