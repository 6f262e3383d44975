"""The mean of one still position of a magnetometer."""

from __future__ import annotations

from calibrations.tables.positions import Positions


class Fields(Positions):
    """Positions of a magnetometer: only the magnitude of the field is known, and that as 1."""

    name = "fields"
    outputs = ("mx", "my", "mz")
    input_unit = "field"
    perfect_sensor = "a magnetometer without error"
    nominal = " in a field of 1"
    taken = "{} samples, one for each direction of the field"
    default_model = "field"
    field = True
    sequential = False
    widest_form = "an ellipsoid"
    symbol = "m"
    sensed_in = "share of the field"
    sensed_along = "share of the field along {}"
    nearest_to = "the field"
    measurement_caption = "The magnitude of the field by the model {} at each position: 1 if the model is right."
    failure_caption = "The residual of the model {} over the direction of the field; pale is near the noise."
