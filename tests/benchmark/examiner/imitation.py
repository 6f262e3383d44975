"""The textbook effects that can replace a cause: at its size, no analysis can separate it from them."""

from __future__ import annotations

import numpy as np

from tests.benchmark.examiner.chain import Hidden, contribution, rms
from tests.benchmark.examiner.electronics import share_of_range
from tests.benchmark.examiner.layouts import RAD, Array
from tests.benchmark.examiner.record import Record


def remainders(record: Record, hidden: Hidden) -> dict[str, float]:
    """Remainder of the cause after a fit of its base and each textbook form: rms in white noise of a mean, by name."""
    base, floor = hidden.cause.base, record.sensor.floor_v
    left = record.residual(contribution(record, hidden), base)
    axes, out = [_own_forms(record, k) for k in (0, 1)], {}
    for name in axes[0]:
        fitted = []
        for k in (0, 1):
            columns, q = np.stack(axes[k][name], 1), record.bases[base][k]
            fitted.append(_left(columns - q @ (q.T @ columns), left[:, k]))
        out[name] = rms(np.stack(fitted, 1)) / floor
    for name, both in _joint_forms(record).items():
        columns = np.stack([record.residual(column, base).T.ravel() for column in both], 1)
        out[name] = rms(_left(columns, left.T.ravel())) / floor
    if base == "bias+scale":
        out["axis-misalignment"] = rms(record.residual(left, "affine")) / floor
    return out


def _left(columns: Array, values: Array) -> Array:
    return values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]


def _own_forms(record: Record, k: int) -> dict[str, list[Array]]:
    """Columns with a coefficient for each axis."""
    x, y, z = record.force[:, k], record.force[:, 1 - k], record.force[:, 2]
    age = record.clock.elapsed / record.clock.elapsed[-1]
    since = record.clock.since_start / max(record.clock.since_start.max(), 1)
    decays = [np.exp(-since / share) for share in (0.05, 0.2, 0.6)]
    forms = {
        "quadratic-nonlinearity": [x * x],
        "cubic-nonlinearity": [x**3],
        "odd-quadratic-nonlinearity": [x * abs(x)],
        "scale-factor-asymmetry": [abs(x)],
        "cross-axis-bias": [y * y],
        "cross-axis-scale": [x * y],
        "z-axis-bias": [z * z],
        "z-axis-scale": [x * z, x * z * z],
        "bias-drift": [
            age,
            *(np.cos(j * np.pi * record.clock.elapsed / record.clock.elapsed[-1]) for j in range(2, 8)),
        ],
        "dead-zone": [np.clip(x, -0.01, 0.01), np.clip(x, -0.003, 0.003)],
        "saturation": [np.clip(x - 0.9, 0, None), np.clip(x + 0.9, None, 0)],
    }
    if record.columns.has_temperature:
        T = record.temperature.celsius - record.temperature.celsius.mean()
        forms |= {"temperature-bias": [T, T * T], "temperature-scale": [x * T]}
    forms |= {"warm-up-bias": decays, "warm-up-scale": [decay * x for decay in decays]}
    if record.columns.has_supply:
        change = record.supply.volts - record.supply.volts.mean()
        forms["supply-sensitivity"] = [record.ideal_v[:, k] * change]
    if record.vibration.is_on and record.averaging.states_std:
        forms["vibration-rectification"] = [record.vibration.rms_g**2]
    return forms


def _joint_forms(record: Record) -> dict[str, list[Array]]:
    """Columns of both axes, (n, 2), with one coefficient."""
    beta, by_beta = record.poses.beta * RAD, record.derivative("beta")
    u = share_of_range(record, record.ideal_v)
    return {
        "stage-zero-offset": [record.derivative("alpha"), by_beta],
        "base-tilt": [record.derivative("tilt_x"), record.derivative("tilt_y")],
        "stage-eccentricity": [by_beta * np.sin(beta)[:, None], by_beta * np.cos(beta)[:, None]],
        "stage-backlash": [by_beta * record.poses.side[:, None]],
        "adc-nonlinearity": [u**power for power in (2, 3, 4, 5)],
    }
