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
