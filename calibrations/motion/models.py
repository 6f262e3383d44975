"""The two models that the paper judges by motion, fitted to a sweep of the same sensor.

linear     the manufacturer's, Ang (1)-(3): bias and scale factor of each axis from +1 g and -1 g
physical   the shipped physical model, fitted jointly; with hysteresis where the sweep goes both ways, as the loop would
           otherwise be taken for squares and products. A motion is met between its branches, where it adds nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibrations.effect import catalogue
from calibrations.errors import DataError
from calibrations.fit import fit
from calibrations.model import Estimate, Model
from calibrations.model_file import read_model
from calibrations.table import Array, Table

UPRIGHT_DEG = {"x": (0.0, 180.0), "y": (90.0, 270.0)}  # beta at +1 g and at -1 g, with alpha at 90 deg


def linear(sweep: Table) -> Model:
    """Ang (1)-(3). Raises DataError where an axis was not held at both +1 g and -1 g."""
    ends = {axis: [_mean(sweep, axis, beta_deg) for beta_deg in UPRIGHT_DEG[axis]] for axis in sweep.axes}
    values = {
        "bias": [Estimate("bias", axis, (up + down) / 2, None, "V") for axis, (up, down) in ends.items()],
        "scale-factor": [Estimate("scale", axis, (up - down) / 2, None, "V/g") for axis, (up, down) in ends.items()],
    }
    model = read_model("linear")
    terms = tuple(replace(term, estimates=tuple(values[term.name])) for term in model.terms)
    return replace(model, terms=terms, unit=sweep.unit)


def physical(sweep: Table) -> Model:
    """The physical model of this sweep. Raises TooFewRows, DataError."""
    both = "direction" in sweep and np.ptp(sweep.column("direction")) > 0
    model = read_model("physical")
    return fit(replace(model.with_effect(catalogue()["hysteresis"]), name=model.name) if both else model, sweep).model


def _mean(sweep: Table, axis: str, beta_deg: float) -> float:
    """Mean output of an axis at alpha = 90 deg and this beta, V."""
    at: Array = (sweep.column("alpha_deg") == 90) & (np.mod(sweep.column("beta_deg"), 360) == beta_deg)
    if not at.any():
        raise DataError(f"{sweep.source}: no pose at alpha = 90, beta = {beta_deg:g} deg, which axis {axis} needs")
    return float(sweep.column(f"v{axis}_v")[at].mean())
