"""The simulated T7: registers as the map has them, and records that tell when each scan was taken."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from drivers.clock import SimulatedClock
from drivers.errors import Interlocked, OverRange, Refused
from drivers.instrument import Check
from drivers.labjack_t7 import driver as labjack_t7
from drivers.labjack_t7 import registers as t7
from drivers.labjack_t7 import twin as labjack_t7_twin
from drivers.labjack_t7.driver import Settings
from drivers.transport import Links
from drivers.transport.faults import Fault, faults_of
from tests.drivers.conftest import bytes_exchanged
from tests.drivers.digital import connected

STEP_V = 3.2e-4  # one code in the range of 10 V


@pytest.fixture
def ask(small_world: Any) -> Iterator[Callable[[str], str]]:
    clock = SimulatedClock()
    server = labjack_t7_twin.serve(small_world, {"adc": (1, Settings(channels={"supply": 5}))})
    with bytes_exchanged(server, clock) as exchange:
        yield exchange


@pytest.mark.parametrize(
    ("address", "value"),
    [("D7 3C", "00 11 22 33"), ("EA 60", "40 E0 00 00"), ("9C 40", "41 20 00 00")],
    ids=["TEST", "PRODUCT_ID", "AIN0_RANGE"],
)
def test_registers_after_power_on(ask: Callable[[str], str], address: str, value: str) -> None:
    assert ask(f"00 07 00 00 00 06 01 03 {address} 00 02") == f"00 07 00 00 00 07 01 03 04 {value}"


def test_a_register_that_it_has_not_is_exception_2(ask: Callable[[str], str]) -> None:
    assert ask("00 01 00 00 00 06 01 03 C3 50 00 01") == "00 01 00 00 00 03 01 83 02"


def test_an_open_input_reads_nothing_and_a_wired_one_what_the_world_has(ask: Callable[[str], str]) -> None:
    answer = bytes.fromhex(ask("00 01 00 00 00 06 01 04 00 08 00 04"))
    open_v, supply_v = np.frombuffer(answer[9:], ">f4")
    assert open_v == pytest.approx(0.0, abs=STEP_V)
    assert supply_v == pytest.approx(5.0, abs=STEP_V)


def test_every_scan_is_taken_at_its_time(bench: Any) -> None:
    samples = bench.adc.acquire(5.0)
    expected = samples.start_s + np.arange(5000) / samples.rate_hz
    assert samples.volts.shape == (5000, 3)
    np.testing.assert_allclose(samples.volts[:, 0], 0.01 * expected, atol=STEP_V)
    np.testing.assert_allclose(samples.volts[:, 2], 5.0, atol=STEP_V)


def test_a_record_lasts_as_long_as_it_is_asked_for(bench: Any) -> None:
    before = bench.clock.now()
    bench.adc.acquire(5.0)
    assert 5.0 <= bench.clock.now() - before < 5.05


@pytest.mark.parametrize("duration_s", [0.001, 0.17, 0.171, 1.0, 12.3456])
def test_any_duration_gives_whole_scans(bench: Any, duration_s: float) -> None:
    assert bench.adc.acquire(duration_s).volts.shape == (max(1, round(duration_s * 1000)), 3)


@pytest.mark.parametrize("duration_s", [0.001, 0.005, 5.0])
def test_something_else_is_read_in_the_middle_of_a_record(bench: Any, duration_s: float) -> None:
    before = bench.clock.now()
    samples, read_s = bench.adc.acquire_with(duration_s, bench.clock.now)
    expected = samples.start_s + np.arange(round(1000 * duration_s)) / samples.rate_hz
    np.testing.assert_allclose(samples.volts[:, 0], 0.01 * expected, atol=STEP_V)
    assert before + duration_s / 2 <= read_s <= before + duration_s / 2 + 0.05


def test_records_follow_each_other_without_remains(bench: Any) -> None:
    first, second = bench.adc.acquire(0.5), bench.adc.acquire(0.5)
    assert second.start_s > first.start_s + 0.5
    assert second.volts[0, 0] == pytest.approx(0.01 * second.start_s, abs=STEP_V)


def test_a_stage_may_be_asked_while_the_stream_runs(bench: Any) -> None:
    """The samples up to now are taken before the world sees the exchange: time never goes back."""
    bench.alpha.home()
    unit = bench.adc._unit
    bench.adc._configure(300)
    unit.write(t7.ENABLE, 1)
    for _ in range(5):
        bench.clock.sleep(0.0437)
        bench.alpha.angle_deg()
    unit.write(t7.ENABLE, 0)
    assert len(bench.adc._stream.read(0.0)) == 2 * (16 + 600)


def test_a_stream_of_a_dead_program_is_ended(bench: Any) -> None:
    bench.adc._unit.write_block((t7.SCAN_RATE, 1000.0), (t7.NUM_ADDRESSES, 1))
    bench.adc._unit.write(t7.SAMPLES_PER_PACKET, 10)
    bench.adc._unit.write(t7.ENABLE, 1)
    heir = labjack_t7.connect(bench.servers["adc"].addresses["adc"], Links(bench.clock), bench.adc.settings, "adc")
    assert heir.acquire(0.1).volts.shape == (100, 3)
    assert len(heir._stream.read(0.0)) == 0


def test_no_input_is_read_while_the_stream_runs(bench: Any) -> None:
    bench.adc._configure(300)
    bench.adc._unit.write(t7.ENABLE, 1)
    with pytest.raises(Refused, match="exception 4"):
        bench.adc._unit.read(t7.ain(0))
    assert bench.adc._unit.read(t7.LAST_ERROR) == 2605


@pytest.mark.parametrize(
    ("register", "value", "detail"),
    [("SCAN_RATE", 40000.0, 2608), ("SAMPLES_PER_PACKET", 513, 2618), ("BUFFER_SIZE", 1000, 2615)],
)
def test_what_is_not_possible_is_declined_with_its_reason(bench: Any, register: str, value: float, detail: int) -> None:
    bench.adc._configure(300)
    bench.adc._unit.write(getattr(t7, register), value)
    with pytest.raises(Refused, match=f"device error {detail}"):
        bench.adc._write_block((t7.ENABLE, 1))
    assert bench.adc._unit.read(t7.ENABLE) == 0


def test_a_narrow_range_is_finer_and_clips(small_world: Any) -> None:
    """Beyond its end 5 V would be 1.01 V: no number at all is better."""
    settings = Settings(channels={"supply": 5, "noise": 0}, range_v=1.0)
    clock, server = SimulatedClock(), labjack_t7_twin.serve(small_world, {"adc": (1, settings)})
    clock.attach(server)
    links = Links(clock)
    adc = labjack_t7.connect(server.addresses["adc"], links, settings, "adc")
    with pytest.raises(
        OverRange, match=r"adc: supply \(AIN5\) was beyond its range of 1 V in 100 of 100 samples. Check"
    ):
        adc.acquire(0.1)
    quiet = labjack_t7.connect(server.addresses["adc"], links, replace(settings, channels={"noise": 0}), "adc")
    assert np.diff(np.unique(quiet.acquire(0.1).volts)).min() == pytest.approx(STEP_V / 10, rel=0.05)
    links.close()
    server.close()


def test_a_digital_line_switches_the_sensors_power(bench: Any) -> None:
    bench.adc.power(False)
    assert not bench.world.powered
    bench.adc.power(True)
    assert bench.world.powered


def test_the_twin_identifies_itself_and_passes_its_test(bench: Any) -> None:
    identity = bench.adc.identify()
    assert (identity.model, identity.serial) == ("LabJack T7", str(labjack_t7_twin.SERIAL))
    assert all(check.ok for check in bench.adc.self_test())


GUARDED = Settings(channels={"supply": 5}, power_dio=3, interlocks={"e-stop": 4, "door": 7})


@pytest.fixture
def guarded(small_world: Any) -> Iterator[Callable[..., labjack_t7.T7]]:
    """A converter with interlocks, which has faults."""
    with ExitStack() as opened:

        def make(*faults: Fault) -> labjack_t7.T7:
            converter, server, _ = opened.enter_context(connected("labjack_t7", small_world, GUARDED, "adc"))
            server.afflict("adc", faults_of("labjack_t7", faults))
            return converter

        yield make


def test_interlocks_are_closed_whatever_else_is_switched(guarded: Callable[..., labjack_t7.T7]) -> None:
    converter = guarded()
    for on in (False, True):
        converter.power(on)
        converter.look()
    assert converter.self_test()[-1] == Check("interlocks", True, "closed")


def test_an_open_interlock_is_named_with_its_line(guarded: Callable[..., labjack_t7.T7]) -> None:
    converter = guarded(Fault("open-interlock", size=7))
    with pytest.raises(Interlocked, match=r"adc: the interlock door \(DIO7\) is open. Release the emergency stop"):
        converter.look()
    assert converter.self_test()[-1] == Check("interlocks", False, "open: door")


def test_a_line_of_no_interlock_is_not_looked_at(guarded: Callable[..., labjack_t7.T7]) -> None:
    guarded(Fault("open-interlock", size=9)).look()


@pytest.mark.parametrize("lines", [{"a": 23}, {"a": -1}, {"a": 3}, {"a": 4, "b": 4}])
def test_a_line_that_cannot_be_an_interlock_is_refused(lines: dict[str, int]) -> None:
    with pytest.raises(ValueError, match="interlocks must be digital lines, 0 to 22, each with one purpose"):
        Settings(power_dio=3, interlocks=lines)
