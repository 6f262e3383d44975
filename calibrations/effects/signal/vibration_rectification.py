from __future__ import annotations

import numpy as np
import scipy  # its modules load slowly: they are imported at their first use, and a list of effects needs none

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.effects.logged import LEVEL_DOC, follows_level, level
from calibrations.table import Array, Table

SECOND = 1.0


def _output_per_g(table: Table) -> float:
    return table.number("output_per_g", float(np.median(np.ptp(table.outputs, axis=0))) / 2 or 1.0)


class VibrationRectification(Effect):
    """vibration-rectification: vibration shifts the zero-g output in proportion to its mean square.

        V += k_i m      m: mean square of the acceleration, g^2; k in {out}/g^2, one per axis. In a motion over a second
                        of the reference; in poses of the samples of a mean, from their standard deviation

    Symptom   the mean of the output changes when the motion starts, stops or changes its amplitude; in poses it follows
              the square of the standard deviation of the samples.
    Excited by  motion with different amplitudes, or with rests; poses with different vibration.
    Confused with  bias, if the amplitude is constant. To separate them, include a rest.
    Source    IEEE Std 1293, vibration rectification error.
    """

    kinds = ("motion", "poses")
    left_out = "it follows the mean square of a motion over a second"
    incidental = True

    coefficient = Parameter("{out}/g^2", typical=1.0, doc="shift per mean square of the acceleration")
    output_per_g = Constant(_output_per_g, doc="scale factor by which deviations become accelerations")
    level = Constant(lambda table: follows_level(table, table.std_names, 2), doc=LEVEL_DOC)

    def lacks(self, table: Table) -> str | None:
        if table.kind != "poses":
            return None
        columns = table.std_names
        if any(name not in table for name in columns):
            return f"needs the columns {', '.join(columns)}"
        constant = all(np.ptp(table.column(name)) == 0 for name in columns)
        return "needs standard deviations that differ" if constant else None

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        if table.kind == "poses":
            return np.asarray(_mean_squares_g2(table, float(p.output_per_g), bool(p.level)) * p.coefficient)
        return np.outer(mean_square_g2(table), p.coefficient)


def _mean_squares_g2(table: Table, output_per_g: float, smooth: bool) -> Array:
    """Mean square of the samples of each axis about their mean, less the least of all rows, g^2, shape (n, 3)."""
    mean_squares = np.zeros((table.n, 3))
    for k, name in enumerate(table.std_names):
        squares = (level(table, name, 2) if smooth else table.column(name) ** 2) / output_per_g**2
        mean_squares[:, k] = squares - squares.min()
    return mean_squares


def mean_square_g2(table: Table) -> Array:
    """Mean square of the motion about each sample, g^2, shape (n,); records apart."""
    from calibrations.motion.spectrum import find_records  # only motion has records

    squares = (table.column("acceleration_m_s2") / table.gravity_m_s2) ** 2
    for record in find_records(table):
        width = max(1, round(SECOND * record.rate_hz))
        squares[record.rows] = scipy.ndimage.uniform_filter1d(squares[record.rows], width, mode="nearest")
    return np.asarray(squares)
