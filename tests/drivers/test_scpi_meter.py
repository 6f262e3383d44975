"""SCPI multimeters and scanners: on their twin and through VISA; each failure with what, where and what to do."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.clock import SimulatedClock, WallClock
from drivers.errors import BadFrame, DriverError, LimitError, LinkRefused, LinkTimeout, OverRange, Refused, StreamError
from drivers.scpi_meter import driver
from drivers.scpi_meter.twin import Scanner
from drivers.transport import Address, Links
from drivers.transport.address import Url
from drivers.transport.faults import Fault, faults_of
from tests.drivers.digital import connected
from tests.fuzz.labs import SCPI, scpi_answers

CHANNELS = {"supply": 102, "time": 101}
SIMULATED = """
spec: "1.1"
devices:
  meter:
    eom: {TCPIP SOCKET: {q: "\\n", r: "\\n"}}
    error: "-113,\\"Undefined header\\""
    dialogues:
      - {q: "*IDN?", r: "ACME,M1,42,1.0"}
      - {q: "*RST"}
      - {q: "*CLS"}
      - {q: "ABOR"}
      - {q: "CONF:VOLT:DC 10"}
      - {q: "VOLT:DC:NPLC 1"}
      - {q: "TRIG:SOUR IMM"}
      - {q: "TRIG:COUN 1"}
      - {q: "SYST:ERR?", r: "+0,\\"No error\\""}
      - {q: "READ?", r: "READING"}
resources:
  TCPIP0::meter::5025::SOCKET: {device: meter}
