"""Samples of a sensor at rest."""

from __future__ import annotations

from calibrations.tables.kind import Kind


class Still(Kind):
    """A still record: its model is one of noise."""

    name = file = rows = "still"
    size_in = "samples"
    columns = (("t_s",), ())
    default_model = "still"
    fitted = False
