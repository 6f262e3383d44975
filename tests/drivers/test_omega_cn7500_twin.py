"""The simulated CN7500: its bytes as the manual has them, and the oven's driver on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from drivers.clock import SimulatedClock
from drivers.omega_cn7500 import twin as omega_cn7500_twin
from drivers.omega_cn7500.driver import Settings
from tests.drivers.conftest import bytes_exchanged


@pytest.fixture
def ask(small_world: Any) -> Iterator[Callable[[str], str]]:
    clock = SimulatedClock()
    server = omega_cn7500_twin.serve(small_world, {"oven": (1, Settings())})
    with bytes_exchanged(server, clock) as exchange:
        yield exchange


def test_the_thermometer_counts_tenths(ask: Callable[[str], str]) -> None:
    assert ask("01 03 10 00 00 01 80 CA").startswith("01 03 02 00 D7")  # 21.5 C


def test_set_point_and_run_bit_are_written_and_read(ask: Callable[[str], str], small_world: Any) -> None:
    for exchange in ("01 06 10 01 01 90 DD 36", "01 05 08 14 FF 00 CE 5E"):
        assert ask(exchange) == exchange
    assert ask("01 02 08 14 00 01 FB AE") == "01 02 01 01 60 48"
    assert small_world.oven == (40.0, True)


def test_functions_and_registers_that_it_has_not(ask: Callable[[str], str]) -> None:
    assert ask("01 01 08 14 00 01 BF AE") == "01 81 01 81 90"
    assert ask("01 10 10 01 00 01 02 01 90 B7 BC") == "01 90 01 8D C0"
    assert ask("01 03 00 7F 00 01 B5 D2") == "01 83 02 C0 F1"


def test_the_oven_heats_when_it_runs(bench: Any) -> None:
    bench.oven.set_temperature(60.0)
    bench.oven.run(True)
    assert bench.oven.running()
    assert bench.oven.set_point_c() == pytest.approx(60.0)
    assert bench.oven.temperature_c() == pytest.approx(21.5)
    bench.clock.sleep(3600.0)
    assert bench.oven.temperature_c() == pytest.approx(31.5)


def test_the_twin_identifies_itself_and_passes_its_test(bench: Any) -> None:
    assert bench.oven.identify().model == "Omega CN7500"
    assert all(check.ok for check in bench.oven.self_test())
