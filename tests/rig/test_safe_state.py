"""Every limit is crossed by an instrument that misbehaves: motion stops first, the message helps, the run goes on."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.clock import SimulatedClock
from drivers.labjack_t7.driver import T7
from drivers.oriental_az.twin import Drive
from drivers.transport.faults import EFFECTS, Fault
from drivers.transport.person import PersonLink
from drivers.world.stage import Trajectory, at_rest
from procedures.errors import ProcedureError
from procedures.session import Limits
from rig.bench import read_bench
from rig.cli.terminal.failure import status_of
from rig.instruments.guard import GuardedClock
from rig.instruments.instruments import Rig
from rig.record import Record
from rig.runs.runner import resume
from tests.rig.enduring import BENCH, FAULTS, OTHER_PARTS, PROCEDURES, endured, moment, undisturbed
from tests.rig.misbehaving import Aftermath, afflicted, digest, looking_on, short
from tests.rig.rigging import Onlooker
from tests.slow import first_fast

pytestmark = pytest.mark.sockets
SAMPLE = 36  # of all that the benchmark tries
OTHERS = [  # a fault of the wire and one of its own for each further instrument
    ("imu_lines", "silence"), ("imu_lines", "wrong-baud"), ("mavlink_imu", "disconnect"), ("mavlink_imu", "mute"),
    ("xsens_mti", "garbage"), ("xsens_mti", "restart"), ("scpi_meter", "lost-answers"), ("scpi_meter", "stall"),
    ("epics_adc", "silence"), ("epics_adc", "frozen"), ("epics_motor", "disconnect"), ("epics_motor", "stuck"),
]  # fmt: skip
GUIDED = [("sweep", "beta", "alarm"), ("soak", "oven", "silence"), ("motion", "positioner", "restart")]


@pytest.fixture
def aftermath() -> Iterator[Aftermath]:
    with looking_on() as found:
        yield found


def sampled() -> list[tuple[str, str, str]]:
    """Some of (procedure, role, fault): each procedure and each kind of fault before any comes again."""
    luck = random.Random(20260101)
    everything = [(procedure, role, what) for procedure in PROCEDURES for role, what in FAULTS]
    luck.shuffle(everything)
    seen: Counter[str] = Counter()
    chosen = []
    for _ in range(SAMPLE):
        best = min(everything, key=lambda each: seen[each[0]] / len(FAULTS) + seen[f"{each[1]} {each[2]}"])
        everything.remove(best)
        seen.update([best[0], f"{best[1]} {best[2]}"])
        chosen.append(best)
    return chosen


@pytest.mark.parametrize(("procedure", "role", "what"), first_fast(sampled(), 2))
def test_a_procedure_endures_a_fault_at_a_random_moment(procedure: str, role: str, what: str) -> None:
    """`python -m tests.benchmark.faults` tries them all."""
    assert endured(procedure, role, Fault(what, at_s=moment(procedure, role, what))) in (
        "complete",
        "stopped",
        "not begun",
    )


@pytest.mark.slow
@pytest.mark.parametrize(("driver", "what"), OTHERS)
def test_a_sweep_with_another_instrument_endures_a_fault(driver: str, what: str) -> None:
    role = OTHER_PARTS[driver][0][-1]
    at_s = moment("sweep", role, what, driver=driver)
    assert endured("sweep", role, Fault(what, at_s=at_s), driver) in ("complete", "stopped", "not begun")


def test_a_stuck_axis_leaves_a_noise_floor_without_its_inclination() -> None:
    """The output is the same at +1 g and at -1 g: there is no scale factor to divide by."""
    at_s = moment("noise-floor", "adc", "stuck-axis", driver="imu_lines")
    assert endured("noise-floor", "adc", Fault("stuck-axis", at_s=at_s), "imu_lines") == "stopped"


def test_a_turn_is_resumed_with_a_tracker_that_needs_a_second_to_begin() -> None:
    """The turns before are recorded, so the tracker's first record in the resumed run is that of a turn."""
    assert endured("rate-turn", "adc", Fault("garbage", at_s=70.478), "xsens_mti") == "stopped"


