"""Acceleration from the sensor's output: the output filter undone, and a model solved backwards.

Noise grows with frequency when a low-pass is undone; the band that follows keeps it finite.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calibrations.chain import force, respond, sensed
from calibrations.errors import ModelError
from calibrations.model import Model
from calibrations.motion.output import corner_hz, skew_s
from calibrations.motion.records import Record
from calibrations.motion.spectrum import Response, delayed, first_order, through
from calibrations.parameters import Layout
from calibrations.table import Array, Table


def acceleration(table: Table, model: Model) -> Array:
    """Acceleration along x, m/s^2, shape (n,), that instantaneous outputs mean under a model: gravity taken off.

    Axes that were not measured feel what the attitude gives them. Raises ModelError for a model without values.
    """
    still = replace(table, kind="poses")  # each sample by itself
    model = model.for_table(still)
    layout = Layout.of(model, still)
    theta = layout.known()
    if theta is None:
        raise ModelError(f"the model {model.name} has no values yet; fit it to a sweep of the same sensor first")
    steps = layout.steps(theta)
    poses = [step for step in steps if step[0].pose is not None]
    gravity = force(still, poses)
    a, axes = gravity.copy(), len(table.axes)
    for _ in range(20):
        error = table.outputs - respond(sensed(a, still, steps), still, steps)[:, :axes]
        slope = _slope(lambda b: respond(sensed(b, still, steps), still, steps)[:, :axes], a, axes)
        change = np.linalg.solve(slope, error[:, :, None])[:, :, 0]
        a[:, :axes] += change
        if not np.max(np.abs(change)) > 1e-12:
            break
    return np.asarray((a - gravity)[:, 0] * table.gravity_m_s2)


def _slope(output: Callable[[Array], Array], a: Array, axes: int, h: float = 1e-4) -> Array:
    """d output / d a over the measured axes, shape (n, axes, axes)."""
    return np.stack([(output(a + h * e) - output(a - h * e)) / (2 * h) for e in np.eye(3)[:axes]], axis=2)


def measured(part: Table, record: Record, model: Model, band: Response) -> Array:
    """Acceleration in mm/s^2 by the sensor under a model, in the band."""
    columns = dict(part.columns)
    for k, axis in enumerate(part.axes):
        response = undone(part, model, k, band)
        columns[f"v{axis}_v"] = through(part.outputs[:, k], record.rate_hz, response)
    return 1e3 * acceleration(Table(part.kind, columns, part.constants, part.source), model)


def undone(table: Table, model: Model, axis: int, band: Response) -> Response:
    """From samples to the transducer's output in the band: the output filter and the skew undone.

    A corner and a delay that the model holds take the place of the nominal ones.
    """
    values = {
        term.name: {e.axis: e.value for e in term.estimates} for term in model.terms if term.effect.kinds == ("motion",)
    }
    name = table.axes[axis]
    corner = corner_hz(table) + values.get("output-filter", {}).get(name, 0.0)
    late = values.get("sampling-delay", {}).get(name, 0.0) - skew_s(table, axis)
    low_pass, undelayed = first_order(corner), delayed(-late)
    return lambda f: np.asarray(band(f) * undelayed(f) / low_pass(f))
