"""A motion tracker: the driver on its twin, and what each says when something is wrong."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from drivers.digital.settings import FIELDS, FORCES, RATES
from drivers.errors import BadFrame, DriverError, LinkTimeout, OverRange, Refused, SensorFault, StreamError
from drivers.transport.faults import Fault
from drivers.xsens_mti import driver as xsens_mti
from drivers.xsens_mti import twin
from tests.drivers.digital import LEVEL, DigitalSensors

G = 9.80665
Connect = Callable[..., xsens_mti.Tracker]


@pytest.fixture
def connect(digital: DigitalSensors) -> Connect:
    def make(*faults: Fault, listen: str = "", **keys: Any) -> xsens_mti.Tracker:
        tracker: xsens_mti.Tracker = digital.connect("xsens_mti", xsens_mti.Settings(**keys), *faults, listen=listen)
        return tracker

    return make


@pytest.mark.parametrize("listen", [twin.LISTEN, "tcp://127.0.0.1:0"])
@pytest.mark.parametrize("rate_hz", [100.0, 50.0])
def test_a_record_has_the_outputs_in_the_units_of_the_tracker(connect: Connect, rate_hz: float, listen: str) -> None:
    adc = connect(rate_hz=rate_hz, listen=listen)
    for factor, names in ((G, FORCES), (np.radians(1.0), RATES), (0.02, FIELDS)):
        samples = adc.only(*names).acquire(1.0)
        assert samples.channels == names
        t_s = samples.start_s + np.arange(round(rate_hz))[:, None] / rate_hz
        expected = factor * (np.array([LEVEL[name] for name in names]) + 1e-3 * t_s)
        assert np.abs(samples.volts - expected).max() < 1e-5 + factor * 1e-3 * 0.02
    assert adc.tally()["samples-lost"] == (0.0, "")


def test_the_tracker_is_identified_and_measures_afterwards(connect: Connect) -> None:
    adc = connect()
    identity = adc.identify()
    assert (identity.model, identity.serial, identity.firmware) == ("Xsens MTi-30-2A8G4", "037003F8", "1.8.2")
    assert len(adc.acquire(1.0).volts) == 100


def test_the_self_test_shows_outputs_rate_time_and_temperature(connect: Connect) -> None:
    messages, rate, clock = connect(rate_hz=200.0).self_test()
    assert messages.ok
    assert "400 messages with Acceleration; the sensor is at 24.5 C" in messages.detail
    assert rate.ok
    assert "gains +0 ppm" in clock.detail


def test_a_tracker_that_already_sends_is_not_configured(connect: Connect) -> None:
    """A GoToConfig would let its filters begin anew."""
    adc = connect()
    adc.acquire(0.5)
    assert adc._link._line is not None
    assert adc._link._line.sent == 0
    adc.only("gx").acquire(0.5)
    assert adc._link._line.sent == 0
    adc.settings = xsens_mti.Settings(rate_hz=200.0)
    adc.acquire(0.5)
    assert adc._link._line.sent > 0


@pytest.mark.parametrize(
    ("fault", "keys", "kind", "said"),
    [
        (Fault("silence"), {}, LinkTimeout, "no answer of the tracker to message 0x30"),
        (Fault("deaf"), {"rate_hz": 200.0}, LinkTimeout, "no answer of the tracker to message 0x30"),
        (Fault("refuses"), {"rate_hz": 200.0}, Refused, r"invalid parameter \(0x21\)"),
        (Fault("mute"), {"rate_hz": 200.0}, LinkTimeout, "received no MTData2 with Acceleration"),
        (Fault("wrong-checksum"), {}, BadFrame, "have a wrong checksum"),
        (Fault("half-message", at_s=2.0), {}, BadFrame, "are not XBus"),
        (Fault("wrong-baud"), {"rate_hz": 200.0}, BadFrame, "The baud rate is probably wrong"),
        (Fault("lost-message", at_s=2.0, for_s=0.2), {}, StreamError, "samples were lost"),
        (Fault("stuck-axis"), {}, SensorFault, "ax gave the same value"),
        (Fault("clipping", at_s=2.0), {}, OverRange, "the sensor reports ax at the end of its range"),
        (Fault("restart", at_s=2.0), {}, StreamError, "restarted during the record"),
        (None, {"range": 9.0}, OverRange, "az reached the end of its range, 9 m/s"),
        (None, {"rate_hz": 200.0, "outputs": FIELDS}, StreamError, "sends MagneticField at 100 Hz, and rate_hz is 200"),
        (None, {"rate_hz": 2000.0}, StreamError, "sends AccelerationHR at 1000 Hz"),
    ],
)
def test_faults_of_an_xsens_sensor_are_named(
    connect: Connect, fault: Fault | None, keys: dict[str, Any], kind: type[DriverError], said: str
) -> None:
    adc = connect(*([fault] if fault else []), **keys)
    with pytest.raises(kind, match=said):
        adc.acquire(5.0)


def test_lost_doubled_and_damaged_messages_are_counted(connect: Connect) -> None:
    adc = connect(
        Fault("lost-message", probability=0.02, seed=3),
        Fault("doubled-message", probability=0.01),
        Fault("flipped-bit", size=100, probability=0.01),
        most_lost=0.1,
    )
    samples = adc.acquire(40.0)
    counts = {name: value for name, (value, _) in adc.tally().items()}
    true = np.rint(np.diff(samples.volts[:, 0]) / (1e-3 * G) * 100)
    assert counts["samples-lost"] == pytest.approx(true.sum() - len(true), abs=1)
    assert 60 < counts["samples-lost"] < 200
    assert 10 < counts["samples-doubled"] < 80
    assert 15 < counts["messages-damaged"] < 70
    assert counts["samples"] == 4000


@pytest.mark.parametrize("rate_hz", [0.0, 99.5, 2500.0])
def test_a_rate_that_cannot_be_is_refused(rate_hz: float) -> None:
    with pytest.raises(ValueError, match="rate_hz must be"):
        xsens_mti.Settings(rate_hz=rate_hz)


def test_a_record_shorter_than_a_second_has_the_temperature_too(connect: Connect) -> None:
    """The tracker reports it once a second."""
    adc = connect()
    assert [adc.acquire(0.2).temperature_c for _ in range(4)] == [24.5] * 4
    assert adc.only("gx").acquire(0.2).temperature_c == 24.5


def test_a_prepared_tracker_records_at_once(connect: Connect) -> None:
    """Its configuration and the first temperature take a second, in which a turn of the stage would go on."""
    adc = connect(rate_hz=200.0)
    adc.prepare()
    begun_s = adc._clock.now()
    samples = adc.acquire(0.2)
    assert 0 < samples.start_s - begun_s < 0.1
    assert samples.temperature_c == 24.5


def test_an_old_temperature_does_not_describe_the_sensor(connect: Connect) -> None:
    adc = connect()
    adc.acquire(0.2)
    adc._clock.sleep(120.0)
    assert adc._warmth.pull_c(adc._clock.now()) is None
