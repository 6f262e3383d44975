"""Samples of a sensor in motion along a line, with a displacement sensor beside it."""

from __future__ import annotations

from calibrations.tables.kind import Kind


class Motion(Kind):
    """A record of motion. A model is fitted to what each stretch of it holds of the motion."""

    name = file = "motion"
    columns = (("t_s", "vx_v", "displacement_m"),)
    outputs = ("vx_v", "vy_v")
    unit = "V"
    rows = "stretches"
    size_in = "samples"
    note = (
        "The model is fitted to this motion, and its error is that of the fit. The report of the run also compares the "
        "models of the run's sweep with the displacement sensor. Those are not fitted to the motion, so their "
        "error also contains changes since the sweep and the error of the reference."
    )
    moving = True
    measurement_caption = "Output over a few periods without its mean: measured (dots) and model (lines) {}."
    failure_caption = (
        "Mean residual of the model {} over one period of the motion's strongest line, with the noise of the mean."
    )
