"""What must hold of a run whatever one of its instruments does: it is complete and right, or it stops safely, says why,
and goes on to the same end once the fault is gone. Used by a sample in the tests and by the whole in the benchmark.
"""

from __future__ import annotations

import importlib
import math
import random
import zlib
from functools import cache
from typing import Any, Literal

from drivers.digital.settings import FORCES
from drivers.errors import DriverError
from drivers.transport.faults import Fault, kinds_of
from procedures.errors import ProcedureError
from procedures.level_check import reversal
from procedures.session import Dwell, Reading
from rig.bench import Bench
from rig.cli.terminal.failure import status_of
from rig.instruments.guard import NOW_AND_THEN_S
from rig.instruments.instruments import connect_all
from rig.record import KeptPose, Record
from rig.runs.runner import Outcome, resume
from tests.rig.misbehaving import (
    STRETCHES,
    Aftermath,
    afflicted,
    digest,
    guarded_bench,
    included,
    looking_on,
    short,
    watched_bench,
)
from tests.rig.rigging import ON_STAGES, Onlooker

End = Literal["complete", "stopped", "not begun"]
PROCEDURES = ON_STAGES
BENCH = watched_bench()
FAULTS = [(role, what) for role, part in BENCH.instruments.items() for what in kinds_of(part.driver)]
OUTPUTS = ["ax", "ay", "gx", "gy", "gz", "mx", "my", "mz"]
SENSOR = {"outputs": OUTPUTS, "rate_hz": 100, "most_lost": 0.05}
COLUMNS = {name: column for column, name in enumerate(["time", *OUTPUTS], 1)}
OTHER_PARTS: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {  # roles and settings of further drivers
    "imu_lines": (("adc",), {"columns": COLUMNS, "rate_hz": 100, "most_lost": 0.05}),
    "mavlink_imu": (("adc",), SENSOR),
    "xsens_mti": (("adc",), SENSOR),
    "scpi_meter": (("adc",), {"channels": {"vx": 101, "vy": 102}, "rate_hz": 10, "range_v": 10.0, "nplc": 0.02}),
    "epics_adc": (("adc",), {"channels": {"vx": "ai1", "vy": "ai2"}, "rate_hz": 20}),
    "epics_motor": (("alpha", "beta"), {"limits_deg": [-400, 400]}),
}
OTHER_FAULTS = [(driver, roles[-1], what) for driver, (roles, _) in OTHER_PARTS.items() for what in kinds_of(driver)]
NEEDS_A_GUARD = {"open-interlock"}  # felt only by a bench that has interlocks
FREE_RUNNING = {"imu_lines", "mavlink_imu", "xsens_mti"}  # a resumed run meets other samples of the same sensor
WRONG_LEVEL = {"lies", "stale"}  # read again after the first; of the second, a mean may have a part
OTHER_NOISE = {"delay", "endless", "trickle"}  # after which a run may go on, at other times: as good, but not the same
COOLING_S = 3600.0  # until a sensor that was too hot is inside its limits
NEAR_V = 5e-3  # of a dwell's mean: ten times its noise
NEAR_DIGITAL = 0.05  # of a mean in g or m/s^2
NEAR_NOISES = 8.0  # of a mean of a gyroscope or magnetometer in any unit: standard errors of a difference
NEAR = {"deg": 0.05, "s": 1.0}  # of a reading; what is done again after a lost packet happens that much later


@cache
def undisturbed(
    procedure: str, guarded: bool = False, driver: str = ""
) -> tuple[list[Any], list[KeptPose], list[Reading], float]:
    """What a procedure measures on the sound bench: its digest, poses and readings, and when it has ended."""
    with Record() as record:
        run = short(record, bench_for(guarded, driver), procedure).run
        state = record.state(run.run)
        assert run.state == "complete"
        assert state
        kept = included(record, run.run)
        return digest(record, run.run), kept, record.readings(run.run), state["rig"]["clock_s"]


@cache
def bench_for(guarded: bool, driver: str = "") -> Bench:
    """The sound bench; with a `driver` of OTHER_PARTS, its instruments are in their roles."""
    if not driver:
        return guarded_bench() if guarded else BENCH
    roles, settings = OTHER_PARTS[driver]
    document = BENCH.document()
    for role in roles:
        document["instruments"][role] = {"driver": driver, "url": "simulated", "settings": settings}
    return Bench.model_validate(document)


def moment(procedure: str, role: str, what: str, seed: int = 0, driver: str = "") -> float:
    """Some time of the run, the same for the same seed."""
    luck = random.Random(zlib.crc32(f"{procedure} {role} {what}".encode()) + seed)
    return round(luck.uniform(0.02, 0.95) * undisturbed(procedure, driver=driver)[-1], 3)


