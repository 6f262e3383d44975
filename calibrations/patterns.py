"""Patterns that a residual may show, whatever their cause: harmonics, steps, sectors, trends, outliers.

They are not effects: they explain nothing. They tell whether something is left that the catalogue does not hold,
and describe it in words that a person can start from.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calibrations.chain import nominal_pose, specific_force
from calibrations.table import Array, Table

HARMONICS = range(2, 13)
STEPS = 40
SECTORS = 24
SECTOR_WIDTH_DEG = 30.0


@dataclass(frozen=True)
class Pattern:
    """Columns, shape (channels, n, k), and what they mean."""

    text: str
    columns: Array


def patterns(table: Table, channels: tuple[str, ...]) -> list[Pattern]:
    """Every pattern that the table's columns can show; rows in order of time."""
    found = [*_in_time(table), *_in_columns(table)]
    if table.kind == "poses":
        found += [*_in_angles(table), *_in_stage(table, len(channels))]
    if table.kind == "motion":
        found += _in_parts(table, channels)
    return [_per_channel(p, len(channels)) for p in found if np.ptp(p.columns) > 0]


def _per_channel(pattern: Pattern, channels: int) -> Pattern:
    """Columns given as (n, k) serve each channel on its own."""
    if pattern.columns.ndim == 3:
        return pattern
    n, k = pattern.columns.shape
    columns = np.zeros((channels, n, k * channels))
    for c in range(channels):
        columns[c, :, c * k : (c + 1) * k] = pattern.columns
    return Pattern(pattern.text, columns)


def _in_time(table: Table) -> Iterator[Pattern]:
    t = table.time_s
    named = "t_s" in table
    where = "t = {:.0f} s" if named else "row {:.0f}"
    u = (t - t.mean()) / (np.ptp(t) or 1.0)
    yield Pattern("trend with time", np.column_stack([u, u**2]))
    inner = np.unique(np.linspace(2, table.n - 3, min(STEPS, max(table.n - 4, 1))).astype(int))
    for k in inner:
        yield Pattern(f"step at {where.format((t[k - 1] + t[k]) / 2)}", (np.arange(table.n) >= k)[:, None] * 1.0)


def _in_columns(table: Table) -> Iterator[Pattern]:
    words = {"direction": "direction of turning", "temperature_c": "temperature", "supply_v": "supply voltage"}
    skip = {"alpha_deg", "beta_deg", "t_s", "n", "flip", "mount_deg", *("ax", "ay", "az", "vx_v", "vy_v", "vz_v")}
    skip.add("displacement_m")
    for name, values in table.columns.items():
        if name in skip or name.endswith(("_std", "_std_v")) or not np.ptp(values):
            continue
        u = (values - values.mean()) / np.ptp(values)
        powers = [u, u**2] if len(np.unique(values)) > 3 else [u]
        yield Pattern(f"follows {words.get(name, name)}", np.column_stack(powers))


def _in_parts(table: Table, channels: tuple[str, ...]) -> Iterator[Pattern]:
    """A part of the motion that is off alike in every stretch."""
    for channel, one in zip(channels, np.eye(len(channels)), strict=True):
        yield Pattern(f"{channel} is off throughout", np.tile(one[:, None, None], (1, table.n, 1)))


def _in_angles(table: Table) -> Iterator[Pattern]:
    beta = np.radians(table.column("beta_deg"))
    for k in HARMONICS:
        yield Pattern(f"{_ordinal(k)} harmonic of beta", np.column_stack([np.cos(k * beta), np.sin(k * beta)]))
    turn = np.degrees(beta) % 360
    for centre in np.arange(SECTORS) * 360 / SECTORS:
        away = np.abs((turn - centre + 180) % 360 - 180)
        bump = np.maximum(0.0, 1 - away / SECTOR_WIDTH_DEG)
        yield Pattern(f"sector of beta around {centre:.0f} deg", bump[:, None])
    alpha = table.column("alpha_deg")
    values = np.unique(alpha)
    if 1 < len(values) <= 40:
        for value in values:
            yield Pattern(f"inclination alpha = {value:g} deg", (alpha == value)[:, None] * 1.0)


def _in_stage(table: Table, channels: int) -> Iterator[Pattern]:
    """An error of the stage angle beta turns all axes alike."""
    a = specific_force(nominal_pose(table))
    side = np.where(table.optional("flip", 0.0) > 0, -1.0, 1.0)
    turned = np.stack([-a[:, 1] * side, a[:, 0] * side, np.zeros(table.n)])[:channels]
    beta = np.radians(table.column("beta_deg"))
    for k in HARMONICS:
        waves = np.column_stack([np.cos(k * beta), np.sin(k * beta)])
        yield Pattern(f"{_ordinal(k)} harmonic of the stage angle beta", turned[:, :, None] * waves[None])


def _ordinal(k: int) -> str:
    return f"{k}{'th' if k > 3 else ('st', 'nd', 'rd')[k - 1]}"
