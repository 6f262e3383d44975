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
    widest_form = "outputs linear in rates and specific forces"
    sensed_in = "deg/s"
    sensed_along = "rate about {} (deg/s)"
    nearest_to = "the axis of turn"
    drawn_over = ("rate", "rate (deg/s)", "rate_deg_s")
    measurement_caption = "Dots are measured, crosses are the model {}."
    failure_caption = "The residual of the model {} over the rate of the turn."