def test_a_level_with_a_constant_error_gives_the_right_tilt_when_it_is_read_again() -> None:
    """The error begins between both readings and stops the run. The person resumes; the half turn removes the error."""
    assert endured("noise-floor", "level", Fault("lies", at_s=11.773), guided=True) == "complete"


@pytest.mark.slow
def test_a_run_is_resumed_when_a_sensor_that_was_too_hot_has_cooled() -> None:
    """Its last pose is at 83.4 C of 85 C: without the wait the temperature exceeds the limit again."""
    assert endured("temperature-cycle", "oven", Fault("runaway", at_s=663.845), guided=True) == "stopped"


def test_an_oven_that_restarts_in_a_soak_is_soaked_again_before_the_first_pose() -> None:
    assert endured("temperature-cycle", "oven", Fault("restart", at_s=686.367)) == "complete"


def test_poses_since_the_thermometer_stuck_are_measured_again() -> None:
    """It sticks at 37.4 C, close enough to the set point 40 C; the approach to 50 C shows it eight poses later."""
    assert endured("temperature-cycle", "oven", Fault("stale", at_s=195.393), guided=True) == "stopped"


def test_a_level_that_repeats_its_last_reading_adds_little_to_the_mean_before() -> None:
    assert endured("level-check", "level", Fault("stale", at_s=3.271)) == "stopped"


def test_a_converter_whose_segments_are_sent_again_measures_later() -> None:
    """The fault delays the end of the first record by 0.4 s: the poses after it have other noise."""
    assert endured("rate-turn", "adc", Fault("flipped-bit", at_s=21.983)) == "stopped"


@pytest.mark.slow
@pytest.mark.parametrize(("procedure", "role", "what"), GUIDED)
def test_a_guided_run_asks_when_all_is_at_rest(procedure: str, role: str, what: str) -> None:
    fault = Fault(what, at_s=moment(procedure, role, what))
    assert endured(procedure, role, fault, guided=True) in ("complete", "stopped")


LIMITS = [  # a fault of an instrument, the exit status, and what is said
    (
        "sweep",
        "alpha",
        Fault("alarm", at_s=25.0),
        3,
        "alpha: has stopped with alarm 30, overload. Remove what blocks the stage",
    ),
    ("sweep", "beta", Fault("alarm", at_s=27.0, size=0x28), 3, "the alarm needs a power cycle"),
    ("sweep", "beta", Fault("stuck", at_s=25.0), 3, "beta: is at"),
    ("sweep", "beta", Fault("lies", at_s=25.0, size=0.2), 3, "more than 0.05 deg away. Remove what blocks the stage"),
    ("sweep", "beta", Fault("busy", at_s=24.0), 3, "beta: is still moving, or not in position, after 2 s. Look"),
    (
        "sweep",
        "alpha",
        Fault("busy", at_s=26.3),
        3,
        "alpha: moved although no move was commanded. Find out what moves it",
    ),
    ("sweep", "alpha", Fault("restart", at_s=26.0), 3, "alpha: the position is unknown, so no move is allowed"),
    ("sweep", "beta", Fault("restart", at_s=33.0), 3, "beta: the position is unknown, so no move is allowed"),
    ("sweep", "alpha", Fault("silence", at_s=25.0), 3, "alpha: reading register 0x007F (driver output status): no"),
    ("sweep", "alpha", Fault("wrong-unit", at_s=25.0, size=4), 3, "unit 5 answered instead of unit 1. Give every"),
    ("sweep", "alpha", Fault("delay", at_s=25.0, size=9.0), 3, "no answer within 0.5 s"),
    ("sweep", "adc", Fault("overflow", at_s=25.0, size=7), 3, "adc: its buffer ran over and it skipped 7 scans"),
    ("sweep", "adc", Fault("buffer-full", at_s=25.0), 3, "adc: its buffer ran over and the stream stopped"),
    ("sweep", "adc", Fault("lost-packet", at_s=25.0), 3, "adc: packets are missing after packet 0 of the record"),
    ("sweep", "adc", Fault("stall", at_s=25.0), 3, "adc: the stream stopped after 0 of"),
    ("sweep", "adc", Fault("over-range", at_s=25.0), 3, "adc: vx (AIN0) was beyond its range of 10 V in 1 of 100"),
    ("sweep", "adc", Fault("restart", at_s=25.9), 3, "the connection is lost (the instrument closed it). Check"),
    ("sweep", "adc", Fault("endless", at_s=25.0), 3, "a stream is running already"),
    ("sweep", "oven", Fault("no-temperature", at_s=25.0), 3, "oven: no thermocouple is connected. Check"),
    ("sweep", "oven", Fault("lies", at_s=25.0), 4, "C, more than 10 K above its limit 85 C. Switch the heater off"),
    ("sweep", "level", Fault("stale", at_s=1.0), 3, "was received 30 times in a row. Switch the level off and on"),
    ("sweep", "level", Fault("out-of-range", at_s=1.0), 3, "level: the x axis is beyond its range of 30 deg"),
    ("sweep", "level", Fault("lies", at_s=6.0), 4, "the table is tilted by -0.4"),
    ("motion", "positioner", Fault("restart", at_s=259.5), 3, "positioner: the oscillation of x has stopped."),
    ("motion", "positioner", Fault("refuses", at_s=9.0), 3, "positioner: SVO 1 1 2 1 3 1: error 17, a value is out of"),
    ("motion", "positioner", Fault("stuck", at_s=9.0), 3, "positioner: x is at"),
    ("temperature-cycle", "oven", Fault("stale", at_s=30.0), 3, "C for 300 s while approaching 40 C. Check the"),
    ("temperature-cycle", "oven", Fault("runaway", at_s=700.0), 4, "oven: the sensor is at "),
]


