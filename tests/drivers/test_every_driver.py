"""What holds for every driver and its twin: found by name, built alike, the same on every kind of wire."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Sequence
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers import clock as clock_module
from drivers.instrument import Check, Identity
from tests.drivers.digital import connected, usual_settings

NAMES = sorted(file.parent.name for file in Path(clock_module.__file__).parent.glob("*/driver.py"))
SERIAL = [name for name in NAMES if import_module(f"drivers.{name}.twin").LISTEN.startswith("pty")]
OTHERS = ("rtu+tcp://127.0.0.1:0", "tcp://127.0.0.1:0")
WIRES = [(name, None) for name in NAMES] + [(name, listen) for name in SERIAL for listen in OTHERS]


class Steady:
    """A world whose inputs are all at 2 V, and whose digital outputs are all 2."""

    def advance(self, t_s: float) -> None:
        """Nothing changes."""

    def adc_volts(self, inputs: Sequence[str], start_s: float, interval_s: float, n: int) -> NDArray[np.float64]:
        return np.full((n, len(inputs)), 2.0)

    sensed = adc_volts

    def die_c(self) -> float:
        return 25.0


@pytest.fixture(params=WIRES, ids=lambda wire: f"{wire[0]}-{wire[1] or 'usual'}")
def instrument(request: pytest.FixtureRequest, small_world: Any) -> Iterator[Any]:
    name, listen = request.param
    if name in ("imu_lines", "mavlink_imu", "xsens_mti", "epics_adc"):
        small_world = Steady()
    with connected(name, small_world, usual_settings(name), listen=listen) as (driver, _, _):
        yield driver


def test_there_are_the_three_of_the_bench() -> None:
    assert {"oriental_az", "labjack_t7", "omega_cn7500"} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_a_driver_has_settings_connect_and_a_twin(name: str) -> None:
    driver, twin = import_module(f"drivers.{name}.driver"), import_module(f"drivers.{name}.twin")
    assert is_dataclass(driver.Settings)
    settings: Any = driver.Settings
    assert settings.__dataclass_params__.frozen
    assert settings() is not None
    assert list(inspect.signature(driver.connect).parameters) == ["address", "links", "settings", "name"]
    assert list(inspect.signature(twin.serve).parameters) == ["world", "roles", "listen"]


def test_it_says_who_it_is_and_how_it_is(instrument: Any) -> None:
    assert instrument.name == "alpha"
    assert isinstance(instrument.identify(), Identity)
    assert instrument.identify().model
    checks = instrument.self_test()
    assert all(isinstance(check, Check) and check.detail for check in checks)
