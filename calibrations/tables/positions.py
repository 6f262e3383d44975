"""The mean of one still position of unknown orientation."""

from __future__ import annotations

from calibrations.tables.kind import Kind


class Positions(Kind):
    """Positions of an accelerometer: only the magnitude of gravity is known."""

    name = file = rows = size_in = "positions"
    columns = (("ax", "ay", "az"), ("mx", "my", "mz"))
    outputs = ("ax", "ay", "az")
    default_model = "common-scale"
    means = budget = magnitude = True
