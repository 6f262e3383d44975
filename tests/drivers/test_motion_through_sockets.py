"""The motion experiment's instruments together, on the world's physics: shaken, sampled, and stopped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from drivers.clock import SimulatedClock
from drivers.labjack_t7 import driver as labjack_t7
from drivers.labjack_t7 import twin as labjack_t7_twin
from drivers.philtec_d63 import SIMULATED, CalibrationCurve
from drivers.pi_e727 import driver as pi_e727
from drivers.pi_e727 import twin as pi_e727_twin
from drivers.recorder import Samples
from drivers.transport import Links
from drivers.world.config import WorldConfig
from drivers.world.world import World

CONVERTER = labjack_t7.Settings(channels={"vx": 0, "vy": 1, "d63": 8})
POSITIONER = pi_e727.Settings()


@dataclass
class Bench:
    clock: SimulatedClock
    adc: labjack_t7.T7
    positioner: pi_e727.Positioner


@pytest.fixture
def bench() -> Iterator[Bench]:
    world, clock = World(WorldConfig.ideal(), seed=3), SimulatedClock()
    converter = labjack_t7_twin.serve(world, {"adc": (1, CONVERTER)})
    controller = pi_e727_twin.serve(world, {"positioner": (1, POSITIONER)})
    for server in (converter, controller):
        clock.attach(server)
    links = Links(clock)
    adc = labjack_t7.connect(converter.addresses["adc"], links, CONVERTER, "adc")
    positioner = pi_e727.connect(controller.addresses["positioner"], links, POSITIONER, "positioner")
    positioner.servo(True)
    yield Bench(clock, adc, positioner)
    links.close()
    for server in (converter, controller):
        server.close()


def displaced_um(samples: Samples) -> np.ndarray:
    return CalibrationCurve.from_file(SIMULATED).displacement_um(samples.volts[:, 2])


def swing(values: np.ndarray, frequency_hz: float, rate_hz: float) -> complex:
    """Amplitude and phase over whole periods."""
    t = np.arange(len(values)) / rate_hz
    return complex(2 * np.mean((values - values.mean()) * np.exp(-2j * np.pi * frequency_hz * t)))


def test_sensor_displacement_sensor_and_recorder_tell_of_one_motion(bench: Bench) -> None:
    really_hz = bench.positioner.oscillate("x", peak_to_peak_um=60.0, frequency_hz=10.0, centre_um=50.0)
    bench.clock.sleep(0.5)
    samples = bench.adc.acquire(4.0)
    record = bench.positioner.recorded("x")
    seen = swing(displaced_um(samples), really_hz, samples.rate_hz)
    felt = swing(samples.volts[:, 0], really_hz, samples.rate_hz)
    measured = swing(record.position_um[500:4500], really_hz, 1 / record.interval_s)
    assert abs(measured) == pytest.approx(30.0, rel=0.01)
    assert abs(seen) == pytest.approx(abs(measured), rel=1e-3)
    noise = WorldConfig.ideal().noise.x
    filtered = 1 / (1 + 2j * np.pi * really_hz * noise.filter_ohm * noise.filter_farad)
    lag = np.exp(-2j * np.pi * really_hz * 2 * WorldConfig.ideal().converter.skew_s)  # vx is sampled before d63
    acceleration_g = -((2 * np.pi * really_hz) ** 2) * 1e-6 * seen * lag / 9.80665
    assert felt / (filtered * acceleration_g) == pytest.approx(1.0, abs=0.03)  # noise, and this sensor's scale factor


def test_a_stop_during_an_acquisition_ends_the_motion_and_not_the_record(bench: Bench) -> None:
    bench.positioner.oscillate("x", peak_to_peak_um=60.0, frequency_hz=10.0, centre_um=50.0)
    blocks = bench.adc.stream(2.0, 0.5)
    moving = [displaced_um(next(blocks)) for _ in range(2)]
    bench.positioner.stop()
    still = [displaced_um(block) for block in blocks][-1]
    assert [np.ptp(block) > 55 for block in moving] == [True, True]
    assert np.ptp(still) < 0.2  # the displacement sensor's noise
    assert still.std() < 0.03
