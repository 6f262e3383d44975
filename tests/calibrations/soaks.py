"""Series and tables of soaks that never took place: an approach to steady state, beside noise of every kind."""

from __future__ import annotations

from itertools import groupby

import numpy as np

from calibrations.table import Array, Table
from procedures.soak import HOLD, schedule

WHITE_V = 18e-6  # of a bias from a tumble of eight dwells
RATE_HZ, BLOCK_S, POSE_S = 1000.0, 60.0, 9.0


def times_s(n: int) -> Array:
    """Of reversals, as the schedule has them: the first intervals double."""
    holds = [56.0, 112.0, 225.0, 450.0, *[900.0] * (n - 5)]
    return 45.0 + np.concatenate([[0.0], np.cumsum(np.array(holds) + 75.0)])


def noise(seed: int, t_s: Array, kind: str) -> Array:
    """White noise of WHITE_V, and slow noise beside it: none (white), a process (slow), flicker, or a random walk."""
    random = np.random.default_rng(seed)
    white = WHITE_V * random.standard_normal(len(t_s))
    if kind == "walk":
        steps = 100e-6 * np.sqrt(np.diff(t_s, prepend=t_s[0]) / 900)
        return np.asarray(white + np.cumsum(steps * random.standard_normal(len(t_s))))
    processes = {"white": {}, "slow": {1800.0: 60e-6}, "flicker": dict.fromkeys((10.0, 1e2, 1e3, 1e4, 1e5), 25e-6)}
    return np.asarray(white + sum(_process(random, t_s, tau, std) for tau, std in processes[kind].items()))


def _process(random: np.random.Generator, t_s: Array, tau_s: float, std: float) -> Array:
    values = np.empty(len(t_s))
    value, before = std * random.standard_normal(), t_s[0]
    for i, now in enumerate(t_s):
        kept = np.exp(-(now - before) / tau_s)
        value = kept * value + std * np.sqrt(1 - kept**2) * random.standard_normal()
        values[i], before = value, now
    return values


def soak_table(
    duration_s: float = 43200.0, *, drift_v: float = 2e-3, cut_s: float = 0.0, temperature_c: float = 28.0
) -> Table:
    """A night of which both axes drift by `drift_v` with 1.5 h, cut for `cut_s` in the middle of a hold."""
    poses, now, rows = list(schedule(duration_s, 900.0, BLOCK_S)), 0.0, []
    random = np.random.default_rng(1)
    middle = max(k for k, pose in enumerate(poses) if pose.path == f"{HOLD} 10") if cut_s else -1
    for number, pose in enumerate(poses):
        length = BLOCK_S if pose.path.startswith(HOLD) else 5.0
        if number and (pose.path, poses[number - 1].path) != (poses[number - 1].path, pose.path):
            now += POSE_S
        elif pose.path.startswith("reversal"):
            now += POSE_S - length
        now += cut_s if number == middle else 0.0
        rows.append((pose, now + length / 2, length))
        now += length
    t_s, n = np.array([row[1] for row in rows]), np.array([row[2] for row in rows]) * RATE_HZ
    loads = np.array([np.sin(np.radians(p.alpha_deg)) * np.exp(1j * np.radians(p.beta_deg)) for p, _, _ in rows])
    drifting = drift_v * np.exp(-t_s / 5400)
    columns = {"alpha_deg": [p.alpha_deg for p, _, _ in rows], "beta_deg": [p.beta_deg for p, _, _ in rows], "t_s": t_s}
    columns |= {"n": n, "temperature_c": temperature_c - 6 * np.exp(-t_s / 5400), "supply_v": np.full(len(t_s), 5.0)}
    for axis, load in (("x", loads.real), ("y", loads.imag)):
        white = 0.8e-3 * np.sqrt(20 / n) * random.standard_normal(len(n))
        columns[f"v{axis}_v"] = 2.5 - drifting + (1 - drifting / 2) * load + white
        columns[f"v{axis}_std_v"] = np.full(len(n), 0.8e-3)
    constants = {"sample_rate_hz": RATE_HZ, "noise_inflation_x": 20.0, "noise_inflation_y": 20.0}
    return Table.from_columns("poses", columns, constants, "a night", {"path": tuple(p.path for p, _, _ in rows)})


def paths(table: Table) -> list[str]:
    """Reversals and holds in order."""
    return [path for path, _ in groupby(table.labels["path"])]
