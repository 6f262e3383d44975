"""Compile and cache the kernels, so that the first command of a new installation is fast."""

from __future__ import annotations

import numpy as np

from calibrations.fitting.budget import make_budget
from calibrations.fitting.fit import fit
from calibrations.loop import diagnose
from calibrations.model.file import read_model
from calibrations.noise.analysis import analyse
from calibrations.noise.record import Samples, reduce_record
from calibrations.table import Table
from drivers.labjack_t7.stream import RangeCalibration
from drivers.labjack_t7.twin import codes_of_volts
from drivers.world.config import WorldConfig
from drivers.world.world import World


def main() -> None:
    """Run every compiled kernel once on a small sweep of the simulated rig."""
    world = World(WorldConfig.adxl203(), seed=1)
    beta = np.tile(np.arange(0.0, 360.0, 30.0), 3)
    columns = world.dwell_mean(np.repeat([90.0, 30.0, 150.0], 12), beta, direction=np.ones(36, dtype=int))
    volts = world.adc_volts(["vx", "vy", "supply"], world.now_s, 1e-3, 100)
    codes_of_volts(volts, [RangeCalibration(3.2e-4, -3.2e-4, 33523.0, -10.6)] * 3)
    still = [np.random.default_rng(1).standard_normal(1000)]
    analyse(reduce_record([Samples("x", still, 1000.0, "V")], "warm", every_deviation=True))
    table = Table.from_columns("poses", columns, {}, "warm")
    make_budget(fit(read_model("linear"), table), ())
    diagnose(table, read_model("linear"))


if __name__ == "__main__":
    main()
