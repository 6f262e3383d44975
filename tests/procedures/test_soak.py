"""What a soak tells its instruments, in which order, and what a run that goes on does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import pytest

from drivers.errors import LimitError
from drivers.recorder import Samples
from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.errors import SafetyLimit, SettingError
from procedures.session import Dwell, Limits
from procedures.soak import POWER_ON, schedule, soak
from tests.procedures.bench import Adc, Book, Oven, session

SHORT = {"duration_s": 16.0, "interval_s": 4.0, "block_s": 1.0, "dwell_s": 0.1, "settle_s": 0.0}
NO_LIMITS = Limits()
ORDER = [f"{kind} {k}" for k in range(9) for kind in ("reversal", "hold")]


@dataclass
class Streaming(Adc):
    """A converter that streams, and may have no line that switches the power."""

    line: bool = True

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        for _ in range(round(duration_s / block_s)):
            yield self.acquire(block_s)

    def power(self, on: bool) -> None:
        if not self.line:
            raise LimitError("adc: the program cannot switch the power", "Set power_dio")
        super().power(on)


def bench(*dwells: Dwell, line: bool = True, limits: Limits = NO_LIMITS) -> tuple[Any, Book]:
    world = World(WorldConfig.ideal(), seed=1)
    rig, book = session(world, limits=limits, dwells=list(dwells))
    return replace(rig, adc=Streaming(world, line=line)), book


def test_the_schedule_has_its_duration_in_intervals_that_double() -> None:
    poses = list(schedule(43200.0, 900.0, 10.0))
    counts = Counter(pose.path for pose in poses)
    holds = [counts[path] for path, _ in groupby(pose.path for pose in poses) if path.startswith("hold")]
    assert holds[:6] == [5, 11, 22, 45, 90, 90]
    assert sum(holds) == 4320
    assert {counts[path] for path in counts if path.startswith("reversal")} == {8}
    assert poses[-1].path == f"reversal {len(holds)}"
    assert {(pose.alpha_deg, pose.beta_deg) for pose in poses if pose.path.startswith("hold")} == {(0.0, 0.0)}


def test_a_soak_shorter_than_an_interval_is_one_hold() -> None:
    assert Counter(pose.path for pose in schedule(5.0, 900.0, 10.0)) == {"reversal 0": 8, "hold 0": 1, "reversal 1": 8}


def test_a_soak_begins_cold_if_a_line_switches_the_power() -> None:
    rig, book = bench()
    soak(rig, **SHORT, off_s=100.0)
    assert rig.adc.power_log == [False, True] + [True] * len({dwell.pose.path for dwell in book.dwells})
    (power_on,) = (reading for reading in book.read if reading.name == POWER_ON)
    assert power_on.value >= 100.0
    assert book.dwells[0].t_s - power_on.value < 15.0
    assert [path for path, _ in groupby(dwell.pose.path for dwell in book.dwells)][:11] == ORDER[:11]


@pytest.mark.parametrize(("line", "off_s"), [(False, 100.0), (True, 0.0)])
def test_the_power_stays_on_without_a_line_or_an_off_time(line: bool, off_s: float) -> None:
    rig, book = bench(line=line)
    soak(rig, **SHORT, off_s=off_s)
    assert rig.adc.power_log == []
    assert POWER_ON not in {reading.name for reading in book.read}


def test_a_resumed_soak_switches_the_power_on_and_not_off() -> None:
    whole, book = bench()
    soak(whole, **SHORT, off_s=100.0)
    rest, done = bench(*book.dwells[:13])
    soak(rest, **SHORT, off_s=100.0)
    assert [dwell.pose for dwell in done.dwells] == [dwell.pose for dwell in book.dwells]
    assert rest.adc.power_log
    assert all(rest.adc.power_log)


def test_the_oven_gets_its_set_point_before_every_reversal_and_hold_and_is_off_at_the_end() -> None:
    rig, book = bench()
    soak(rig, **SHORT, off_s=0.0, oven_c=45.0)
    assert isinstance(rig.oven, Oven)
    assert rig.oven.told == [45.0, True] * len({dwell.pose.path for dwell in book.dwells}) + [False]


def test_without_an_oven_it_is_left_alone() -> None:
    rig, _ = bench()
    soak(rig, **SHORT)
    assert isinstance(rig.oven, Oven)
    assert rig.oven.told == []


@pytest.mark.parametrize("until_steady", [True, False])
def test_a_soak_ends_when_all_quantities_are_steady(until_steady: bool) -> None:
    asked: list[tuple[int, float]] = []

    def steady(dwells: Sequence[Dwell], oven_c: float) -> bool:
        asked.append((len(dwells), oven_c))
        return len(asked) == 3

    rig, book = bench()
    soak(replace(rig, steady=steady), **SHORT, until_steady=until_steady, oven_c=40.0)
    paths = [path for path, _ in groupby(dwell.pose.path for dwell in book.dwells)]
    if until_steady:
        assert paths == ORDER[:5]
        assert asked == [(8, 40.0), (17, 40.0), (26, 40.0)]
    else:
        assert paths == ORDER[: len(paths)]
        assert len(paths) > 5
        assert asked == []


def test_too_hot_a_sensor_stops_it_in_the_middle_of_a_hold() -> None:
    rig, book = bench(limits=Limits(temperature_c=(-20.0, 45.0)))
    with pytest.raises(SafetyLimit, match="outside the limits"):
        soak(rig, **SHORT | {"duration_s": 4000.0, "interval_s": 1000.0, "block_s": 10.0}, oven_c=60.0)
    assert book.dwells[-1].pose.path.startswith("hold")


@pytest.mark.parametrize("wrong", [{"duration_s": 0.0}, {"block_s": 0.0}, {"interval_s": 0.5}, {"off_s": -1.0}])
def test_impossible_settings_are_refused(wrong: dict[str, float]) -> None:
    rig, book = bench()
    with pytest.raises(SettingError, match="soak: "):
        soak(rig, **SHORT | wrong)
    assert book.dwells == []