@pytest.mark.parametrize(("procedure", "role", "fault", "status", "said"), LIMITS)
def test_a_run_beyond_a_limit_stops_with_a_remedy(
    procedure: str, role: str, fault: Fault, status: int, said: str, aftermath: Aftermath
) -> None:
    with Record() as record:
        outcome = short(record, afflicted(BENCH, role, fault), procedure)
        assert outcome.error
        assert said in str(outcome.error)
        assert status_of(outcome.error) == status
        assert outcome.run.state == ("stopped" if isinstance(outcome.error, ProcedureError) else "failed")
        assert outcome.run.message == str(outcome.error)
    assert aftermath.stops == 1
    assert (aftermath.turning, aftermath.swinging, aftermath.heating) == ([], [], False)


def test_a_pose_is_not_kept_where_another_program_moved_its_stage(
    monkeypatch: pytest.MonkeyPatch, aftermath: Aftermath
) -> None:
    """The drive is in position, but where the other program sent it; the resumed run measures the pose."""
    follow, acquire, drives, dwells = Drive._follow, T7.acquire_with, {}, []

    def followed(drive: Any, plan: Trajectory) -> None:
        drives[drive._axis] = drive
        follow(drive, plan)

    def acquired(*given: Any) -> Any:
        dwells.append(given)
        if len(dwells) == 3:
            follow(drives["alpha"], at_rest(drives["alpha"]._angle_deg() + 3.0))
        return acquire(*given)

    monkeypatch.setattr(Drive, "_follow", followed)
    monkeypatch.setattr(T7, "acquire_with", acquired)
    with Record() as record:
        stopped = short(record, BENCH, "sweep")
        assert "alpha: is at 93.000 deg instead of 90.000 deg" in str(stopped.error)
        assert "then `rig resume` measures this pose again" in str(stopped.error)
        assert (stopped.run.state, stopped.run.rows, status_of(stopped.error or Exception())) == ("failed", 2, 3)
        done = resume(record, stopped.run.run, Onlooker())
        assert (done.run.state, digest(record, done.run.run)) == ("complete", undisturbed("sweep")[0])
    assert aftermath.stops == 1


