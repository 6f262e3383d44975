"""The mean at one constant turning rate."""

from __future__ import annotations

from calibrations.tables.kind import Kind


class Rates(Kind):
    """A gyroscope on a rate table: the angular rate about each axis is known."""

    name = file = rows = size_in = "rates"
    columns = (("rate_deg_s", "gx", "gy", "gz"),)
    outputs = ("gx", "gy", "gz")
    input_unit = "deg/s"
    default_model = "gyroscope"
    known_input = True
    sequential = False
