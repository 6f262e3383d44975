"""Rows for notebooks: as a pandas.DataFrame, and as a table in HTML."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from calibrations.errors import CalibrationError


def data_frame(data: Any, **layout: Any) -> Any:
    """`pandas.DataFrame(data, **layout)`. Raises CalibrationError where pandas is not installed."""
    try:
        import pandas
    except ImportError:
        raise CalibrationError(
            "a data frame needs pandas, which is not installed; run: pip install 'inertial-rig[notebook]'"
        ) from None
    return pandas.DataFrame(data, **layout)


def columns_by_name(data: Any) -> Mapping[str, Any] | None:
    """The columns of a mapping or a pandas.DataFrame by name; None for anything else."""
    if isinstance(data, Mapping):
        return data
    return dict(data.items()) if hasattr(data, "iloc") and hasattr(data, "columns") else None


def html_table(head: Sequence[str], rows: Iterable[Sequence[object]], caption: str = "") -> str:
    """A table in HTML; every cell is text."""
    caption_html = f"<caption>{escape(caption)}</caption>" if caption else ""
    body = "".join(f"<tr>{_cells('td', row)}</tr>" for row in rows)
    return f"<table>{caption_html}<thead><tr>{_cells('th', head)}</tr></thead><tbody>{body}</tbody></table>"


def _cells(tag: str, row: Sequence[object]) -> str:
    return "".join(f"<{tag}>{escape(str(cell))}</{tag}>" for cell in row)
