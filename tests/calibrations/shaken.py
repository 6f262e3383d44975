"""Tables of motion with a known truth: continuous time stepped ten times finer than the samples, by scipy's filters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.signal import butter, lfilter, lfilter_zi
from scipy.spatial.transform import Rotation

from calibrations.table import Array, Table

GRAVITY = 9.80131
RATE_HZ = 1000.0
FINER = 10
CONSTANTS = {"filter_corner_hz": 15.07, "sample_rate_hz": RATE_HZ, "gravity_m_s2": GRAVITY}
PAPER = ((30e-6, 10.0),)  # amplitude in m, frequency in Hz
TWO = ((30e-6, 10.0), (80e-6, 4.0))
LEAD_S = 0.2  # before the record, for filters to settle


def record(
    motion: Sequence[tuple[float, float]] = PAPER,
    duration_s: float = 12.0,
    seed: int | None = 0,
    *,
    attitudes: Sequence[tuple[float, float]] = ((45.0, 90.0),),
    corner_hz: float = 15.07,
    delay_s: float = 0.0,
    turn_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    scale_v: Sequence[float] = (1.0, 1.0),
    kappa: Array | None = None,
    noise_v: float = 110e-6,
    probe_m: float = 0.2e-6,
    starts_s: float = -1.0,
    constants: Mapping[str, float] | None = None,
) -> Table:
    """A record at each of the attitudes, `duration_s` altogether.

    noise_v    density of the sensor's noise before its output filter, V/sqrt(Hz)
    turn_deg   of the sensor on its mount, about x, y, z
    kappa      (2, 3): output per square of each component of specific force
    starts_s   when the motion begins, within 0.2 s; before the record where negative
    """
    rng = np.random.default_rng(seed)
    parts: list[dict[str, Array]] = []
    for number, (alpha, beta) in enumerate(attitudes):
        n, step = int(duration_s / len(attitudes) * RATE_HZ), 1 / (RATE_HZ * FINER)
        t = np.arange(-LEAD_S, n / RATE_HZ + LEAD_S, step)
        ramp = np.clip((t - starts_s) / 0.2, 0, 1)
        x = (
            ramp**3
            * (10 - 15 * ramp + 6 * ramp**2)
            * sum(a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(motion))
        )
        force = np.tile(_gravity(alpha, beta), (len(t), 1))
        force[:, 0] += np.gradient(np.gradient(x, step), step) / GRAVITY
        felt = Rotation.from_euler("xyz", turn_deg, degrees=True).inv().apply(force)
        v = 2.5 + np.asarray(scale_v) * felt[:, :2] + (felt**2 @ kappa.T if kappa is not None else 0.0)
        if seed is not None:
            v = v + noise_v / np.sqrt(2 * step) * rng.standard_normal(v.shape)
        b, a = butter(1, corner_hz, fs=1 / step)
        v = np.column_stack([lfilter(b, a, w, zi=lfilter_zi(b, a) * w[:500].mean())[0] for w in v.T])
        at = np.arange(n) / RATE_HZ
        seen = {"t_s": at + 100 + number * (n / RATE_HZ + 20), "displacement_m": np.interp(at, t, x)}
        if seed is not None:
            seen["displacement_m"] = seen["displacement_m"] + probe_m * rng.standard_normal(n)
        seen |= {name: np.interp(at - delay_s, t, w) for name, w in zip(("vx_v", "vy_v"), v.T, strict=True)}
        parts.append(seen | {"alpha_deg": np.full(n, alpha), "beta_deg": np.full(n, beta)})
    columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return Table.from_columns("motion", columns, CONSTANTS | dict(constants or {}), "shaken")


def _gravity(alpha_deg: float, beta_deg: float) -> Array:
    return Rotation.from_euler("yz", [alpha_deg, beta_deg], degrees=True).apply([0.0, 0.0, 1.0])


def without_y(table: Table) -> Table:
    """The same, with the output of x alone."""
    columns = {name: values for name, values in table.columns.items() if name != "vy_v"}
    return Table.from_columns("motion", columns, table.constants, table.source)
