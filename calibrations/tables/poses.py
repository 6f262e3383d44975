"""The mean of one dwell at known stage angles."""

from __future__ import annotations

from calibrations.tables.kind import Kind


class Poses(Kind):
    """Poses of a rig with stages: gravity along each axis is known."""

    name = file = rows = size_in = "poses"
    columns = (("alpha_deg", "beta_deg", "vx_v"),)
    outputs = ("vx_v", "vy_v", "vz_v")
    unit = "V"
    taken = "the means of {} poses"
    means = budget = known_input = stage_angles = True
    same_pose = ("alpha_deg", "beta_deg", "mount_deg", "flip")
    drawn_over = ("beta", "β (deg)", "beta_deg")
    measurement_caption = (
        "Dots are measured, lines are the model {}. "
        "Filled markers are clockwise approaches, open ones anticlockwise approaches."
    )
    failure_caption = "The residual of the model {} at both stage angles; pale is near the noise."
