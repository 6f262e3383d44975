"""Tables with a known truth, made by formulas written out here and not by the library's own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from calibrations.table import Array, Table

NOISE_V = 50e-6  # of a mean: a dwell of 5 s


def turns(inclinations_deg: Sequence[float] = (90, 30, 150, 60, 120), step_deg: float = 15.0) -> dict[str, Array]:
    """Columns alpha_deg, beta_deg, direction, t_s of a full turn each way at each inclination, 7 s a pose."""
    up = np.arange(0.0, 360.0 + step_deg / 2, step_deg)
    alpha, beta, direction = [], [], []
    for inclination in inclinations_deg:
        alpha += [np.full(2 * len(up), float(inclination))]
        beta += [up, up[::-1]]
        direction += [np.ones(len(up)), -np.ones(len(up))]
    columns = {"alpha_deg": np.concatenate(alpha), "beta_deg": np.concatenate(beta)}
    columns["direction"] = np.concatenate(direction)
    columns["t_s"] = 7.0 * np.arange(len(columns["alpha_deg"])) + 100.0
    return columns


def components(columns: dict[str, Array]) -> tuple[Array, Array, Array]:
    """a_x, a_y, a_z in g at the stage angles."""
    alpha, beta = np.radians(columns["alpha_deg"]), np.radians(columns["beta_deg"])
    return np.sin(alpha) * np.cos(beta), np.sin(alpha) * np.sin(beta), np.cos(alpha)


def poses(columns: dict[str, Array], vx: Array, vy: Array, noise_v: float = NOISE_V, seed: int | None = 0) -> Table:
    """A table of poses with white noise of known level; `seed` None for no noise."""
    n = len(columns["alpha_deg"])
    noise = np.zeros((2, n)) if seed is None else noise_v * np.random.default_rng(seed).standard_normal((2, n))
    std = np.full(n, noise_v * np.sqrt(5000.0))
    measured = {"vx_v": vx + noise[0], "vy_v": vy + noise[1], "vx_std_v": std, "vy_std_v": std, "n": np.full(n, 5000.0)}
    return Table.from_columns("poses", {**columns, **measured}, source="made")


def gauss_markov(rng: np.random.Generator, std: float, tau_s: float, gaps: Array) -> Array:
    """A Gauss-Markov process: standard deviation `std`, time constant `tau_s`, steps of `gaps` s; shape (n,)."""
    x = np.empty(len(gaps))
    x[0] = std * rng.standard_normal()
    for i in range(1, len(gaps)):
        phi = np.exp(-gaps[i] / tau_s)
        x[i] = phi * x[i - 1] + std * np.sqrt(1 - phi**2) * rng.standard_normal()
    return x


def directions(n: int) -> Array:
    """Unit vectors spread over the sphere, shape (n, 3)."""
    z = 1 - (2 * np.arange(n) + 1) / n
    turn = np.pi * (1 + np.sqrt(5)) * np.arange(n)
    return np.column_stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z])
