"""A digital sensor that sends lines: the lines, the twin's bytes, and what the driver makes of them."""

from __future__ import annotations

import csv
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from drivers.errors import BadFrame, LimitError, LinkTimeout, OverRange, SensorFault, StreamError
from drivers.imu_lines import driver as imu_lines
from drivers.imu_lines import twin
from drivers.imu_lines.lines import Assembly, checksum, fields
from drivers.imu_lines.proposal import propose_settings
from drivers.transport.faults import Fault
from tests.drivers.digital import DigitalSensors

NUMBERED = {"time": 1, "ax": 3, "ay": 4, "az": 5}
NAMED = {"time": "t", "ax": "x", "ay": "y", "az": "z"}


Connect = Callable[..., imu_lines.LineSensor]


@pytest.fixture
def connect(digital: DigitalSensors) -> Connect:
    def make(*faults: Fault | None, sends: imu_lines.Settings | None = None, **keys: Any) -> imu_lines.LineSensor:
        settings = imu_lines.Settings(**({"columns": NUMBERED} | keys))
        sensor: imu_lines.LineSensor = digital.connect("imu_lines", settings, *filter(None, faults), sends=sends)
        return sensor

    return make


@pytest.mark.parametrize(
    ("style", "columns"), [("csv", NUMBERED), ("named", NAMED), ("teleplot", NAMED), ("nmea", NUMBERED)]
)
@pytest.mark.parametrize(("unit", "one_g"), [("g", 1.0), ("m/s^2", 9.80665), ("count", 16384.0)])
def test_a_record_has_the_outputs_in_the_unit_of_the_sensor(
    connect: Connect, style: str, columns: dict[str, Any], unit: str, one_g: float
) -> None:
    samples = connect(format=style, columns=columns, unit=unit).acquire(0.5)
    assert samples.channels == ("ax", "ay", "az")
    assert samples.volts.shape == (50, 3)
    expected = np.array([0.1, -0.2, 1.0]) + 1e-3 * (samples.start_s + np.arange(50) / 100)[:, None]
    assert np.abs(samples.volts / one_g - expected).max() < 1e-4


def test_the_twin_sends_what_other_readers_read() -> None:
    values = {"time": 20000.0, "ax": 0.125, "ay": -0.25, "az": 1.0}
    (row,) = csv.reader([twin.line_of(values, imu_lines.Settings(NUMBERED)).decode()])
    assert row == ["20000", "0", "0.125000", "-0.250000", "1.000000"]
    line = twin.line_of(values, imu_lines.Settings(NUMBERED, "nmea")).decode().strip()
    assert line.startswith("$PIMU,20000,")
    total = 0
    for letter in line[1 : line.index("*")]:
        total ^= ord(letter)
    assert line.endswith(f"*{total:02X}")


def test_the_checksum_is_that_of_nmea() -> None:
    assert checksum("GPGLL,5300.97914,N,00259.98174,E,125926,A") == 0x28  # the example of many receivers' manuals
    with pytest.raises(ValueError, match="wrong checksum"):
        fields("$PIMU,1,2,3*00", "nmea")


def test_a_cut_line_at_the_start_is_dropped_and_a_damaged_one_counted() -> None:
    lines = Assembly("csv", {"ax": 1, "ay": 2})
    assert lines.take(b"45,6.0\r\n1.0,2.0\r\n3.") == [{"ax": 1.0, "ay": 2.0}]
    assert lines.take(b"0,4.0\n5.0\n") == [{"ax": 3.0, "ay": 4.0}]
    assert (lines.good, lines.damaged, lines.unread) == (2, 1, "5.0")


def test_a_line_that_lost_its_end_does_not_take_values_of_the_next_one() -> None:
    lines = Assembly("csv", {"ax": 2, "ay": 3})
    whole = [f"{k},0.{k},1.{k}\n" for k in range(9)]
    whole[5] = whole[5][:4]  # goes on with the next line: 5,0.6,0.6,1.6
    samples = lines.take("".join(["cut\n", *whole]).encode())
    assert [sample["ay"] for sample in samples] == [1.0, 1.1, 1.2, 1.3, 1.4, 1.7, 1.8]
    assert (lines.good, lines.damaged, lines.unread) == (7, 1, "5,0.6,0.6,1.6")


