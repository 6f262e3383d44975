"""vibration-rectification: motion shifts the zero-g output in proportion to its mean square.

    V += k_i m      m: mean square of the motion's acceleration over a second, g^2; k in {out}/g^2, one per axis

Symptom   the mean of the output changes when the motion begins, ends or changes its size.
Excited by  motion of different sizes, or with rests between.
Confused with  bias where the motion is always the same; a stretch without motion tells them apart.
Source    IEEE Std 1293, vibration rectification error.
"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from calibrations.effect import Parameter, Values
from calibrations.motion.records import records
from calibrations.table import Array, Table

KINDS = ("motion",)
LEFT_OUT = "it follows the mean square of a motion over a second"
PARAMETERS = (Parameter("coefficient", "{out}/g^2", typical=1.0, doc="shift per mean square of the acceleration"),)
SECOND = 1.0


def transduction(a: Array, table: Table, p: Values) -> Array:
    return np.outer(mean_square_g2(table), p["coefficient"])


def mean_square_g2(table: Table) -> Array:
    """Mean square of the motion about each sample, g^2, shape (n,); records apart."""
    squares = (table.column("acceleration_m_s2") / table.gravity_m_s2) ** 2
    for record in records(table):
        width = max(1, round(SECOND * record.rate_hz))
        squares[record.rows] = uniform_filter1d(squares[record.rows], width, mode="nearest")
    return np.asarray(squares)