def test_the_sensors_own_limit_of_temperature(aftermath: Aftermath) -> None:
    """The oven's is further away."""
    bench = afflicted(BENCH, "oven", Fault("lies", at_s=25.0, size=20.0))
    with Record() as record:
        outcome = short(record, bench.model_copy(update={"limits": Limits(temperature_c=(0.0, 40.0))}), "sweep")
    assert status_of(outcome.error or Exception()) == 4
    assert "outside the limits of 0 to 40 C; wait until" in str(outcome.error)
    assert not aftermath.turning


def test_a_late_answer_is_not_taken_for_the_next_one(aftermath: Aftermath) -> None:
    """Every answer of alpha comes after its time-out: slow, but each is that to its own question."""
    with Record() as record:
        outcome = short(record, afflicted(BENCH, "alpha", Fault("delay", at_s=25.0, for_s=8.0)), "sweep")
        assert outcome.error is None
        poses = [k.pose for k in record.kept(outcome.run.run)]
        volts = [k.dwell.means["vx"] for k in record.kept(outcome.run.run)]
        assert poses == [entry[0] for entry in undisturbed("sweep")[0][: len(poses)]]
    with Record() as record:
        sound = [k.dwell.means["vx"] for k in record.kept(short(record, BENCH, "sweep").run.run)]
    assert volts == pytest.approx(sound, abs=2e-3)


class Mover:
    """Writes down what it is told; fails at `fails`."""

    def __init__(self, name: str, log: list[str], fails: str = "") -> None:
        self.name, self._log, self._fails = name, log, fails

    def _told(self, what: str) -> None:
        self._log.append(f"{self.name} {what}")
        if what == self._fails:
            raise ZeroDivisionError(f"{self.name}: whatever it is")

    def halt(self) -> None:
        self._told("halt")

    def stop(self) -> None:
        self._told("stop")

    def run(self, on: bool) -> None:
        self._told(f"run {on}")


def test_all_instruments_get_the_stop_command_before_the_first_wait() -> None:
    log: list[str] = []
    movers: dict[str, Any] = {"alpha": Mover("alpha", log, "halt"), "beta": Mover("beta", log, "stop")}
    clock = GuardedClock(SimulatedClock())
    rig = Rig(BENCH, movers | {"oven": Mover("oven", log, "run False")}, clock, None, (), PersonLink())
    assert rig.stop() == [
        (
            "beta may still move: press the emergency stop, or switch its drive off. "
            "The command to stop failed: whatever it is"
        ),
        "oven may still heat: switch it off by hand. The command to stop failed: whatever it is",
    ]
    assert log == ["alpha halt", "beta halt", "alpha stop", "beta stop", "oven run False"]


def test_a_run_switches_off_the_stop_inputs_that_an_earlier_one_left_on() -> None:
    """Only on real instruments: a simulated bench begins with new ones, and an exchange would move its samples."""
    held: Any = SimpleNamespace(name="alpha", release=lambda: True)
    free: Any = SimpleNamespace(name="beta", release=lambda: False)
    movers = {"alpha": held, "beta": free, "positioner": SimpleNamespace(name="positioner")}
    real = BENCH.instruments["alpha"].model_copy(update={"url": "serial:/dev/ttyUSB0"})
    bench = BENCH.model_copy(update={"instruments": {**BENCH.instruments, "alpha": real}})
    clock = GuardedClock(SimulatedClock())
    told = [Rig(each, movers, clock, None, (), PersonLink()).release() for each in (bench, BENCH)]
    assert told == [["alpha: the stop input was still on from an earlier stop; it is off now"], []]


def test_the_configuration_of_a_run_does_not_include_faults() -> None:
    bench = read_bench()
    broken = afflicted(bench, "alpha", Fault("alarm", at_s=3.0))
    assert broken.configuration("sweep", {}) == bench.configuration("sweep", {})
    assert broken.document()["instruments"]["alpha"]["faults"][0]["what"] == "alarm"  # the record tells


def test_every_kind_of_fault_is_known_to_the_benchmark() -> None:
    assert set(EFFECTS) <= {what for _, what in FAULTS}
    assert len({what for _, what in FAULTS}) > len(EFFECTS)
    with pytest.raises(ValueError, match="must not be negative"):
        replace(Fault("alarm"), at_s=-1.0)
