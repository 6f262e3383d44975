"""The slow noise of a sensor, as a noise model knows it from a still record, on the rows of a table.

A sum of Gauss-Markov processes: flicker noise has some to each decade of time constants, a random walk is one far
slower than the record. What is faster than a row, and white and quantisation noise, are in the scatter of its samples;
a sinusoid averages out in a dwell.

Source  Machlup, J. Appl. Phys. 25 (1954); McWhorter: 1/f noise as a sum of relaxations evenly spaced in log time.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calibrations.errors import DataError, ModelError
from calibrations.model import Model
from calibrations.noise import BEYOND, Processes
from calibrations.table import Table

PER_DECADE = 2.0  # processes of flicker
KINDS = ("poses", "rates")  # whose residual is in the output's unit


def with_noise(table: Table, model: Model) -> Table:
    """The table, its slow noise known. Raises DataError, ModelError where the model does not know its channels.

    The noise of its outputs is then no longer guessed from what a model leaves.
    """
    if table.kind not in KINDS:
        raise DataError(f"{table.source}: a noise model is for {' and '.join(KINDS)}, and this is of {table.content}")
    if "t_s" not in table:
        raise DataError(f"{table.source}: slow noise needs the column t_s: when each row was measured")
    if model.unit != table.unit:
        raise ModelError(
            f"{model.name}: its values are {f'in {model.unit}' if model.unit else 'not fitted'}, and {table.source} is "
            f"in {table.unit}; fit it to a still record of the same output: rig fit RUN --model still --out FILE"
        )
    return replace(table, noise={axis: processes(model, axis, table) for axis in table.axes})


def processes(model: Model, axis: str, table: Table) -> Processes:
    """Those of one axis on the times of a table."""
    values = {(term.name, e.name): e.value for term in model.terms for e in term.estimates if e.axis == axis}
    if not values:
        raise ModelError(f"{model.name}: has no values for the axis {axis} of {table.source}")
    gaps_s = np.diff(np.sort(table.time_s))
    gap_s, span_s = float(np.median(gaps_s)), float(np.sum(gaps_s))
    walk = values.get(("rate-random-walk", "coefficient"), 0.0)
    slowest_s = BEYOND * span_s
    found = [*_flicker(values.get(("flicker-noise", "coefficient"), 0.0), gap_s / 2, slowest_s)]
    found += [(walk * np.sqrt(slowest_s / 2), slowest_s)]
    found += [
        (values.get(("gauss-markov-noise", "sigma"), 0.0), values.get(("gauss-markov-noise", "time_constant"), 1.0))
    ]
    return tuple((float(std), float(tau_s)) for std, tau_s in found if std > 0)


def _flicker(coefficient: float, fastest_s: float, slowest_s: float) -> Processes:
    """B^2 / (2 pi f) as relaxations of equal variance B^2 D / pi, D the logarithmic step of their time constants."""
    count = int(PER_DECADE * np.log10(slowest_s / fastest_s)) + 1
    taus_s = np.geomspace(fastest_s, slowest_s, count)
    std = coefficient * np.sqrt(np.log(taus_s[1] / taus_s[0]) / np.pi)
    return tuple((std, tau_s) for tau_s in taus_s.tolist())
