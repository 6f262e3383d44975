"""The mean at one constant turning rate."""

from __future__ import annotations

from calibrations.tables.kind import Kind


class Rates(Kind):
    """A gyroscope on a rate table: the angular rate about each axis is known."""

    name = file = rows = size_in = "rates"
    columns = (("rate_deg_s", "gx", "gy", "gz"),)
    outputs = ("gx", "gy", "gz")
    input_unit = "deg/s"
    perfect_sensor = "a gyroscope without error"
    nominal = " of 1 V/(deg/s)"
    taken = "the means of {} rests and turns"
    default_model = "gyroscope"
    means = known_input = turning = True
    sequential = False
