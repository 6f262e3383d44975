"""What holds for every digital sensor that streams frames: the gain of its clock, a restart, an hour without a loss."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.errors import SensorFault
from drivers.imu_lines import driver as imu_lines
from drivers.mavlink_imu import driver as mavlink_imu
from drivers.transport.faults import Fault
from drivers.world.config import WorldConfig
from drivers.world.world import World
from drivers.xsens_mti import driver as xsens_mti
from tests.drivers.digital import DigitalSensors, Ramp
from tests.slow import before_release

SETTINGS = {"mavlink_imu": mavlink_imu.Settings, "xsens_mti": xsens_mti.Settings}


def connect(digital: DigitalSensors, driver: str, *faults: Fault, world: Any = None, **keys: Any) -> Any:
    return digital.connect(driver, SETTINGS[driver](**keys), *faults, world=world)


@pytest.mark.parametrize("driver", ["imu_lines", *SETTINGS])
def test_a_stuck_axis_is_noticed_over_short_records(digital: DigitalSensors, driver: str) -> None:
    settings = (SETTINGS | {"imu_lines": imu_lines.Settings})[driver](rate_hz=100.0)
    adc = digital.connect(driver, settings, Fault("stuck-axis", at_s=2.0))
    adc.acquire(0.2)
    adc._clock.sleep(4.0)
    records = []
    for _ in range(4):
        records.append(adc.acquire(0.2))
        adc._clock.sleep(3.0)
    with pytest.raises(SensorFault, match="ax gave the same value 100 times while others changed") as raised:
        adc.acquire(0.2)
    assert raised.value.since_s == records[0].start_s


@pytest.mark.parametrize("driver", ["imu_lines", *SETTINGS])
def test_the_equal_samples_at_the_end_of_a_record_count(digital: DigitalSensors, driver: str) -> None:
    settings = (SETTINGS | {"imu_lines": imu_lines.Settings})[driver](rate_hz=100.0)
    adc = digital.connect(driver, settings, Fault("stuck-axis", at_s=5.3))
    adc.acquire(1.0)
    adc._clock.sleep(5.0 - adc._clock.now())
    for _ in range(4):
        adc.acquire(0.5 if adc._clock.now() < 5.2 else 0.2)
    with pytest.raises(SensorFault, match=r"ax gave the same value 1\d\d times") as raised:
        adc.acquire(0.2)
    assert raised.value.since_s == pytest.approx(5.3, abs=0.02)


class Coarse(Ramp):
    """Outputs in steps of 0.01 with a noise of 0.1 steps; `ay` and `gy` are between two steps, `az` is noisier."""

    def __init__(self, noise_az: float = 0.1) -> None:
        self._random, self._noise_az = np.random.default_rng(1), noise_az

    def sensed(self, outputs: Sequence[str], start_s: float, interval_s: float, n: int) -> NDArray[np.float64]:
        steps = self._random.normal(size=(n, len(outputs)))
        steps *= [self._noise_az if name == "az" else 0.1 for name in outputs]
        return 0.01 * np.round(steps + [0.5 if name[1] == "y" else 0.0 for name in outputs])


@pytest.mark.parametrize("outputs", ["ax ay az", "gx gy gz", "ax ay supply"])
def test_a_quiet_axis_in_coarse_steps_is_not_stuck(digital: DigitalSensors, outputs: str) -> None:
    columns = {name: k for k, name in enumerate(["time", *outputs.split()], 1)}
    adc = digital.connect("imu_lines", imu_lines.Settings(columns=columns, rate_hz=100.0), world=Coarse())
    samples = adc.acquire(20.0)
    assert (np.ptp(samples.volts, axis=0) == 0).tolist() == [name[1] != "y" for name in outputs.split()]


def test_a_constant_axis_beside_a_noisy_one_is_stuck_and_a_constant_supply_is_not(digital: DigitalSensors) -> None:
    columns = {"time": 1, "ax": 2, "az": 3, "supply": 4}
    adc = digital.connect("imu_lines", imu_lines.Settings(columns=columns, rate_hz=100.0), world=Coarse(noise_az=3.0))
    with pytest.raises(SensorFault, match="ax gave the same value"):
        adc.acquire(2.0)
    assert np.ptp(adc.only("az").acquire(2.0).volts) > 0
    columns = {"time": 1, "az": 2, "supply": 3}
    adc = digital.connect("imu_lines", imu_lines.Settings(columns=columns, rate_hz=100.0), world=Coarse(noise_az=3.0))
    assert np.ptp(adc.acquire(2.0).volts, axis=0)[1] == 0


@pytest.mark.parametrize("driver", ["imu_lines", *SETTINGS])
def test_an_axis_that_repeats_a_value_between_changes_is_not_stuck(digital: DigitalSensors, driver: str) -> None:
    settings = (SETTINGS | {"imu_lines": imu_lines.Settings})[driver](rate_hz=100.0)
    adc = digital.connect(driver, settings, *(Fault("stuck-axis", at_s=float(t), for_s=3.0) for t in range(2, 60, 12)))
    for _ in range(12):
        adc.acquire(0.2)
        adc._clock.sleep(3.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("driver", "keys"),
    [("mavlink_imu", {"message": "HIGHRES_IMU"}), ("mavlink_imu", {"message": "SCALED_IMU"}), ("xsens_mti", {})],
)
def test_the_gain_of_the_clock_is_measured_over_all_records(
    digital: DigitalSensors, driver: str, keys: dict[str, str]
) -> None:
    adc = connect(digital, driver, Fault("clock-drift", size=80.0), **keys)
    for _ in range(3):
        adc.acquire(2.0)
        adc._clock.sleep(3000.0)
    adc.acquire(2.0)
    assert adc.tally()["sensor-clock-gain"][0] == pytest.approx(80.0, abs=2.0)
    assert adc.tally()["sensor-restarts"] == (0.0, "")


@pytest.mark.parametrize(("driver", "rate_hz", "at_s"), [("mavlink_imu", 100.0, 20.0), ("xsens_mti", 200.0, 10.0)])
def test_after_a_restart_the_next_record_configures_the_sensor_again(
    digital: DigitalSensors, driver: str, rate_hz: float, at_s: float
) -> None:
    adc = connect(digital, driver, Fault("restart", at_s=at_s), rate_hz=rate_hz)
    adc.acquire(2.0)
    adc._clock.sleep(60.0)
    assert len(adc.acquire(2.0).volts) == 2 * rate_hz
    assert adc.tally()["sensor-restarts"] == (1.0, "")


@pytest.mark.slow
@pytest.mark.parametrize("driver", [*list(SETTINGS)[:1], *before_release(list(SETTINGS)[1:])])
def test_an_hour_of_a_thousand_samples_a_second_loses_nothing(digital: DigitalSensors, driver: str) -> None:
    world = World(WorldConfig.adxl203(), seed=1)
    adc = connect(digital, driver, rate_hz=1000.0, world=world)
    n = 0
    for block in adc.stream(3600.0, 60.0):
        n += len(block.volts)
    assert n == 3_600_000
    counts = {name: value for name, (value, _) in adc.tally().items()}
    assert (counts["samples"], counts["samples-lost"], counts["samples-doubled"]) == (n, 0, 0)
