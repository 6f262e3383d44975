"""Read and write a table as CSV: `# key: value` lines, a header, numbers; text only in columns of text.

Fast path: numpy parses all rows at once. Only if that fails are rows read one by one, to name the cell at fault.
"""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from calibrations.errors import DataError, nearest
from calibrations.table import KINDS, OPTIONAL, Constant, Table, guess_kind

TEXT = ("path",)
LARGEST_BYTES = 1 << 30


def read_csv(path: Path | str, kind: str | None = None) -> Table:
    """The table in the file `path`; `kind` is guessed from the columns where it is not given.

    Raises DataError naming file, line and column.
    """
    path = Path(path)
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise DataError(f"{path}: larger than {LARGEST_BYTES >> 30} GiB; export means instead of samples")
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise DataError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: is not UTF-8 text (byte {error.start}); is it really a CSV file?") from None
    return parse_csv(text, str(path), kind)


def parse_csv(text: str, source: str, kind: str | None = None) -> Table:
    """The table in `text`. Raises DataError naming source, line and column."""
    try:
        return _table(text, source, kind)
    except csv.Error as error:
        raise DataError(f"{source}: is not a CSV file: {error}") from None


def _table(text: str, source: str, kind: str | None) -> Table:
    lines = text.splitlines()
    constants, first = _constants(lines)
    if first == len(lines):
        raise DataError(f"{source}: the file is empty: a header line with column names is missing")
    header = [name.strip() for name in next(csv.reader([lines[first]]))]
    _check_header(header, f"{source}, line {first + 1}")
    body = lines[first + 1 :]
    try:
        kind = kind or guess_kind(header)
    except DataError as error:
        raise DataError(f"{source}, line {first + 1}: {error}") from None
    if not any(line.strip() for line in body):
        raise DataError(f"{source}: no rows below the header")
    columns, labels = _parse(header, body, source, first + 2)
    return Table.from_columns(kind, columns, constants, source, labels)


def _constants(lines: list[str]) -> tuple[dict[str, Constant], int]:
    """The `# key: value` lines and the number of the header line."""
    constants: dict[str, Constant] = {}
    for number, line in enumerate(lines):
        stripped = line.strip()
        if not stripped:
            continue
        if not stripped.startswith("#"):
            return constants, number
        key, colon, value = stripped.lstrip("#").partition(":")
        if colon and key.strip():
            constants[key.strip()] = _number_or_text(value.strip())
    return constants, len(lines)


def _number_or_text(text: str) -> Constant:
    try:
        return float(text)
    except ValueError:
        return text


def _check_header(header: list[str], where: str) -> None:
    if all(isinstance(_number_or_text(name), float) for name in header):
        raise DataError(f"{where}: a header line with column names is missing")
    if len(header) == 1 and (found := next((s for s in (";", "\t") if s in header[0]), None)):
        what = "semicolons" if found == ";" else "tabs"
        raise DataError(f"{where}: values are separated by {what}, not commas; `rig import` takes them so")
    for name in header:
        if not name:
            raise DataError(f"{where}: a column has no name")
        if header.count(name) > 1:
            raise DataError(f'{where}: the column "{name}" occurs twice')


def _parse(
    header: list[str], body: list[str], source: str, first_line: int
) -> tuple[dict[str, np.ndarray], dict[str, tuple[str, ...]]]:
    if any(name in TEXT for name in header):
        return _parse_cells(header, body, source, first_line)
    try:
        numbers = np.loadtxt(io.StringIO("\n".join(body)), delimiter=",", ndmin=2, comments=None)
    except ValueError:
        return _parse_cells(header, body, source, first_line)
    if numbers.shape[1] != len(header) or not np.isfinite(numbers).all():
        return _parse_cells(header, body, source, first_line)
    return {name: numbers[:, k] for k, name in enumerate(header)}, {}


def _parse_cells(
    header: list[str], body: list[str], source: str, first_line: int
) -> tuple[dict[str, np.ndarray], dict[str, tuple[str, ...]]]:
    rows: list[list[str]] = []
    numbers: list[int] = []
    for number, row in enumerate(csv.reader(body), start=first_line):
        if not any(cell.strip() for cell in row):
            continue
        if len(row) != len(header):
            raise DataError(
                f"{source}, line {number}: {len(row)} values for {len(header)} columns ({', '.join(header)})"
            )
        rows.append([cell.strip() for cell in row])
        numbers.append(number)
    columns: dict[str, np.ndarray] = {}
    labels: dict[str, tuple[str, ...]] = {}
    known = {name for sets in KINDS.values() for wanted in sets for name in wanted} | set(OPTIONAL)
    for k, name in enumerate(header):
        cells = [row[k] for row in rows]
        if name in TEXT or (name not in known and not _is_number(cells[0])):
            labels[name] = tuple(cells)
        else:
            columns[name] = np.array(
                [_cell(c, f'{source}, line {line}, column "{name}"') for c, line in zip(cells, numbers, strict=True)]
            )
    return columns, labels


def _is_number(cell: str) -> bool:
    return isinstance(_number_or_text(cell), float)


def _cell(cell: str, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        what = "empty" if not cell else f'"{cell}"'
        raise DataError(f"{where}: {what} where a number belongs; correct the cell or remove the row") from None
    if not np.isfinite(value):
        raise DataError(f'{where}: "{cell}" is not a finite number; correct the cell or remove the row')
    return value


def write_csv(table: Table, path: Path | str) -> None:
    """Write `table` so that `read_csv` gives it back, to the last bit."""
    names = [*table.columns, *table.labels]
    with Path(path).open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"# {key}: {value}\n" for key, value in table.constants.items())
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(names)
        cells = [[repr(float(v)) for v in values] for values in table.columns.values()]
        writer.writerows(zip(*cells, *table.labels.values(), strict=True))


def require_kind(table: Table, *kinds: str) -> Table:
    """The table itself. Raises DataError if it is of another kind."""
    if table.kind not in kinds:
        raise DataError(
            f"{table.source}: a table of {table.kind}; this needs {' or '.join(kinds)}{nearest(table.kind, kinds)}"
        )
    return table
