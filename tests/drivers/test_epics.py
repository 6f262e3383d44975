"""EPICS motors and analog records, on their twins."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from drivers.clock import SimulatedClock, WallClock
from drivers.epics_adc import driver as adc_driver
from drivers.epics_adc import twin as adc_twin
from drivers.epics_motor import driver as motor_driver
from drivers.epics_motor import twin as motor_twin
from drivers.errors import (
    BadFrame,
    DriverError,
    Interlocked,
    LimitError,
    LinkRefused,
    LinkTimeout,
    NotSettled,
    SensorFault,
    StageAlarm,
    StreamError,
)
from drivers.transport import Address, Links
from drivers.transport.address import Url
from drivers.transport.channel_access import FieldReading
from drivers.transport.channel_access_server import Field, records_port
from drivers.transport.faults import Fault, faults_of
from drivers.transport.server import Port, Server
from tests.fuzz.labs import SAID, ca_answer

CHANNELS = {"time": "ai1", "supply": "ai2"}


class Bench:
    """Instruments on their twins in the small world."""

    def __init__(self, world: Any) -> None:
        self.world, self.clock = world, SimulatedClock()
        self.links = Links(self.clock)
        self.servers: list[Server] = []

    def serve(self, server: Server) -> Server:
        self.servers.append(server)
        self.clock.attach(server)
        return server

    def motor(self, fault: Fault | None = None, **settings: Any) -> motor_driver.MotorRecord:
        """A stage; `fault` begins once it is connected."""
        chosen = motor_driver.Settings(**{"timeout_s": 1.0} | settings)
        server = self.serve(motor_twin.serve(self.world, {"beta": (1, chosen)}))
        motor = motor_driver.connect(server.addresses["beta"], self.links, chosen, "beta")
        if fault:
            server.afflict("beta", faults_of("epics_motor", [fault]))
        return motor

    def adc(self, fault: Fault | None = None, **settings: Any) -> adc_driver.AnalogRecords:
        """A converter; `fault` begins once it is connected."""
        chosen = adc_driver.Settings(**{"channels": CHANNELS, "rate_hz": 20.0, "timeout_s": 1.0} | settings)
        server = self.serve(adc_twin.serve(self.world, {"adc": (1, chosen)}))
        adc = adc_driver.connect(server.addresses["adc"], self.links, chosen, "adc")
        if fault:
            server.afflict("adc", faults_of("epics_adc", [fault]))
        return adc

    def record(self, motor: motor_driver.MotorRecord, **fields: float) -> None:
        """Set fields of the twin's record, as another client would."""
        twin = self.servers[0]._twins["beta"]
        twin._fields |= {f".{name}": value for name, value in fields.items()}  # type: ignore[attr-defined]


@pytest.fixture
def bench(small_world: Any) -> Iterator[Bench]:
    bench = Bench(small_world)
    yield bench
    bench.links.close()
    for server in bench.servers:
        server.close()


# Motors.


def test_a_motor_moves_to_an_angle_and_stands_there(bench: Bench) -> None:
    motor = bench.motor(speed_deg_s=20.0, acceleration_deg_s2=40.0)
    motor.move_to(90.0)
    assert bench.world.motor_angle_deg("beta") == pytest.approx(90.0)
    assert bench.clock.now() == pytest.approx(90 / 20 + 20 / 40, abs=0.1)
    motor.require_steady()


def test_units_of_the_record_are_converted(bench: Bench) -> None:
    motor = bench.motor(deg_per_unit=-0.5)
    motor.move_to(10.0)
    assert bench.world.motor_angle_deg("beta") == pytest.approx(-20.0)
    assert motor.angle_deg() == pytest.approx(10.0)


def test_a_motor_turns_at_the_wanted_rate(bench: Bench) -> None:
    motor = bench.motor()
    with motor.turning(5.0, 0.0, 60.0) as turn:
        rates = []
        for _ in range(12):
            before = motor.angle_deg()
            bench.clock.sleep(1.0)
            turn.require()
            rates.append(motor.angle_deg() - before)
    assert rates == pytest.approx([5.0] * 12, abs=0.05)
    assert motor.angle_deg() > 60


def test_homing_sets_the_reference(bench: Bench) -> None:
    motor = bench.motor(home="forward")
    assert not motor.referenced()
    motor.home()
    assert motor.referenced()


def test_a_stop_brakes_at_once(bench: Bench) -> None:
    motor = bench.motor()
    motor.start(90.0)
    bench.clock.sleep(2.0)
    motor.stop()
    angle = motor.angle_deg()
    bench.clock.sleep(5.0)
    assert 10 < angle < 25
    assert motor.angle_deg() == angle


