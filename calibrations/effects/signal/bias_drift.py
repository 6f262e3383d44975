from functools import lru_cache

import numpy as np

from calibrations.effects import Constant, Effect, Parameter, Values
from calibrations.geometry.smooth import smooth_columns
from calibrations.table import Array, Table

HOUR_S = 3600.0
WAVES = range(2, 8)
ROUNDING = 1e-12  # of an output


def _half_waves(k: int) -> Parameter:
    return Parameter("{out}", typical=0.001, where="wanders", doc=f"{k} half waves of it")


class BiasDrift(Effect):
    """bias-drift: the zero-g output changes slowly with time, in a straight line or as a random walk.

        V += d_i h + sum_k w_ki cos(k pi u)      h: hours from the middle of the record; d in {out}/h
                                                 u: from 0 to 1 along the record; w in {out}, k = 2 .. 7

    The cosines are the components of a random walk about its mean (Karhunen and Loeve); the first of them is nearly the
    straight line. They are used where the outputs, after removing smooth functions of the angles, need them as well.

    Symptom   the residual drifts with time, by the same amount at every angle.
    Excited by  a long record in which the angles do not follow the time.
    Confused with  warm-up-bias and temperature-bias, which are also slow. To separate them, return to a reference pose,
              and hold the temperature constant.
    Source    Book 17.3.4 and 17.3.6; IEEE Std 528, drift; IEEE Std 1293, random walk.
    """

    kinds = ("poses", "positions", "fields", "rates")
    left_out = "the drift of one record does not predict the next"
    needs = ("t_s",)

    slope = Parameter("{out}/h", typical=0.001, doc="drift in a straight line")
    wave_2 = _half_waves(2)
    wave_3 = _half_waves(3)
    wave_4 = _half_waves(4)
    wave_5 = _half_waves(5)
    wave_6 = _half_waves(6)
    wave_7 = _half_waves(7)
    middle_s = Constant(lambda table: float(np.min(table.time_s) + np.ptp(table.time_s) / 2))
    span_s = Constant(lambda table: float(np.ptp(table.time_s)) or 1.0)
    wanders = Constant(lambda table: float(_wanders(table)), doc="also wanders in waves (1: yes, 0: no)")

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        elapsed_s = table.time_s - p.middle_s
        drift = np.outer(elapsed_s / HOUR_S, p.slope)
        if p.wanders:
            drift += _waves_of(table, float(p.middle_s), float(p.span_s)) @ np.array([p[f"wave_{k}"] for k in WAVES])
        return drift


@lru_cache(maxsize=4)
def _waves_of(table: Table, middle_s: float, span_s: float) -> Array:
    """The cosines at the rows of `table`."""
    return _waves((table.time_s - middle_s) / span_s)


def _waves(u: Array) -> Array:
    """Cosines of `u`, from -1/2 to 1/2 along the record, shape (n, waves)."""
    return np.cos(np.pi * np.outer(u + 0.5, WAVES))


def _wanders(table: Table) -> bool:
    """Whether a line is not enough: the waves gain more than their price, log(n) each (Schwarz)."""
    smooth = smooth_columns(table)
    if not smooth.size or table.n < 2 * (smooth.shape[1] + len(WAVES)):
        return False
    u = (table.time_s - table.time_s.min()) / (np.ptp(table.time_s) or 1.0) - 0.5
    line = np.column_stack([smooth, np.ones(table.n), u])
    squares = [_residual_square(line, table.outputs), _residual_square(np.hstack([line, _waves(u)]), table.outputs)]
    rounding = table.n * (ROUNDING * np.abs(table.outputs).max(axis=0)) ** 2  # outputs without noise leave no more
    gain = table.n * np.sum(np.log(np.maximum(squares[0], rounding) / np.maximum(squares[1], rounding)))
    return bool(gain > len(table.axes) * len(WAVES) * np.log(table.n))


def _residual_square(columns: Array, outputs: Array) -> Array:
    """Residual sum of squares of each output after a fit of `columns`."""
    residual = outputs - columns @ np.linalg.lstsq(columns, outputs, rcond=1e-9)[0]
    return np.asarray(np.sum(residual**2, axis=0))
