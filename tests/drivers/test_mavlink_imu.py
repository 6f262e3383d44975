"""A flight controller: the driver on its twin, and what each says when something is wrong."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from drivers.clock import SimulatedClock
from drivers.digital.settings import FIELDS, FORCES, RATES
from drivers.errors import BadFrame, DriverError, LimitError, LinkTimeout, OverRange, Refused, SensorFault, StreamError
from drivers.mavlink_imu import driver as mavlink_imu
from drivers.mavlink_imu import twin
from drivers.transport import Links
from drivers.transport.faults import Fault, faults_of
from drivers.world.config import WorldConfig
from drivers.world.world import World
from tests.drivers.sensed import LEVEL, Ramp

G = 9.80665
PER = {"HIGHRES_IMU": (G, np.radians(1.0), 0.01), "SCALED_IMU": (1.0, np.radians(1.0), 0.01)}  # of g, deg/s, uT
STEP = {"HIGHRES_IMU": (1e-5, 1e-6, 1e-6), "SCALED_IMU": (6e-4, 6e-4, 6e-4)}
Connect = Callable[..., mavlink_imu.FlightController]


@pytest.fixture
def connect() -> Iterator[Connect]:
    opened: list[Any] = []

    def make(*faults: Fault, listen: str = twin.LISTEN, sends: Any = None, **keys: Any) -> mavlink_imu.FlightController:
        world, settings = keys.pop("world", None) or Ramp(), mavlink_imu.Settings(**keys)
        server = twin.serve(world, {"adc": (1, sends or settings)}, listen)
        if faults:
            server.afflict("adc", faults_of("mavlink_imu", faults))
        clock = SimulatedClock()
        clock.attach(server)
        links = Links(clock)
        opened.extend([links, server])
        return mavlink_imu.connect(server.addresses["adc"], links, settings, "adc")

    yield make
    for one in opened:
        one.close()


@pytest.mark.parametrize("listen", [twin.LISTEN, "pty:?baud=921600", "udpin://127.0.0.1:0"])
@pytest.mark.parametrize("message", list(twin.mav.IMU))
def test_a_record_has_the_outputs_in_the_units_of_the_message(connect: Connect, message: str, listen: str) -> None:
    raw = {"raw": "milli"} if message == "RAW_IMU" else {}
    adc = connect(message=message, rate_hz=200.0, listen=listen, **raw)
    assert adc.acquire(0.5).channels == ("ax", "ay", "az")
    kind = "HIGHRES_IMU" if message == "HIGHRES_IMU" else "SCALED_IMU"
    for factor, step, names in zip(PER[kind], STEP[kind], (FORCES, RATES, FIELDS), strict=True):
        samples = adc.only(*names).acquire(0.5)
        t_s = samples.start_s + np.arange(100)[:, None] / 200
        expected = factor * (np.array([LEVEL[name] for name in names]) + 1e-3 * t_s)
        assert np.abs(samples.volts - expected).max() < step + factor * 1e-3 * 0.02
    assert adc.tally()["samples-lost"] == (0.0, "")


def test_counts_are_recorded_as_counts(connect: Connect) -> None:
    adc = connect(message="RAW_IMU", raw="count")
    assert adc.settings.units["gx"] == "count"
    assert adc.acquire(0.1).volts[0] == pytest.approx([1638, -3277, 16384], abs=20)


def test_the_autopilot_is_identified_by_its_heartbeat(connect: Connect) -> None:
    assert connect().identify().model == "PX4, MAVLink 2, system 1, component 1"


def test_the_self_test_shows_messages_rate_time_and_temperature(connect: Connect) -> None:
    messages, rate, clock = connect(rate_hz=50.0).self_test()
    assert messages.ok
    assert "HIGHRES_IMU 100" in messages.detail
    assert "24.5 C" in messages.detail
    assert rate.ok
    assert clock.detail.startswith("the sensor's time is")


@pytest.mark.parametrize(
    ("fault", "keys", "kind", "said"),
    [
        (Fault("silence"), {}, LinkTimeout, "no heartbeat of an autopilot"),
        (Fault("no-heartbeat"), {}, LinkTimeout, r"no heartbeat .*\(0 other messages\)"),
        (Fault("wrong-checksum"), {}, BadFrame, "have a wrong checksum"),
        (Fault("refuses"), {}, Refused, "refuses HIGHRES_IMU at 100 Hz: unsupported"),
        (Fault("refuses", size=2), {}, Refused, "denied"),
        (Fault("mute"), {}, LinkTimeout, "no HIGHRES_IMU came"),
        (Fault("half-message", at_s=4.0), {}, BadFrame, "have a wrong checksum"),
        (Fault("wrong-baud", at_s=4.0), {}, BadFrame, "The baud rate is probably wrong"),
        (Fault("lost-message", at_s=4.0, for_s=0.2), {}, StreamError, "samples were lost"),
        (Fault("stuck-axis"), {}, SensorFault, "ax gave the same value"),
        (Fault("restart", at_s=3.5), {}, LinkTimeout, "no HIGHRES_IMU came"),
        (None, {"range": 9.0}, OverRange, "az reached the end of its range, 9 m/s"),
        (None, {"rate_hz": 5000.0}, Refused, "at 5000 Hz: denied"),
        (None, {"outputs": ("ax", "az"), "sends": mavlink_imu.Settings(outputs=("ax",))}, SensorFault, "sends no az"),
        (None, {"imu": 1, "sends": mavlink_imu.Settings()}, LinkTimeout, "no HIGHRES_IMU came"),
        (None, {"sends": mavlink_imu.Settings("SCALED_IMU")}, Refused, "unsupported"),
    ],
)
def test_what_is_wrong_is_named(
    connect: Connect, fault: Fault | None, keys: dict[str, Any], kind: type[DriverError], said: str
) -> None:
    adc = connect(*([fault] if fault else []), **keys)
    with pytest.raises(kind, match=said):
        adc.acquire(5.0)


def test_a_check_reports_what_is_wrong(connect: Connect) -> None:
    (check,) = connect(Fault("mute")).self_test()
    assert not check.ok
    assert "no HIGHRES_IMU came" in check.detail


def test_lost_and_doubled_messages_are_counted_and_those_of_other_kinds_are_not(connect: Connect) -> None:
    adc = connect(
        Fault("lost-message", probability=0.02, seed=3), Fault("doubled-message", probability=0.01), most_lost=0.1
    )
    samples = adc.acquire(40.0)
    counts = {name: value for name, (value, _) in adc.tally().items()}
    true = np.rint(np.diff(samples.volts[:, 0]) / (1e-3 * G) * 100)
    assert counts["samples-lost"] == pytest.approx(true.sum() - len(true), abs=1)
    assert 40 < counts["samples-lost"] < 160
    assert 10 < counts["samples-doubled"] < 80
    assert (counts["samples"], counts["messages-damaged"]) == (4000, 0)


def test_damaged_messages_are_counted_and_skipped(connect: Connect) -> None:
    adc = connect(Fault("flipped-bit", size=200, probability=0.01), listen="pty:?baud=921600", most_lost=0.1)
    adc.acquire(20.0)
    counts = {name: value for name, (value, _) in adc.tally().items()}
    assert 5 < counts["messages-damaged"] < 50
    assert counts["samples-lost"] == pytest.approx(counts["messages-damaged"], abs=2)  # some are heartbeats


@pytest.mark.slow
@pytest.mark.parametrize("message", ["HIGHRES_IMU", "SCALED_IMU"])
def test_the_gain_of_the_clock_is_measured_over_all_records(connect: Connect, message: str) -> None:
    adc = connect(Fault("clock-drift", size=80.0), message=message)
    for _ in range(3):
        adc.acquire(2.0)
        adc._clock.sleep(3000.0)
    adc.acquire(2.0)
    assert adc.tally()["sensor-clock-gain"][0] == pytest.approx(80.0, abs=2.0)
    assert adc.tally()["sensor-restarts"] == (0.0, "")


def test_after_a_restart_the_next_record_requests_the_message_again(connect: Connect) -> None:
    adc = connect(Fault("restart", at_s=20.0))
    adc.acquire(2.0)
    adc._clock.sleep(60.0)
    assert len(adc.acquire(2.0).volts) == 200
    assert adc.tally()["sensor-restarts"] == (1.0, "")


@pytest.mark.parametrize("listen", ["tcp://127.0.0.1:0", "udpin://127.0.0.1:0"])
def test_a_fast_stream_loses_nothing(connect: Connect, listen: str) -> None:
    adc = connect(rate_hz=1000.0, outputs=("ax", "ay"), listen=listen)
    values = adc.acquire(30.0).volts
    assert np.diff(values[:, 0]) == pytest.approx(np.full(29_999, 1e-6 * G), abs=2e-7)
    assert adc.tally()["samples-lost"] == (0.0, "")


@pytest.mark.slow
def test_an_hour_of_a_thousand_samples_a_second_loses_nothing_and_takes_20_s(connect: Connect) -> None:
    adc = connect(rate_hz=1000.0, outputs=("ax", "ay"), world=World(WorldConfig.adxl203(), seed=1))
    begun_s, n = time.process_time(), 0
    for block in adc.stream(3600.0, 60.0):
        n += len(block.volts)
    assert time.process_time() - begun_s < 20.0
    assert n == 3_600_000
    counts = {name: value for name, (value, _) in adc.tally().items()}
    assert (counts["samples"], counts["samples-lost"], counts["samples-doubled"]) == (n, 0, 0)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"outputs": ()}, "outputs must be different outputs"),
        ({"outputs": ("ax", "ax")}, "outputs must be different outputs"),
        ({"outputs": ("vx",)}, "outputs must be different outputs"),
        ({"message": "RAW_IMU"}, "raw must be `count` or `milli`"),
        ({"raw": "count"}, "raw must be `count` or `milli`"),
        ({"imu": 300}, "imu must be 0 to 255"),
        ({"message": "SCALED_IMU", "imu": 1}, "imu must be 0 to 255"),
        ({"rate_hz": 0.0}, "rate_hz must be positive"),
    ],
)
def test_settings_that_cannot_be_are_refused(keys: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        mavlink_imu.Settings(**keys)


def test_only_outputs_of_the_settings_can_be_recorded(connect: Connect) -> None:
    with pytest.raises(LimitError, match="the sensor sends no mx; its outputs are ax, ay"):
        connect(outputs=("ax", "ay")).only("mx")
