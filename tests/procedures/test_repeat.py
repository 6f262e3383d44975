"""Repetitions: what is done before which tumble, once."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.errors import LimitError
from drivers.world.config import WorldConfig
from drivers.world.world import World
from procedures.errors import SettingError
from procedures.repeat import repeat
from tests.procedures.bench import Adc, session


class NoLine(Adc):
    """A converter that no power line is wired to."""

    def power(self, on: bool) -> None:
        raise LimitError("adc: the program cannot switch the power", "Set power_dio")


def world() -> World:
    return World(WorldConfig.ideal(), seed=1)


def test_every_kind_is_repeated_and_the_line_switches_the_power() -> None:
    rig, book = session(world())
    repeat(rig, times=2, dwell_s=0.1, warm_s=1.0, off_s=1.0)
    paths = list(dict.fromkeys(d.pose.path for d in book.dwells))
    assert paths == ["as-is 1", "as-is 2", "power 1", "power 2", "mount 1", "mount 2"]
    assert len(book.dwells) == 6 * 8
    assert isinstance(rig.adc, Adc)
    assert rig.adc.power_log == [False, True, False, True]
    assert book.asked == ["mounting", "remount-1", "remount-2"]


def test_without_a_line_a_person_switches_the_power() -> None:
    w = world()
    rig, book = session(w)
    repeat(replace(rig, adc=NoLine(w)), times=2, mount=False, dwell_s=0.1, warm_s=0.0)
    assert book.asked == ["mounting", "power-cycle-1", "power-cycle-2"]


def test_a_run_resumed_within_a_tumble_does_not_switch_the_power_again() -> None:
    whole, book = session(world())
    repeat(whole, times=2, mount=False, dwell_s=0.1)
    rest, again = session(world(), dwells=book.dwells[:18])
    repeat(rest, times=2, mount=False, dwell_s=0.1)
    assert [d.pose for d in again.dwells] == [d.pose for d in book.dwells]
    assert isinstance(rest.adc, Adc)
    assert rest.adc.power_log == [False, True]


def test_one_repetition_is_refused() -> None:
    rig, _ = session(world())
    with pytest.raises(SettingError, match="times must be 2 or more"):
        repeat(rig, times=1)
