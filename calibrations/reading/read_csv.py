"""Read and write a table as CSV: `# key: value` lines, a header, numbers; text only in columns of text.

Reading takes whatever `foreign.py` takes without a mapping; writing gives commas and decimal points.
"""

from __future__ import annotations

import csv
from pathlib import Path

from calibrations.errors import DataError, nearest
from calibrations.reading.foreign import read_foreign, take
from calibrations.reading.separated import sheet
from calibrations.reading.text_file import text
from calibrations.table import Table


def read_csv(path: Path | str, kind: str | None = None) -> Table:
    """The table in the file `path`; `kind` is guessed from the columns where it is not given.

    Raises DataError naming file, line and column.
    """
    return read_foreign(Path(path), kind)


def parse_csv(content: str, source: str, kind: str | None = None) -> Table:
    """The table in a text. Raises DataError naming source, line and column."""
    return take(sheet(text(content, source)), kind).table


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
