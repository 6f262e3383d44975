import numpy as np
from scipy.ndimage import uniform_filter1d

from calibrations.effects import Effect, Parameter, Values
from calibrations.motion.spectrum import find_records
from calibrations.table import Array, Table

SECOND = 1.0


class VibrationRectification(Effect):
    """vibration-rectification: motion shifts the zero-g output in proportion to its mean square.

        V += k_i m      m: mean square of the motion's acceleration over a second, g^2; k in {out}/g^2, one per axis

    Symptom   the mean of the output changes when the motion starts, stops or changes its amplitude.
    Excited by  motion with different amplitudes, or with rests.
    Confused with  bias, if the amplitude is constant. To separate them, include a rest.
    Source    IEEE Std 1293, vibration rectification error.
    """

    kinds = ("motion",)
    left_out = "it follows the mean square of a motion over a second"

    coefficient = Parameter("{out}/g^2", typical=1.0, doc="shift per mean square of the acceleration")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        return np.outer(mean_square_g2(table), p.coefficient)


def mean_square_g2(table: Table) -> Array:
    """Mean square of the motion about each sample, g^2, shape (n,); records apart."""
    squares = (table.column("acceleration_m_s2") / table.gravity_m_s2) ** 2
    for record in find_records(table):
        width = max(1, round(SECOND * record.rate_hz))
        squares[record.rows] = uniform_filter1d(squares[record.rows], width, mode="nearest")
    return np.asarray(squares)