def test_a_sensor_may_begin_to_send_another_number_of_columns() -> None:
    lines = Assembly("csv", {"ax": 1, "ay": 2})
    samples = lines.take(b"cut\n1,2\n3,4\n5,6,7\n8,9,10\n11,12,13\n")
    assert [sample["ax"] for sample in samples] == [1.0, 3.0, 8.0, 11.0]
    assert lines.damaged == 1


@pytest.mark.parametrize(("unit", "sent"), [("g", "m/s^2"), ("m/s^2", "g"), ("g", "count")])
def test_the_self_test_names_a_unit_in_which_gravity_cannot_be(connect: Connect, unit: Any, sent: Any) -> None:
    *others, gravity, proposal = connect(unit=unit, sends=imu_lines.Settings(NUMBERED, unit=sent)).self_test()
    assert [check.name for check in others] == ["lines", "rate", "time"]
    assert all(check.ok for check in others)
    assert not gravity.ok
    advice = "check the unit" if sent == "count" else f"the unit is probably {sent}"
    assert advice in gravity.detail
    assert f"unit: {sent}, " in proposal.detail
    assert len(connect(unit=unit).self_test()) == 3
    assert len(connect(unit="count", sends=imu_lines.Settings(NUMBERED, unit=sent)).self_test()) == 3


def test_doubled_lines_are_dropped(connect: Connect) -> None:
    samples = connect(Fault("doubled-line")).acquire(0.5)
    assert (np.diff(samples.volts[:, 0]) > 0).all()


@pytest.mark.parametrize(
    ("fault", "keys", "kind", "said"),
    [
        (Fault("lost-line", at_s=0.2, for_s=0.1), {}, StreamError, "samples were lost"),
        (Fault("lost-line"), {}, LinkTimeout, "received no line"),
        (Fault("wrong-baud"), {}, BadFrame, "baud rate is probably wrong"),
        (Fault("stuck-axis"), {}, SensorFault, "ax gave the same value"),
        (None, {"range": 0.9}, OverRange, "az reached the end of its range, 0.9 g"),
        (None, {"columns": {"ax": 9}, "sends": imu_lines.Settings(NUMBERED)}, BadFrame, "Correct format and columns"),
        (None, {"rate_hz": 50.0, "columns": {"ax": 3}, "sends": imu_lines.Settings(NUMBERED)}, StreamError, "100 sam"),
    ],
)
def test_faults_of_a_text_sensor_are_named(
    connect: Connect, fault: Fault | None, keys: dict[str, Any], kind: type[Exception], said: str
) -> None:
    with pytest.raises(kind, match=said):
        connect(fault, **keys).acquire(3.0)


def test_the_self_test_shows_columns_rate_and_time(connect: Connect) -> None:
    lines, rate, time = connect().self_test()
    assert "columns 1, 2, 3, 4, 5" in lines.detail
    assert rate.ok
    assert rate.detail.startswith("100 samples a second")
    assert "+0 ppm" in time.detail