MOTOR_FAILURES = [
    (Fault("severity"), {}, StageAlarm, r"sim:beta has the alarm INVALID \(COMM\)\. Find its cause in the IOC"),
    (Fault("severity", size=2), {}, StageAlarm, r"alarm MAJOR"),
    (Fault("status"), {}, StageAlarm, r"the driver has stopped polling the controller \(MSTA is 0x200\)"),
    (Fault("status", at_s=2, size=0x1000), {}, StageAlarm, r"does not reach the controller.*power and cable"),
    (Fault("limit-switch", at_s=2), {}, StageAlarm, r"is at its high limit switch \(HLS\).*away from the switch"),
    (Fault("stopped", at_s=2), {}, Interlocked, r"in the mode Stop \(SPMG\), and does not move.*set SPMG to Go"),
    (Fault("stuck"), {}, NotSettled, r"is at 0\.000 deg instead of 90\.000 deg.*Remove what blocks the stage"),
    (Fault("busy"), {}, NotSettled, r"is still moving 10 s after the end was due \(DMOV is 0\)"),
    (Fault("silence", at_s=2), {}, LinkTimeout, r"no answer to sim:beta\.RBV within 1 s on tcp://.*IOC runs"),
    (Fault("disconnect", at_s=2), {}, LinkRefused, r"beta: tcp://.*the connection is lost.*Check cable"),
    (Fault("garbage"), {}, DriverError, r"beta: .*(not Channel Access|no answer)"),
    (
        None,
        {"limits_deg": (-10.0, 80.0)},
        LimitError,
        r"90 deg is outside its limits -10 \.\. 80 deg; nothing was sent",
    ),
]


@pytest.mark.parametrize(("fault", "settings", "error", "told"), MOTOR_FAILURES, ids=range(len(MOTOR_FAILURES)))
def test_a_failure_of_a_motor_says_what_where_and_what_to_do(
    bench: Bench, fault: Fault | None, settings: dict[str, Any], error: type[DriverError], told: str
) -> None:
    motor = bench.motor(fault, **settings)
    with pytest.raises(error, match=told) as raised:
        motor.move_to(90.0)
    assert str(raised.value).startswith("beta: ")


@pytest.mark.parametrize(
    ("fields", "error", "told"),
    [
        (
            {"HLM": 45.0},
            LimitError,
            r"90 deg is outside the record's own limits, -400 \.\. 45 deg \(LLM, HLM\); nothing",
        ),
        ({"SET": 1.0}, Interlocked, r"in the mode Set \(SET\): a target would redefine its position.*Set it to Use"),
    ],
)
def test_what_the_record_does_not_allow_is_not_sent(
    bench: Bench, fields: dict[str, float], error: type[DriverError], told: str
) -> None:
    motor = bench.motor()
    bench.record(motor, **fields)
    with pytest.raises(error, match=told):
        motor.move_to(90.0)
    bench.clock.sleep(5.0)
    assert motor.angle_deg() == 0.0


def test_equal_limits_of_the_record_are_none(bench: Bench) -> None:
    motor = bench.motor()
    bench.record(motor, LLM=0.0, HLM=0.0)
    motor.move_to(90.0)


def test_a_motor_that_another_client_moves_is_noticed(bench: Bench) -> None:
    motor = bench.motor()
    motor.move_to(10.0)
    bench.servers[0]._twins["beta"].put("sim:beta.VAL", 20.0, bench.clock.now())  # type: ignore[attr-defined]
    with pytest.raises(NotSettled, match="moved although no move was commanded"):
        motor.require_steady()
    bench.clock.sleep(5.0)
    with pytest.raises(NotSettled, match=r"is at 20\.000 deg instead of 10\.000 deg.*another client"):
        motor.require_steady()


def test_a_turn_that_is_held_is_noticed_and_stopped(bench: Bench) -> None:
    motor = bench.motor(Fault("limit-switch", at_s=10.0))

    def watched() -> None:
        with motor.turning(5.0, 0.0, 90.0) as turn:
            for _ in range(20):
                bench.clock.sleep(1.0)
                turn.require()

    with pytest.raises(StageAlarm, match="limit switch"):
        watched()
    angle = motor.angle_deg()
    bench.clock.sleep(5.0)
    assert motor.angle_deg() == angle < 60


def test_after_a_lost_connection_it_can_be_stopped(bench: Bench) -> None:
    motor = bench.motor(Fault("disconnect", at_s=1.0, for_s=0.5))
    motor.start(90.0)
    bench.clock.sleep(1.2)
    with pytest.raises(LinkRefused):
        motor.look()
    bench.clock.sleep(0.5)
    motor.stop()
    assert 5 < motor.angle_deg() < 30


