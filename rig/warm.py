"""Compile and cache the kernels, so that the first command of a fresh installation is as quick as any other."""

from __future__ import annotations

import numpy as np


def main() -> None:
    """Run every compiled kernel once on a small sweep of the simulated rig."""
    from calibrations.diagnose import diagnose
    from calibrations.model_file import read_model
    from calibrations.noise_analysis.analysis import analyse
    from calibrations.table import Table
    from drivers.labjack_t7_stream import Calibration
    from drivers.labjack_t7_twin import codes_of_volts
    from drivers.simulation.config import WorldConfig
    from drivers.simulation.world import World

    world = World(WorldConfig.adxl203(), seed=1)
    beta = np.tile(np.arange(0.0, 360.0, 30.0), 3)
    columns = world.dwell_mean(np.repeat([90.0, 30.0, 150.0], 12), beta, direction=np.ones(36, dtype=int))
    volts = world.adc_volts(["vx", "vy", "supply"], world.now_s, 1e-3, 100)
    codes_of_volts(volts, [Calibration(3.2e-4, -3.2e-4, 33523.0, -10.6)] * 3)
    analyse([np.random.default_rng(1).standard_normal(1000)], 1000.0, "V", "warm")
    diagnose(Table.from_columns("poses", columns, {}, "warm"), read_model("linear"))


if __name__ == "__main__":
    main()