def endured(procedure: str, role: str, fault: Fault, driver: str = "", guided: bool = False) -> End:
    """Run it with the fault, and see what must hold; raises AssertionError where it does not.

    `guided`: a person is asked after the stop, resumes the run at once, and ends it if the fault is still there.
    """
    person = Onlooker(wishes=["resume"] if guided else [])
    guarded, digital = fault.what in NEEDS_A_GUARD, driver in FREE_RUNNING
    lying = (role, fault.what) == ("level", "lies")
    with Record() as record, looking_on() as aftermath:
        before = len(record.runs())
        try:
            outcome = short(record, afflicted(bench_for(guarded, driver), role, fault), procedure, person)
        except DriverError as refused:  # while the instruments said who they are
            _require_told(refused, role, driver)
            assert len(record.runs()) == before
            return "not begun"
        assert bool(person.outcomes) or outcome.error is None, "the person is asked"
        if outcome.error is None:
            _require_right(record, outcome, undisturbed(procedure, guarded, driver), digital, lying)
            return "complete"
        _require_safe(outcome, role, fault, aftermath, driver)
        hot = role == "oven" and fault.what in ("runaway", "stale")
        if hot:
            _require_true_temperatures(record, outcome, fault)
            _cool(record, outcome.run.run)
        done = resume(record, outcome.run.run, Onlooker(), bench_for(guarded, driver))
        assert (done.run.state, done.error) == ("complete", None)
        if procedure in STRETCHES:
            return "stopped"
        if hot:  # what was kept before a runaway was noticed is hotter, and says so
            assert [kept.pose for kept in included(record, done.run.run)] == [
                kept.pose for kept in undisturbed(procedure, driver=driver)[1]
            ]
            return "stopped"
        later = fault.what in OTHER_NOISE or (fault.what == "flipped-bit" and _is_resent(role, driver))
        if later or digital or (role == "level" and fault.what in WRONG_LEVEL):
            _require_right(record, done, undisturbed(procedure, guarded, driver), digital, lying)
        else:
            assert digest(record, done.run.run) == undisturbed(procedure, guarded, driver)[0], (
                "goes on as if nothing had been"
            )
    return "stopped"


def _is_resent(role: str, driver: str = "") -> bool:
    """Whether the link sends a damaged message again: it arrives later."""
    twin = importlib.import_module(f"drivers.{driver or BENCH.instruments[role].driver}.twin")
    return bool(twin.LISTEN.startswith("tcp:"))


def _require_true_temperatures(record: Record, outcome: Outcome, fault: Fault) -> None:
    """No pose counts whose temperature was read from a stuck thermometer."""
    if fault.what == "stale":
        late = [k.pose for k in included(record, outcome.run.run) if k.samples.start_s > fault.at_s + NOW_AND_THEN_S]
        assert not late, "a temperature of a stuck thermometer"


def _cool(record: Record, run: str) -> None:
    """Wait with the oven off, as the message of the limit says.

    A resumed run of the simulation begins at its last pose, as if no time had passed since.
    """
    state = record.state(run)
    assert state
    with connect_all(BENCH) as rig:
        rig.restore(state["rig"])
        rig.stop()
        rig.clock.sleep(COOLING_S)
        record.keep_state(run, state | {"rig": rig.state()})


def _require_right(
    record: Record,
    outcome: Outcome,
    expected: tuple[Any, list[KeptPose], list[Reading], float],
    digital: bool,
    lying: bool,
) -> None:
    """A run that noticed nothing has measured what an undisturbed one does, or a result of it says so.

    `lying`: the level has a constant error. The half turn removes it, so the tilts are compared.
    """
    assert outcome.run.state == "complete"
    _, sound, readings, _ = expected
    kept = included(record, outcome.run.run)
    assert [each.pose for each in kept] == [each.pose for each in sound]
    wrong = not all(_is_near(one.dwell, other.dwell, digital) for one, other in zip(kept, sound, strict=True))
    found, right = (_tilts(each) if lying else each for each in (record.readings(outcome.run.run), readings))
    values = {reading.name: reading.value for reading in found}
    same = (reading for reading in right if reading.unit in NEAR)  # not counts of lost samples
    wrong = wrong or any(abs(values[reading.name] - reading.value) > NEAR[reading.unit] for reading in same)
    marked = any(result["verdict"] == "fail" for result in outcome.run.results.values()) or outcome.run.message
    assert not wrong or marked, "a wrong number without a mark"


def _tilts(readings: list[Reading]) -> list[Reading]:
    """The readings; instead of those of the level at the front and at the back, the tilt from both."""
    values = {reading.name: reading.value for reading in readings}
    fronts = [name for name in values if name.startswith("level-front-")]
    backs = {name: name.replace("front", "back") for name in fronts}
    tilts = [Reading(name, reversal(values[name], values[backs[name]])[0], "deg") for name in fronts]
    return tilts + [reading for reading in readings if reading.name not in {*backs, *backs.values()}]


def _is_near(one: Dwell, other: Dwell, digital: bool) -> bool:
    """Whether two means of the same pose differ by no more than their noise allows."""

    def most(name: str) -> float:
        if not digital or name in FORCES:
            return NEAR_DIGITAL if digital else NEAR_V
        return NEAR_NOISES * math.hypot(one.stds[name], other.stds[name]) / math.sqrt(min(one.n, other.n))

    return all(abs(mean - other.means[name]) <= most(name) for name, mean in one.means.items())


def _require_safe(outcome: Outcome, role: str, fault: Fault, aftermath: Aftermath, driver: str) -> None:
    """All stands still, and the message helps."""
    assert outcome.error
    _require_told(outcome.error, role, driver)
    assert not aftermath.turning
    assert not aftermath.swinging or any(said.startswith("positioner may") for said in aftermath.complaints)
    assert not aftermath.heating or any(said.startswith("oven may still heat") for said in aftermath.complaints)
    assert {said.split()[0] for said in aftermath.complaints} <= {role, *_beside(role, fault, driver)}


def _require_told(error: Exception, role: str, driver: str) -> None:
    """The message names the instrument, the cause and what to do."""
    assert isinstance(error, (DriverError, ProcedureError))
    names = OTHER_PARTS[driver][0] if driver else (role,)  # instruments on one server share its faults
    assert any(name in str(error) for name in names), f"names the instrument: {error}"
    assert status_of(error) in (3, 4)
    assert str(error).count(". ") + str(error).count("; ") >= 1, "says what to do"


def _beside(role: str, fault: Fault, driver: str) -> set[str]:
    """Who else cannot be reached: noise and a lost connection are felt by all on the wire."""
    if driver:
        return set(OTHER_PARTS[driver][0])
    shared = {"alpha", "beta"}
    return shared if role in shared and fault.what in ("disconnect", "babble", "delay", "trickle") else set()
