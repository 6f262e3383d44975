"""The display of each kind of data: figures, tables of text, charts and albums.

`view_of(data)` gives the view of a dataset. Terminal, report, page and notebook take their tables and pictures from it.
"""

from __future__ import annotations

from typing import Any

from calibrations.discovery.dataset import Dataset
from calibrations.presentation.views.rows import RowsView
from calibrations.presentation.views.view import View


def view_of(data: Dataset[Any]) -> View[Any]:
    """The view of these data."""
    if data.form == "rows":
        return RowsView(data)
    from calibrations.presentation.views.still import StillView  # rows need no noise engine

    return StillView(data)
