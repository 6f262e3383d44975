"""Tables of the simulated sensor with a hidden fault, as files for the workbench."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from calibrations.design.experiment import Experiment
from calibrations.importing.foreign import write_csv
from calibrations.table import Array, Table
from drivers.world.world import World
from rig.bench import read_bench
from tests.hidden.quick_rig import QuickRig
from tests.hidden.rigs import IDEAL, rig_with, unexplained_rig

CONSTANTS = {"filter_corner_hz": 15.07, "sample_rate_hz": 1000.0}


def hidden(folder: Path, defect: str, times_noise: float = 40.0) -> str:
    """A sweep of 518 poses on a rig with one defect; the file's name."""
    return _written(folder, defect, rig_with(defect, times_noise, seed=3))


def unexplained(folder: Path, defect: str) -> str:
    """The same with a defect that the catalogue does not hold."""
    return _written(folder, defect, unexplained_rig(defect, 40.0, seed=3))


def thousand(folder: Path) -> str:
    """1,000 poses."""
    alpha, beta = np.repeat(np.linspace(20.0, 160.0, 20), 50), np.tile(np.arange(0.0, 360.0, 7.2), 20)
    return _written(folder, "thousand", World(IDEAL, 3).dwell_mean(alpha, beta, direction=np.ones(1000, dtype=int)))


def two_faults(folder: Path) -> str:
    """180 poses of a sensor that is turned by 0.3 deg about z in its package, with a quadratic term in both outputs."""
    rng = np.random.default_rng(4)
    alpha, beta = np.repeat(np.linspace(30.0, 150.0, 5), 36), np.tile(np.arange(0.0, 360.0, 10.0), 5)
    direction = np.radians(beta + 0.3)
    load = np.sin(np.radians(alpha)) * np.array([np.cos(direction), np.sin(direction)])
    vx, vy = 2.5 + load + 0.004 * load**2 + 5e-5 * rng.standard_normal(load.shape)
    return _written(folder, "two-faults", {"alpha_deg": alpha, "beta_deg": beta, "vx_v": vx, "vy_v": vy})


def scattered(folder: Path) -> str:
    """24 poses that scatter by far more than the noise of their means."""
    rng = np.random.default_rng(5)
    alpha, beta = np.full(24, 90.0), np.tile(np.arange(0.0, 360.0, 45.0), 3)
    load = np.array([np.cos(np.radians(beta)), np.sin(np.radians(beta))])
    vx, vy = 2.5 + load + 5e-3 * rng.standard_normal(load.shape)
    noise = {"vx_std_v": np.full(24, 1e-3), "vy_std_v": np.full(24, 1e-3), "n": np.full(24, 1000.0)}
    return _written(folder, "scattered", {"alpha_deg": alpha, "beta_deg": beta, "vx_v": vx, "vy_v": vy, **noise})


def ambiguous(folder: Path) -> str:
    """Poses of a sensor that is turned about z, which a stage's zero explains as well."""
    config = IDEAL.changed({"sensor": {"package": {"turn_z_deg": 0.05}}})
    steps = Experiment("sweep", {"step_deg": 45.0, "inclinations_deg": [90.0, 30.0, 150.0]}, (), "")
    write_csv(QuickRig(config, 8, read_bench(None)).measure(steps)[1], path := folder / "turned.csv")
    return str(path)


def hundred_thousand(folder: Path) -> str:
    """A raw log of 100,000 rows: 1,000 samples at each of 100 poses."""
    rng = np.random.default_rng(1)
    alpha, beta = (np.repeat(each, 1000) for each in (np.repeat([90.0, 30.0, 150.0, 60.0], 25),
                                                      np.tile(np.arange(0.0, 360.0, 14.4), 4)))  # fmt: skip
    load = np.sin(np.radians(alpha)) * np.array([np.cos(np.radians(beta)), np.sin(np.radians(beta))])
    vx, vy = 2.5 + load + 0.01 * load**2 + 1e-3 * rng.standard_normal(load.shape)
    rows = {"t_s": np.arange(1e5) / 1000.0, "alpha_deg": alpha, "beta_deg": beta, "vx_v": vx, "vy_v": vy}
    return _written(folder, "log", rows)


def wandering(folder: Path) -> str:
    """A still record of 20,000 samples at 10 Hz: white noise, and a walk that its data sheet does not name."""
    rng = np.random.default_rng(2)
    volts = 2.5 + 1e-3 * rng.standard_normal(20_000) + 2e-5 * np.cumsum(rng.standard_normal(20_000))
    table = Table.from_columns("still", {"vx_v": volts}, {"sample_rate_hz": 10.0, "output_per_g": 0.8}, "wandering")
    write_csv(table, path := folder / "wandering.csv")
    return str(path)


def _written(folder: Path, name: str, columns: dict[str, Array]) -> str:
    path = folder / f"{name}.csv"
    write_csv(Table.from_columns("poses", columns, CONSTANTS, name), path)
    return str(path)
