"""An hour of a digital sensor's stream at 1 kHz, through its driver and the simulated sensor."""

from __future__ import annotations

import json
import sys

from drivers.mavlink_imu import driver as mavlink_imu
from drivers.world.config import WorldConfig
from drivers.world.world import World
from drivers.xsens_mti import driver as xsens_mti
from tests.benchmark.timed import seconds
from tests.drivers.digital import DigitalSensors

SETTINGS = {"mavlink_imu": mavlink_imu.Settings, "xsens_mti": xsens_mti.Settings}
HOUR_S, BLOCK_S = 3600.0, 60.0


def main() -> None:
    """The driver is the first argument."""
    driver = sys.argv[1]
    sensors = DigitalSensors()
    adc = sensors.connect(driver, SETTINGS[driver](rate_hz=1000.0), world=World(WorldConfig.adxl203(), seed=1))
    samples = []

    def stream() -> None:
        samples.append(sum(len(block.volts) for block in adc.stream(HOUR_S, BLOCK_S)))

    taken = seconds(stream, 1)
    sensors.close()
    print(json.dumps({"seconds": taken, "samples": samples[0]}))


if __name__ == "__main__":
    main()