# Analog records.


def test_a_record_has_the_channels_at_the_rate(bench: Bench) -> None:
    samples = bench.adc().acquire(2.0)
    assert samples.channels == ("time", "supply")
    assert samples.volts.shape == (40, 2)
    np.testing.assert_allclose(samples.volts[:, 1], 5.0)
    np.testing.assert_allclose(np.diff(samples.volts[:, 0]) / 0.01, 0.05, atol=1e-6)
    assert samples.volts[0, 0] / 0.01 == pytest.approx(samples.start_s, abs=0.01)


def test_a_long_record_comes_in_blocks_without_a_gap(bench: Bench) -> None:
    blocks = list(bench.adc().stream(6.0, 2.5))
    assert [len(block.volts) for block in blocks] == [50, 50, 20]
    np.testing.assert_allclose(np.diff(np.concatenate([b.volts[:, 0] for b in blocks])), 0.0005, atol=1e-8)


def test_only_some_outputs_are_read(bench: Bench) -> None:
    adc = bench.adc(volts_per_unit=1e-3)
    assert adc.only("supply").acquire(0.5).volts == pytest.approx(5e-3)
    with pytest.raises(LimitError, match=r"adc: no input is wired to mx"):
        adc.only("mx")


ADC_FAILURES = [
    (Fault("severity"), SensorFault, r"time \(sim:ai1\) has the alarm INVALID \(READ\).*set highest_severity"),
    (
        Fault("frozen", at_s=0.5),
        StreamError,
        r"had a new time stamp in 1\d of 40 .* about \d\.?\d* times a second.*SCAN",
    ),
    (
        Fault("frozen", at_s=1.86),
        StreamError,
        r"\(sim:ai1\) kept its time stamp for more than 1\.5 periods of .* stopped processing it\. Check the IOC",
    ),
    (Fault("silence"), LinkTimeout, r"adc: no answer to sim:ai1 within 1 s on tcp://"),
    (Fault("disconnect", at_s=0.5), LinkRefused, r"adc: tcp://.*connection is lost"),
    (Fault("delay", size=0.4), StreamError, r"scan 1 is 0\.\d+ s late"),
]


@pytest.mark.parametrize(("fault", "error", "told"), ADC_FAILURES, ids=range(len(ADC_FAILURES)))
def test_a_failure_of_a_converter_says_what_where_and_what_to_do(
    bench: Bench, fault: Fault, error: type[DriverError], told: str
) -> None:
    with pytest.raises(error, match=told) as raised:
        bench.adc(fault).acquire(2.0)
    assert str(raised.value).startswith("adc: ")


@pytest.mark.parametrize("scans", [1, 2, 200])
def test_records_that_stopped_are_noticed_in_the_next_dwell_of_any_length(bench: Bench, scans: int) -> None:
    adc = bench.adc(Fault("frozen", at_s=12.0))
    adc.acquire(scans / 20)
    bench.clock.sleep(13.0)
    with pytest.raises(StreamError, match=r"the IOC (stopped processing|processes) it"):
        adc.acquire(scans / 20)


def test_a_reading_that_is_repeated_once_is_no_failure(bench: Bench) -> None:
    """The clocks of the rig and of the IOC differ a little."""
    adc = bench.adc(Fault("frozen", at_s=4.91, for_s=0.05))
    time_s = adc.acquire(10.0).volts[:, 0] / 0.01
    assert np.count_nonzero(np.diff(time_s) == 0) == 1


@pytest.mark.parametrize(("at_s", "for_s"), [(9.86, 60.0), (4.0, 0.3)])
def test_a_few_old_readings_in_a_long_dwell_are_a_failure(bench: Bench, at_s: float, for_s: float) -> None:
    with pytest.raises(StreamError, match="stopped processing it"):
        bench.adc(Fault("frozen", at_s=at_s, for_s=for_s)).acquire(10.0)


def test_an_alarm_that_the_bench_file_allows_is_no_failure(bench: Bench) -> None:
    assert len(bench.adc(Fault("severity", size=2), highest_severity="major").acquire(1.0).volts) == 20
    assert bench.motor(Fault("severity", size=1)).self_test()[0].ok


def test_records_that_are_not_there_are_named(bench: Bench) -> None:
    server = bench.serve(adc_twin.serve(bench.world, {"adc": (1, adc_driver.Settings(CHANNELS))}))
    other = adc_driver.Settings({"vx": "ai1", "vy": "nothing"}, timeout_s=1.0)
    with pytest.raises(LinkRefused, match=r"adc: the server tcp://127.* has no sim:nothing\. Check the name"):
        adc_driver.connect(server.addresses["adc"], bench.links, other, "adc")
    at = Address(server.addresses["adc"].url + "ai1")
    with pytest.raises(LinkRefused, match=r"has no sim:ai1\.VAL, and 15 more are not there\. Check"):
        motor_driver.connect(at, bench.links, motor_driver.Settings(timeout_s=1.0), "beta")


