"""A flight controller: the driver on its twin, and what each says when something is wrong."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from drivers.digital.settings import FIELDS, FORCES, RATES
from drivers.errors import BadFrame, DriverError, LimitError, LinkTimeout, OverRange, Refused, SensorFault, StreamError
from drivers.mavlink_imu import driver as mavlink_imu
from drivers.mavlink_imu import messages as mav
from drivers.mavlink_imu import twin
from drivers.transport.faults import Fault
from tests.drivers.digital import LEVEL, DigitalSensors

G = 9.80665
PER = {"HIGHRES_IMU": (G, np.radians(1.0), 0.01), "SCALED_IMU": (1.0, np.radians(1.0), 0.01)}  # of g, deg/s, uT
STEP = {"HIGHRES_IMU": (1e-5, 1e-6, 1e-6), "SCALED_IMU": (6e-4, 6e-4, 6e-4)}
Connect = Callable[..., mavlink_imu.FlightController]


@pytest.fixture
def connect(digital: DigitalSensors) -> Connect:
    def make(*faults: Fault, listen: str = "", sends: Any = None, **keys: Any) -> mavlink_imu.FlightController:
        settings = mavlink_imu.Settings(**keys)
        autopilot: mavlink_imu.FlightController = digital.connect(
            "mavlink_imu", settings, *faults, listen=listen, sends=sends
        )
        return autopilot

    return make


@pytest.mark.parametrize("listen", [twin.LISTEN, "pty:?baud=921600", "udpin://127.0.0.1:0"])
@pytest.mark.parametrize("message", list(mav.IMU))
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
        (Fault("mute"), {}, LinkTimeout, "received no HIGHRES_IMU"),
        (Fault("half-message", at_s=4.0), {}, BadFrame, "have a wrong checksum"),
        (Fault("wrong-baud", at_s=4.0), {}, BadFrame, "The baud rate is probably wrong"),
        (Fault("lost-message", at_s=4.0, for_s=0.2), {}, StreamError, "samples were lost"),
        (Fault("stuck-axis"), {}, SensorFault, "ax gave the same value"),
        (Fault("restart", at_s=3.5), {}, LinkTimeout, "received no HIGHRES_IMU"),
        (None, {"range": 9.0}, OverRange, "az reached the end of its range, 9 m/s"),
        (None, {"rate_hz": 5000.0}, Refused, "at 5000 Hz: denied"),
        (None, {"outputs": ("ax", "az"), "sends": mavlink_imu.Settings(outputs=("ax",))}, SensorFault, "sends no az"),
        (None, {"imu": 1, "sends": mavlink_imu.Settings()}, LinkTimeout, "received no HIGHRES_IMU"),
        (None, {"sends": mavlink_imu.Settings(message="SCALED_IMU")}, Refused, "unsupported"),
    ],
)
def test_faults_of_a_mavlink_sensor_are_named(
    connect: Connect, fault: Fault | None, keys: dict[str, Any], kind: type[DriverError], said: str
) -> None:
    adc = connect(*([fault] if fault else []), **keys)
    with pytest.raises(kind, match=said):
        adc.acquire(5.0)


def test_a_check_reports_what_is_wrong(connect: Connect) -> None:
    (check,) = connect(Fault("mute")).self_test()
    assert not check.ok
    assert "received no HIGHRES_IMU" in check.detail


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


@pytest.mark.parametrize("listen", ["tcp://127.0.0.1:0", "udpin://127.0.0.1:0"])
def test_a_fast_stream_loses_nothing(connect: Connect, listen: str) -> None:
    adc = connect(rate_hz=1000.0, outputs=("ax", "ay"), listen=listen)
    values = adc.acquire(30.0).volts
    assert np.diff(values[:, 0]) == pytest.approx(np.full(29_999, 1e-6 * G), abs=2e-7)
    assert adc.tally()["samples-lost"] == (0.0, "")


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


@pytest.mark.parametrize(
    ("message", "field", "updated", "expected_c"),
    [
        ("HIGHRES_IMU", 31.5, 1 << 12 | 7, 31.5),
        ("HIGHRES_IMU", 31.5, 7, None),
        ("SCALED_IMU", 3150, 0, 31.5),
        ("SCALED_IMU", 0, 0, None),
    ],
)
def test_a_temperature_that_the_message_marks_as_missing_is_none(
    message: Any, field: float, updated: int, expected_c: float | None
) -> None:
    fields = {"temperature": field} | ({"updated": updated} if message == "HIGHRES_IMU" else {})
    kind = mav.IMU[message]
    frames = mav.frames(kind, mav.fields(kind, **fields), np.array([1]), 1, 1)
    decoder = mavlink_imu.SampleDecoder(mavlink_imu.Settings(message=message), (1, 1))
    assert decoder.take(frames[0]).warm_c.tolist() == ([] if expected_c is None else [expected_c])
