"""Doubts about the input of a fit: noise that is stated wrongly, and parameters that no sensor has.

floor        the error is far below the noise floor, or far above it without any pattern: std, n or a constant is wrong
misfit       the residual is larger than effects of a sensor
zero         the zero of a stage is off by degrees, and the model has no effect for it
response     a scale factor that is 0 within its uncertainty, negative, unlike the other axes, or unlike the unit

Source  von Neumann, Ann. Math. Statist. 12 (1941): the mean square of successive differences shows a pattern.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from calibrations.criteria import (
    FEWEST_FOR_FLOOR,
    FEWEST_RESPONSE_ROWS,
    LARGEST_MISFIT,
    MUCH_MORE_THAN_NOISE,
    OWN_UNIT,
    UNLIKE_AXES,
    V_PER_G,
    WRONG_FLOOR,
)
from calibrations.discovery.outliers import outlier_text
from calibrations.discovery.readings import zero_doubt
from calibrations.discovery.verdict import Finding, Verdict
from calibrations.fitting.fit import Fit
from calibrations.geometry.orientation import one_orientation
from calibrations.means.noise import inflation, rms, robust_std, white_std
from calibrations.model import Estimate
from calibrations.table import Array, Table
from calibrations.tables import Kind

SCALES = ("scale-factor", "gyro-scale-factor")
INDEPENDENT = 0.75  # of the successive differences' mean square over twice the variance: 1 without a pattern
UNEVEN = 1.5  # ratio of the 90 % and 10 % quantiles of a standard deviation: that of thousands of samples is known well
LEAST_REMAINDER = 0.7  # of an rms
FARTHEST = 10.0  # robust standard deviations of the other rows
FEW_ROWS = 0.15  # of all: more are no outliers
_ANGLES = ("alpha_deg", "beta_deg")
SAME_FACTOR = 1.3  # largest ratio between a factor and that of a mistake
ROWS_APART = 3.0  # standard uncertainties of a scale factor
RATE_UNITS = {"rad/s": 180 / np.pi, "revolutions a minute": 6.0, "revolutions a second": 360.0}  # in deg/s


def fit_doubts(fit: Fit) -> tuple[str, ...]:
    """All doubts about the input of a fit, () for a healthy one."""
    return (*_response(fit), *_floor(fit), *_outliers(fit), *_misfit(fit), *_zero(fit))


def _floor(fit: Fit) -> Iterator[str]:
    """A noise floor that is far too high or too low."""
    if not fit.noise.known or fit.table.n < FEWEST_FOR_FLOOR or fit.table.type.moving:
        return
    low = [k for k, excess in enumerate(fit.excess) if excess < WRONG_FLOOR]
    if low and not _uneven_std(fit):
        lowest = float(np.min(fit.excess))
        names = ", ".join(fit.channels[k] for k in low)
        yield (
            f"the error of {names} is only {lowest:.2g} times the noise floor: "
            f"{_cause(fit, 1 / max(lowest, 1e-9), high=True)}; the uncertainties are too large"
        )
        return
    noisy = [k for k in range(len(fit.channels)) if _without_pattern(fit, k)]
    if noisy:
        highest = float(np.max(fit.excess[noisy]))
        names = ", ".join(fit.channels[k] for k in noisy)
        yield (
            f"the rows of {names} scatter without a pattern, {highest:.3g} times more than std and n give: "
            f"{_cause(fit, highest, high=False)}; the uncertainties are from the scatter"
        )


def _cause(fit: Fit, factor: float, *, high: bool) -> str:
    """The likeliest mistake that makes the floor wrong by `factor`, and what to check."""
    table = fit.table
    white = white_std(table)
    general = "check the std columns (standard deviation of single samples), n, filter_corner_hz and sample_rate_hz"
    if white is None or "n" not in table:
        return general
    n = float(np.median(table.column("n")))
    effective = float(np.sqrt(n / inflation(table)))
    std = float(np.median(white)) * effective  # of one sample, as stated
    causes: Mapping[str, float] = (
        {"std columns in thousandths of the output's unit": 1e3}
        if high
        else {
            "std columns that hold standard errors of the means": effective,
            "std columns that hold variances": 1 / np.sqrt(std) if std > 0 else np.inf,
            "std columns in thousands of the output's unit": 1e3,
        }
    )
    likely = [text for text, expected in causes.items() if 1 / SAME_FACTOR < factor / expected < SAME_FACTOR]
    return f"it looks like {' or '.join(likely)}; {general}" if likely else general


def _uneven_std(fit: Fit) -> bool:
    """Whether the scatter of samples differs much from row to row, as under vibration: then no floor is wrong."""
    std = [fit.table.column(name) for name in fit.table.columns if "_std" in name]
    return any(np.quantile(column, 0.9) > UNEVEN * np.quantile(column, 0.1) for column in std)


def _without_pattern(fit: Fit, channel: int) -> bool:
    """Whether a residual is far above the floor, and its rows are independent in time, in angle and in size."""
    if fit.excess[channel] < MUCH_MORE_THAN_NOISE:
        return False
    table = fit.table
    r = _regression_residual(fit.residual[channel], table)
    if rms(r) < LEAST_REMAINDER * rms(fit.residual[channel]) or robust_std(r) < LEAST_REMAINDER * rms(r):
        return False  # an effect, or outliers: other checks name them
    orders = [np.arange(table.n)]
    if table.type.known_input and channel < len(table.axes):  # by the prediction: a reading contains an error
        orders += [np.argsort(table.outputs[:, channel] - fit.residual[channel], kind="stable")]
    if table.type.stage_angles:
        orders += [np.lexsort((table.column(a), table.column(b))) for a, b in (_ANGLES, _ANGLES[::-1])]
    limit = min(INDEPENDENT, 1 - 2.5 / np.sqrt(table.n))  # with few rows the ratio scatters
    return all(_ratio(r[order]) > limit for order in orders)


def _regression_residual(r: Array, table: Table) -> Array:
    """The residual of a regression on outputs, temperature, supply, time and products, scaled for its freedom."""
    v = (table.outputs - table.outputs.mean(axis=0)) / np.maximum(table.outputs.std(axis=0), np.finfo(float).tiny)
    rows, columns = np.triu_indices(v.shape[1])
    parts = [np.ones(len(v)), v, v[:, rows] * v[:, columns]]
    for name in ("temperature_c", "supply_v", "t_s"):
        if name in table and np.ptp(table.column(name)) > 0:
            standardised = (table.column(name) - table.column(name).mean()) / table.column(name).std()
            parts += [standardised, standardised[:, None] * v]
    basis = np.linalg.svd(np.column_stack(parts), full_matrices=False)[0]
    return np.asarray((r - basis @ (basis.T @ r)) * np.sqrt(len(r) / max(len(r) - basis.shape[1], 1)))


def _ratio(x: Array) -> float:
    return float(np.mean(np.diff(x) ** 2) / 2 / np.var(x))


def _outliers(fit: Fit) -> Iterator[str]:
    """Rows far from all others. The module `outliers` finds those of poses, by their neighbours."""
    table = fit.table
    if table.type.stage_angles or table.type.moving or table.n < FEWEST_RESPONSE_ROWS:
        return
    if not fit.noise.known or fit.pooled_excess < MUCH_MORE_THAN_NOISE:
        return
    spread = np.maximum(robust_std(fit.residual, axis=1), rms(fit.noise.white))[:, None]
    rows = np.flatnonzero(np.any(np.abs(fit.residual) > FARTHEST * spread, axis=0))
    if 0 < len(rows) <= FEW_ROWS * table.n:
        yield (
            f"{outlier_text(tuple(map(int, table.numbered(rows))), 'rows')} (counted from 0): the sensor moved, or "
            "readings are missing; check them, and leave them out by a column `excluded` with 1"
        )


def _misfit(fit: Fit) -> Iterator[str]:
    """A residual that is larger than the effects of a sensor."""
    if fit.table.type.moving:
        if fit.noise.known and fit.pooled_excess > MUCH_MORE_THAN_NOISE:
            yield (
                f"the residual is {fit.pooled_excess:.3g} times the noise: the model does not follow the motion; "
                "check filter_corner_hz, the delay and the unit of displacement_m, and the attitude, then use "
                "`rig diagnose`"
            )
        return
    if (finding := misfit(fit)) is not None:
        yield finding.text


def _zero(fit: Fit) -> Iterator[str]:
    """A stage zero that is off, at poses of many orientations."""
    table = fit.table
    if not table.type.stage_angles or table.n < FEWEST_RESPONSE_ROWS or one_orientation(table):
        return
    if fit.pooled_excess > MUCH_MORE_THAN_NOISE and (doubt := zero_doubt(table, _residual_share(fit) ** 2)) is not None:
        yield doubt


def _residual_share(fit: Fit) -> float:
    """The rms of the residual as a share of that of the signal, of the output for which it is largest."""
    return float(np.max(fit.rmse / np.maximum(fit.problem.signal_rms, np.finfo(float).tiny)))


def misfit(fit: Fit) -> Finding | None:
    """A residual at known poses, rates or magnitudes that is larger than the effects of a sensor; None if it is not."""
    table = fit.table
    if table.n < FEWEST_RESPONSE_ROWS or table.type.moving or one_orientation(table):
        return None  # an output at rest varies only by effects that the model may lack
    share = _residual_share(fit)
    if share <= LARGEST_MISFIT:
        return None
    return Finding(
        Verdict.UNEXPLAINED,
        f"the residual is {share:.0%} of the {fit.problem.signal}, more than effects of a sensor can cause: do not use "
        "the values; check units, rounding and the order of rows and columns, then use `rig diagnose`",
    )


def _response(fit: Fit) -> Iterator[str]:
    """Scale factors that no sensor has."""
    scale_factors = [
        e for name in SCALES for e in fit.model.estimates(name)
        if e.axis and e.std is not None and (e.identified or e.std > 0) and e.name in ("scale_factor", "scale", name)
    ]  # fmt: skip
    if not scale_factors:
        return
    kind, unit = fit.table.type, fit.table.unit
    if (doubt := _zero_response(scale_factors, kind) or _unlike_axes(scale_factors)) is not None:
        yield doubt
        return
    value = float(np.median([abs(e.value) for e in scale_factors]))
    if kind.moving and all(e.value < 0 for e in scale_factors):
        yield (
            "the scale factor is negative: displacement_m or the outputs have the wrong sign, or the sensor is turned; "
            "check the direction in which displacement_m counts"
        )
    if unit == "V" and kind.input_unit == "g" and not V_PER_G[0] <= value <= V_PER_G[1]:
        yield (
            f"the scale factor is {value:.3g} V/g, and accelerometers have {V_PER_G[0]:g} to {V_PER_G[1]:g} V/g; check "
            "the units of the outputs and of the reference"
        )
    if unit == kind.input_unit == "deg/s" and not OWN_UNIT[0] <= value <= OWN_UNIT[1]:
        yield _wrong_rate_unit(value)


def _zero_response(scale_factors: Sequence[Estimate], kind: Kind) -> str | None:
    """An axis whose scale factor is 0 within its uncertainty."""
    for e in scale_factors:
        if e.std is not None and abs(e.value) < ROWS_APART * e.std:
            return (
                f"the scale factor of {e.axis} is 0 within its uncertainty: this output does not follow "
                f"{_input(kind)}; check its column, its cable and the reference"
            )
    return None


def _unlike_axes(scale_factors: Sequence[Estimate]) -> str | None:
    """Two axes with very different scale factors."""
    sizes = {e.axis: abs(e.value) for e in scale_factors}
    low, high = min(sizes, key=lambda a: sizes[a]), max(sizes, key=lambda a: sizes[a])
    if not sizes[high] > UNLIKE_AXES * sizes[low] > 0:
        return None
    return (
        f"the scale factor of {high} is {sizes[high] / sizes[low]:.3g} times that of {low}, and the axes of one "
        "sensor have similar scale factors; check the units and the gains of these outputs"
    )


def _wrong_rate_unit(scale_factor: float) -> str:
    """A gyroscope in deg/s whose scale factor is far from 1, and the unit that explains it."""
    units = {
        u: size
        for name, of in RATE_UNITS.items()
        for u, size in ((f"rate_deg_s in {name}", of), (f"outputs in {name}", 1 / of))
    }
    likely = [text for text, of in units.items() if 1 / SAME_FACTOR < scale_factor / of < SAME_FACTOR]
    fits = f"it looks like {' or '.join(likely)}" if likely else "the unit of rate_deg_s or of the outputs is wrong"
    return f"outputs in deg/s have a scale factor of {scale_factor:.4g}; {fits}: state the unit of each column"


def _input(kind: Kind) -> str:
    return "the rate" if kind.turning else "the motion" if kind.moving else "gravity"