def test_only_outputs_of_the_lines_can_be_asked_for(connect: Connect) -> None:
    sensor = connect()
    assert sensor.only("az").acquire(0.1).channels == ("az",)
    with pytest.raises(LimitError, match="the sensor sends no mx"):
        sensor.only("mx")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"columns": {"time": 1}}, "must name outputs"),
        ({"columns": {"ax": 1, "ay": 1}}, "two names have the same column"),
        ({"columns": {"ax": "x"}}, "columns of csv are numbers"),
        ({"format": "named"}, "columns of named are names"),
        ({"rate_hz": 0.0}, "rate_hz must be positive"),
        ({"range": -1.0}, "range must be positive"),
        ({"most_lost": 1.0}, "most_lost"),
    ],
)
def test_settings_that_cannot_be_are_refused(keys: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        imu_lines.Settings(**keys)


def test_lost_and_doubled_samples_are_counted(connect: Connect) -> None:
    sensor = connect(
        Fault("lost-line", probability=0.02, seed=3), Fault("doubled-line", probability=0.01), most_lost=0.1
    )
    samples = sensor.acquire(40.0)
    counts = {name: value for name, (value, _) in sensor.tally().items()}
    true = np.diff(samples.volts[:, 0]) / 1e-3 * 100  # the ramp shows how many samples there are from each to the next
    assert counts["samples-lost"] == pytest.approx(np.rint(true).sum() - len(true), abs=2)  # or after the last
    assert 40 < counts["samples-lost"] < 160
    assert 10 < counts["samples-doubled"] < 80
    assert counts["samples"] == 4000
    assert counts["lines-damaged"] == 0


@pytest.mark.parametrize("ppm", [-300.0, 0.0, 80.0])
def test_the_gain_of_the_clock_is_measured_over_all_records(connect: Connect, ppm: float) -> None:
    sensor = connect(*([Fault("clock-drift", size=ppm)] if ppm else []))
    for _ in range(3):
        sensor.acquire(2.0)
        sensor._clock.sleep(3000.0)  # beyond the wrap of the sensor's time, after 4295 s
    sensor.acquire(2.0)
    gain, unit = sensor.tally()["sensor-clock-gain"]
    assert gain == pytest.approx(ppm, abs=2.0)
    assert unit == "ppm"
    assert sensor.tally()["sensor-restarts"] == (0.0, "")


@pytest.mark.parametrize("unit", ["g", "m/s^2", "count"])
@pytest.mark.parametrize(
    ("style", "columns"), [("csv", NUMBERED), ("nmea", NUMBERED), ("named", NAMED), ("teleplot", NAMED)]
)
def test_the_self_test_proposes_settings_for_lines_that_do_not_fit(
    connect: Connect, style: Any, columns: dict[str, Any], unit: Any
) -> None:
    named = {"time": "t", "ax": "acc_x", "ay": "acc_y", "az": "acc_z"}
    sends = imu_lines.Settings(named if columns is NAMED else columns, style, unit, time_unit_s=1e-3)
    other: dict[str, Any] = {"format": "csv", "columns": {"ax": 7}}
    lines, proposal = connect(sends=sends, **other).self_test()
    assert not lines.ok
    expected = ", ".join(f"{name}: {column}" for name, column in sends.columns.items())
    rest = f"format: {style}, unit: {unit}, rate_hz: 100.0, time_unit_s: 0.001"
    assert f"{{columns: {{{expected}}}, {rest}}}" in proposal.detail


def test_columns_that_show_no_gravity_are_proposed_anew(connect: Connect) -> None:
    """The lines begin with the time, and the settings take it as ax."""
    sends = imu_lines.Settings(NUMBERED, "csv", "g", time_unit_s=1e-3)
    checks = {check.name: check for check in connect(sends=sends, columns={"ax": 1, "ay": 2, "az": 3}).self_test()}
    assert "check the unit and the columns" in checks["gravity"].detail
    assert "{columns: {time: 1, ax: 3, ay: 4, az: 5}, format: csv, unit: g" in checks["proposal"].detail


def test_six_axes_are_proposed_in_the_usual_order() -> None:
    random = np.random.default_rng(4)
    values = random.standard_normal((50, 6)) * 3 + [310, -120, 4050, -20, 14, 7]
    found = propose_settings([",".join(f"{v:.0f}" for v in row) for row in values], 0.5)
    assert found == {
        "format": "csv",
        "columns": {"ax": 1, "ay": 2, "az": 3, "gx": 4, "gy": 5, "gz": 6},
        "unit": "count",
        "rate_hz": 100.0,
    }


@pytest.mark.parametrize("lines", [[], ["boot"] * 20, ["1,2"] * 20, ["5.5,0.1,0.2"] * 20])
def test_nothing_is_proposed_where_no_accelerometer_is_seen(lines: list[str]) -> None:
    assert propose_settings(lines, 1.0) is None


def test_a_column_of_the_temperature_is_not_an_output(connect: Connect) -> None:
    adc = connect(columns={**NUMBERED, "temperature": 6})
    samples = adc.acquire(0.5)
    assert samples.channels == ("ax", "ay", "az")
    assert samples.temperature_c == 24.5
    assert connect().acquire(0.5).temperature_c is None
    assert "the sensor is at 24.5 C" in adc.self_test()[0].detail


def test_a_named_column_of_the_temperature_is_proposed() -> None:
    lines = [f"ax:{k % 2} ay:0 az:{1 + k % 2} temp:25.{k % 10}" for k in range(20)]
    found = propose_settings(lines, 0.2)
    assert found is not None
    assert found["columns"] == {"ax": "ax", "ay": "ay", "az": "az", "temperature": "temp"}
