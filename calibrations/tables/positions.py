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
    measurement_caption = "The magnitude of gravity by the model {} at each position: 1 g if the model is right."
    failure_caption = "The residual of the model {} over the direction of gravity; pale is near the noise."
