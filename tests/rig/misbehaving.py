"""Runs on a bench whose simulated instruments misbehave: how they end, and what the world is like afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any
from unittest.mock import patch

from drivers.transport.faults import Fault
from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import Bench, read_bench
from rig.instruments.instruments import Rig
from rig.record import KeptPose, Record
from rig.runs.runner import Outcome, start
from tests.rig.rigging import Onlooker

STAGES = ("alpha", "beta")
STRETCHES = {"noise-floor", "soak", "motion"}  # record without a gap: where the run goes on, a new one begins
LONGEST_STOP_S = 1.5  # a stage brakes in half a second, and by itself a second after its controller fell silent
SHORT: dict[str, dict[str, str]] = {  # settings with which a procedure is short
    "sweep": {"dwell_s": "0.2", "step_deg": "180", "inclinations_deg": "90,45"},
    "noise-floor": {"duration_s": "3", "block_s": "1", "dwell_s": "0.2", "settle_s": "0.1"},
    "misalignment": {"dwell_s": "0.2", "most_rounds": "1"},
    "temperature-cycle": {"dwell_s": "0.2", "temperatures_c": "40,50", "soak_s": "600"},
    "soak": {"duration_s": "400", "interval_s": "200", "block_s": "20", "dwell_s": "0.2", "settle_s": "0.1"},
    "motion": {"duration_s": "4", "still_s": "4", "block_s": "2", "dwell_s": "0.1", "settle_s": "0"},
    "magnetometer-turn": {"step_deg": "45", "mounts": "1", "over": "false", "dwell_s": "0.2", "settle_s": "0.1"},
    "rate-turn": {"rates_deg_s": "40", "mounts": "1", "turn_deg": "90", "rest_s": "1"},
    "repeat": {"times": "2", "dwell_s": "0.2", "power": "false", "mount": "false"},
}


def watched_bench() -> Bench:
    """The simulated rig; its stages watch over their controller."""
    bench = read_bench()
    watched = {
        role: bench.instruments[role].model_copy(
            update={"settings": bench.instruments[role].settings | {"communication_timeout_s": 1.0}}
        )
        for role in STAGES
    }
    return bench.model_copy(update={"instruments": {**bench.instruments, **watched}})


def guarded_bench(bench: Bench | None = None) -> Bench:
    """The same, or `bench`, with an emergency stop and a door at lines of the converter."""
    bench = bench or watched_bench()
    adc = bench.instruments["adc"]
    guarded = adc.model_copy(update={"settings": adc.settings | {"interlocks": {"e-stop": 4, "door": 5}}})
    return bench.model_copy(update={"instruments": {**bench.instruments, "adc": guarded}})


def afflicted(bench: Bench, role: str, *faults: Fault) -> Bench:
    """The bench with faults of one instrument."""
    part = bench.instruments[role].model_copy(update={"faults": faults})
    return bench.model_copy(update={"instruments": {**bench.instruments, role: part}})


def short(record: Record, bench: Bench, name: str, onlooker: Onlooker | None = None, **settings: str) -> Outcome:
    """A short run of a procedure."""
    procedure = find(name)
    return start(record, bench, procedure, parse(procedure, SHORT.get(name, {}) | settings), onlooker or Onlooker())


def digest(record: Record, run: str) -> list[Any]:
    """All that was measured, comparable bit for bit."""
    poses = included(record, run)
    kept = [(k.pose, k.samples.volts.tobytes(), k.samples.start_s, k.t_s, k.temperature_c) for k in poses]
    return [*kept, *record.readings(run)]


def included(record: Record, run: str) -> list[KeptPose]:
    """The poses of a run without the excluded ones."""
    return [kept for kept in record.kept(run) if kept.excluded is None]


@dataclass
class Aftermath:
    """The world after each stop of a run: what turned, what swung, what heated; and what could not be stopped."""

    turning: list[str] = field(default_factory=list)
    swinging: list[str] = field(default_factory=list)
    heating: bool = False
    complaints: list[str] = field(default_factory=list)
    stops: int = 0

    def look(self, rig: Rig) -> None:
        """Wait until all must be at rest, then look twice."""
        assert rig.world
        rig.clock.sleep(LONGEST_STOP_S)
        before = self._places(rig)
        rig.clock.sleep(0.33)
        moved = {name: abs(place - before[name]) for name, place in self._places(rig).items()}
        self.turning += [name for name in STAGES if moved[name] > 0]
        self.swinging += [name for name in ("x", "y", "z") if moved[name] > 0.1]
        self.heating |= bool(rig.world.state()["world"]["warmth"]["oven_running"])

    def _places(self, rig: Rig) -> dict[str, float]:
        assert rig.world
        rig.world.advance(max(rig.world.now_s, rig.clock.now()))
        places = {name: rig.world.motor_angle_deg(name) for name in STAGES}
        return places | {name: float(rig.world.positioner_um(name)[0]) for name in ("x", "y", "z")}


@contextmanager
def looking_on() -> Iterator[Aftermath]:
    """Inside, the world is looked at after every stop."""
    aftermath, stop = Aftermath(), Rig.stop

    def stopped(rig: Rig) -> list[str]:
        aftermath.stops += 1
        complaints = stop(rig)
        aftermath.complaints += complaints
        aftermath.look(rig)
        return complaints

    with patch.object(Rig, "stop", stopped):
        yield aftermath