"""

Make = Callable[..., driver.Meter]


@pytest.fixture
def make(small_world: Any) -> Iterator[Make]:
    """A driver on its twin in the small world; `fault` begins once it is connected."""
    with ExitStack() as opened:

        def made(fault: Fault | None = None, **settings: Any) -> driver.Meter:
            chosen = driver.Settings(**{"channels": CHANNELS, "rate_hz": 20.0, "timeout_s": 1.0} | settings)
            meter, server, _ = opened.enter_context(connected("scpi_meter", small_world, chosen, "adc"))
            if fault:
                server.afflict("adc", faults_of("scpi_meter", [fault]))
            return meter

        yield made


@pytest.mark.parametrize("timer", [True, False])
def test_a_record_has_the_channels_of_the_bench_file_at_the_rate(make: Make, timer: bool) -> None:
    samples = make(timer=timer).acquire(2.0)
    assert samples.channels == ("supply", "time")
    assert samples.volts.shape == (40, 2)
    np.testing.assert_allclose(samples.volts[:, 0], 5.0)
    np.testing.assert_allclose(np.diff(samples.volts[:, 1]) / 0.01, 0.05, atol=0.004 if not timer else 1e-6)
    assert samples.volts[0, 1] / 0.01 == pytest.approx(samples.start_s, abs=0.01)


def test_a_long_record_comes_in_blocks_without_a_gap(make: Make) -> None:
    blocks = list(make().stream(60.0, 25.0))
    assert [len(block.volts) for block in blocks] == [500, 500, 200]
    np.testing.assert_allclose(np.diff(np.concatenate([b.volts[:, 1] for b in blocks])), 0.0005, atol=1e-8)


def test_a_value_is_read_in_the_middle_of_a_record(make: Make) -> None:
    samples, read = make().acquire_with(2.0, lambda: 23.5)
    assert (len(samples.volts), read) == (40, 23.5)


def test_only_some_outputs_are_measured(make: Make) -> None:
    assert make().only("time").acquire(0.5).channels == ("time",)
    with pytest.raises(LimitError, match=r"adc: no input is wired to mx"):
        make().only("mx")


def test_one_input_needs_no_channel_list(make: Make) -> None:
    settings = driver.Settings(channels={"vx": 0}, rate_hz=10)
    assert settings.commands(7) == [
        "CONF:VOLT:DC 10", "VOLT:DC:NPLC 1", "TRIG:SOUR IMM", "TRIG:COUN 1",
        "SAMP:SOUR TIM", "SAMP:TIM 0.1", "SAMP:COUN 7",
    ]  # fmt: skip
    assert make(channels={"supply": 0}).acquire(0.5).volts == pytest.approx(5.0)


FAILURES = [
    (Fault("overload"), {}, OverRange, r"time \(input 101\) was beyond its range of 10 V in 20 of 20.*wider range_v"),
    (Fault("error", at_s=0.5), {}, Refused, r"error -222, Data out of range, while it measured.*change range_v"),
    (None, {"range_v": 1e4}, Refused, r"error -222.*at its settings"),
    (None, {"setup": ("INP:IMP:AUTO ON",)}, Refused, r"-113, Undefined header.*take lines out of `setup`"),
    (Fault("stall"), {}, StreamError, r"has 0 of 40 readings 1 s after the last was due.*lower rate_hz"),
    (Fault("silence"), {}, LinkTimeout, r"adc: no answer to 'SYST:ERR\?' within 1\.04 s on tcp://.*switched on"),
    (Fault("disconnect", at_s=0.5), {"timer": False}, LinkRefused, r"adc: tcp://.*connection is lost.*Check cable"),
    (Fault("garbage"), {}, DriverError, r"adc: .*SYST:ERR\?"),
    (Fault("delay", size=0.4), {"timer": False}, StreamError, r"scan 2 is 0\.\d+ s late.*set `timer: true`"),
    (None, {"memory": 40}, StreamError, r"its memory of 40 readings is full"),
]


@pytest.mark.parametrize(("fault", "settings", "error", "told"), FAILURES, ids=range(len(FAILURES)))
def test_a_failure_says_what_where_and_what_to_do(
    make: Make, fault: Fault | None, settings: dict[str, Any], error: type[DriverError], told: str
) -> None:
    with pytest.raises(error, match=told) as raised:
        make(fault, **settings).acquire(1.0)
    assert str(raised.value).startswith("adc: ")


def test_after_an_error_the_next_record_is_whole(make: Make) -> None:
    meter = make(Fault("error", at_s=0.5))
    with pytest.raises(Refused):
        meter.acquire(1.0)
    assert len(meter.acquire(1.0).volts) == 20


def test_a_self_test_shows_refused_settings(make: Make) -> None:
    assert make().self_test()[0].ok
    (check,) = make(range_v=1e4).self_test()
    assert (check.ok, "-222" in check.detail) == (False, True)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"rate_hz": 100.0}, "rate_hz must be at most 25"),
        ({"channels": {"vx": 0, "vy": 101}}, "0 is the only input of a meter"),
        ({"channels": {}, "on_request": {"mx": 103}}, "channels must name inputs"),
        ({"on_request": {"vx": 103}}, "vx is a channel already"),
        ({"interchannel_s": -1.0}, "interchannel_s must be"),
        ({"nplc": 0.0}, "nplc must be positive"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        driver.Settings(**settings)


# Through VISA: a simulated instrument of others.


@pytest.fixture
def visa(tmp_path: Path) -> Iterator[Callable[..., driver.Meter]]:
    """A meter of pyvisa-sim that answers READ? with `reading`."""
    pytest.importorskip("pyvisa_sim")
    links = Links(SimulatedClock())

    def made(reading: str = "+1.25E+00") -> driver.Meter:
        file = tmp_path / "meter.yaml"
        file.write_text(SIMULATED.replace("READING", reading))
        chosen = driver.Settings(channels={"vx": 0}, rate_hz=50.0, timer=False, timeout_s=0.2)
        return driver.connect(Address(f"visa:TCPIP0::meter::5025::SOCKET?library={file}@sim"), links, chosen, "adc")

    yield made
    links.close()


def test_a_meter_of_pyvisa_sim_is_read(visa: Callable[..., driver.Meter]) -> None:
    meter = visa()
    assert meter.identify().model == "Acme M1"
    assert meter.acquire(0.1).volts == pytest.approx(np.full((5, 1), 1.25))


def test_an_overload_through_visa_is_refused(visa: Callable[..., driver.Meter]) -> None:
    with pytest.raises(OverRange, match=r"vx \(input 0\)"):
        visa("+9.90000000E+37").acquire(0.04)


def test_readings_with_units_are_refused(visa: Callable[..., driver.Meter]) -> None:
    with pytest.raises(BadFrame, match=r"'READ\?' is '\+1.25E\+00 VDC', not 1 numbers.*units"):
        visa("+1.25E+00 VDC").acquire(0.04)


def test_silence_through_visa_is_a_timeout(visa: Callable[..., driver.Meter]) -> None:
    meter = visa()
    with pytest.raises(LinkTimeout, match=r"adc: no answer to '\*CLS' within 0.05 s on visa:TCPIP0::meter"):
        meter._lines.query("*CLS", 0.05)


def test_a_resource_that_is_not_there_is_refused() -> None:
    pytest.importorskip("pyvisa_py")
    with pytest.raises(LinkRefused, match=r"adc: visa:NOBUS0::1::INSTR: cannot be opened.*pyvisa-info"):
        Links(WallClock()).lines("visa:NOBUS0::1::INSTR", "adc")


def test_a_socket_where_nobody_listens_is_refused() -> None:
    pytest.importorskip("pyvisa_py")
    with pytest.raises(LinkRefused, match=r"adc: visa:TCPIP0::127.0.0.1::1::SOCKET: .*Check"):
        driver.connect(Address("visa:TCPIP0::127.0.0.1::1::SOCKET"), Links(WallClock()), driver.Settings(), "adc")


def test_without_pyvisa_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyvisa", None)
    with pytest.raises(LinkRefused, match=r"needs PyVISA.*pip install 'inertial-rig\[labs\]'"):
        Links(WallClock()).lines("visa:GPIB0::22::INSTR", "adc")


def test_an_address_of_visa_names_its_line() -> None:
    assert Url.parse("visa:TCPIP0::localhost::5025::SOCKET").line == Url.parse("tcp://127.0.0.1:5025").line
    assert Url.parse("visa:gpib0::22::INSTR").line == Url.parse("visa:GPIB0::22::INSTR").line
    assert Url.parse("visa:GPIB0::22::INSTR?library=/lib/visa.so").library == "/lib/visa.so"
    with pytest.raises(LinkRefused, match="not the address of an instrument"):
        Url.parse("visa:nothing")


def test_another_driver_does_not_open_a_visa_resource() -> None:
    with pytest.raises(LinkRefused, match="only the driver scpi_meter"):
        Links(WallClock()).link("visa:GPIB0::22::INSTR", "alpha")


def test_a_count_of_readings_that_is_no_number_is_a_bad_frame() -> None:
    """Found by fuzzing: -1e9990 is minus infinity."""
    with pytest.raises(BadFrame, match="not a number of readings"):
        scpi_answers(timer=True)(SCPI.replace(b"\n0\n4\n", b"\n-1e9990\n4\n"))


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("TRIG:TIM soon", -104), ("TRIG:TIM 0", -222), ("SAMP:TIM nan", -222), ("TRIG:TIM 1e-300", -222),
        ("TRIG:COUN", -104), ("SAMP:COUN 0", -222), ("CONF:VOLT:DC AUTO,(@101)", -104), ("CONF:VOLT:DC nan", -222),
        ("ROUT:SCAN (@101,,102)", -104), ("DATA:REM? all", -104), ("DATA:REM? -1", -222), ("TRIG 1", -113),
    ],
)  # fmt: skip
def test_the_simulated_scanner_refuses_a_line_that_it_cannot_use(small_world: Any, line: str, code: int) -> None:
    """Another program may ask it anything: it goes on, with an error in its queue."""
    scanner = Scanner(small_world, driver.Settings(channels=CHANNELS))
    assert scanner.answer(line, 0.0) is None
    scanner.answer("INIT", 0.0)
    scanner.advance(10.0)
    assert str(scanner.answer("SYST:ERR?", 10.0)).startswith(f"{code:+d},")
    assert scanner.answer("*IDN?", 10.0)
