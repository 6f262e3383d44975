"""The mean of one still position of a magnetometer."""

from __future__ import annotations

from calibrations.tables.positions import Positions


class Fields(Positions):
    """Positions of a magnetometer: only the magnitude of the field is known, and that as 1."""

    name = "fields"
    outputs = ("mx", "my", "mz")
    input_unit = "field"
    default_model = "field"
    sequential = False