class Millimetres:
    """A host of one record whose units are mm."""

    def has(self, name: str) -> bool:
        return name.startswith("sim:x")

    def field(self, name: str, now_s: float) -> Field:
        return Field(1.0, now_s, units="mm")

    def put(self, name: str, value: float, now_s: float) -> None:
        raise AssertionError("nothing is written")


def test_units_that_cannot_be_are_refused(bench: Bench) -> None:
    port = records_port("tcp://127.0.0.1:0", [Millimetres()])
    bench.serve(Server([port], {}, {}))
    at = Address(f"ca://{port.url.removeprefix('tcp://')}/sim:x")
    with pytest.raises(
        LimitError, match=r"the units of sim:x are 'mm' \(EGU\), which is not an angle.*set deg_per_unit"
    ):
        motor_driver.connect(at, bench.links, motor_driver.Settings(), "beta")
    with pytest.raises(LimitError, match=r"units of sim:xai1 are 'mm' \(EGU\), not a voltage.*volts_per_unit"):
        adc_driver.connect(at, bench.links, adc_driver.Settings(), "adc")


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: motor_driver.Settings(deg_per_unit=0.0), "deg_per_unit must not be 0"),
        (lambda: motor_driver.Settings(speed_deg_s=50.0), "speed_deg_s must be at most speed_limit_deg_s, 30"),
        (lambda: motor_driver.Settings(limits_deg=(1.0, 0.0)), "limits_deg must be"),
        (lambda: adc_driver.Settings({}), "channels must name records"),
        (lambda: adc_driver.Settings({"vx": "a"}, {"vx": "b"}), "vx is a channel already"),
    ],
)
def test_settings_that_cannot_be_are_refused(make: Callable[[], object], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        make()


def test_an_address_of_epics_names_its_record() -> None:
    found, known = Url.parse("ca:13IDC:m1"), Url.parse("ca://10.0.0.7:5066/13IDC:m1")
    assert (found.record, found.host, known.record, known.host, known.port) == (
        "13IDC:m1", "", "13IDC:m1", "10.0.0.7", 5066,
    )  # fmt: skip
    assert found.line == known.line
    assert Url.parse("ca:XF:23ID1-ES{Dif-Ax:Th}Mtr").record == "XF:23ID1-ES{Dif-Ax:Th}Mtr"
    with pytest.raises(LinkRefused, match="only the drivers epics_motor and epics_adc"):
        Links(WallClock()).link("ca:13IDC:m1", "alpha")
    with pytest.raises(LinkRefused, match=r"is not an EPICS address.*Write ca:NAME"):
        motor_driver.connect(Address("tcp://127.0.0.1:5064"), Links(WallClock()), motor_driver.Settings(), "alpha")


def test_a_server_that_speaks_no_channel_access_is_refused(bench: Bench) -> None:
    port = Port(
        "tcp://127.0.0.1:0", lambda connection, now_s: connection.send(b"HTTP/1.1 400 Bad Request\r\n\r\n", now_s)
    )
    bench.serve(Server([port], {}, {}))
    at = Address(f"ca://{port.url.removeprefix('tcp://')}/sim:x")
    with pytest.raises((BadFrame, LinkTimeout), match=r"beta: .*(not Channel Access|no answer)"):
        motor_driver.connect(at, bench.links, motor_driver.Settings(timeout_s=0.5), "beta")


def test_without_caproto_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "caproto", None)
    with pytest.raises(LinkRefused, match=r"needs caproto.*pip install 'inertial-rig\[labs\]'"):
        motor_driver.connect(Address("ca:13IDC:m1"), Links(WallClock()), motor_driver.Settings(), "alpha")


def test_a_status_that_the_protocol_does_not_have_is_a_bad_frame() -> None:
    """Of the answer to a reading: a header of 16 bytes, whose third number is the status."""
    answer = SAID[2]
    assert answer[:2] == b"\0\x0f"
    with pytest.raises(BadFrame, match="cannot be read as Channel Access"):
        ca_answer(b"".join([*SAID[:2], answer[:8] + b"\0\0\xff\xff" + answer[12:], *SAID[3:]]))


def test_an_alarm_without_a_name_is_its_number() -> None:
    assert FieldReading(2.5, 3, 9, 0.0).alarm == "INVALID (COMM)"
    assert FieldReading(2.5, 77, 9, 0.0).alarm == "77 (COMM)"
