"""The CN7500 driver's bytes, written out from the manual's register table; checksums included."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.errors import LimitError, SensorFault
from drivers.omega_cn7500 import driver as omega_cn7500
from drivers.omega_cn7500.driver import Oven, Settings
from drivers.transport import Address, Links

ASK_PV, ASK_SV, ASK_METHOD = (
    "01 03 10 00 00 01 80 CA",
    "01 03 10 01 00 01 D1 0A",
    "01 03 10 05 00 01 90 CB",
)
Ovens = Callable[[list[tuple[str, str]]], Oven]


@pytest.fixture
def oven(script: Callable[..., Address], links: Links) -> Ovens:
    return lambda exchanges: omega_cn7500.connect(script(exchanges), links, Settings((-10.0, 60.0)), "oven")


def test_the_process_value_counts_tenths(oven: Ovens) -> None:
    assert oven([(ASK_PV, "01 03 02 00 FD 79 C5")]).temperature_c() == pytest.approx(25.3)


def test_temperatures_below_zero_are_read(oven: Ovens) -> None:
    assert oven([(ASK_PV, "01 03 02 FF 9C F9 DD")]).temperature_c() == pytest.approx(-10.0)


def test_no_thermocouple_is_no_temperature(oven: Ovens) -> None:
    with pytest.raises(SensorFault, match=r"oven: no thermocouple is connected. Check the thermocouple"):
        oven([(ASK_PV, "01 03 02 80 03 99 85")]).temperature_c()


def test_the_set_point_goes_by_function_6(oven: Ovens) -> None:
    exchange = "01 06 10 01 01 90 DD 36"
    heater = oven([(exchange, exchange), (ASK_SV, "01 03 02 00 FD 79 C5")])
    heater.set_temperature(40.0)
    assert heater.set_point_c() == pytest.approx(25.3)


@pytest.mark.parametrize("temperature", [60.1, -10.1, float("nan")])
def test_outside_its_limits_nothing_is_sent(oven: Ovens, temperature: float) -> None:
    with pytest.raises(LimitError, match=r"outside its limits -10 .. 60 C; nothing was sent"):
        oven([]).set_temperature(temperature)


def test_the_oven_runs_and_stops(oven: Ovens) -> None:
    start, stop = "01 05 08 14 FF 00 CE 5E", "01 05 08 14 00 00 8F AE"
    ask = "01 02 08 14 00 01 FB AE"
    heater = oven([(start, start), (ask, "01 02 01 01 60 48"), (stop, stop), (ask, "01 02 01 00 A1 88")])
    heater.run(True)
    assert heater.running()
    heater.run(False)
    assert not heater.running()


def test_the_self_test_names_what_is_wrong(oven: Ovens) -> None:
    on_off = "01 03 02 00 01 79 84"
    checks = oven([(ASK_METHOD, on_off), (ASK_PV, "01 03 02 80 03 99 85")]).self_test()
    assert [(c.name, c.ok, c.detail) for c in checks] == [
        ("thermometer", False, "oven: no thermocouple is connected"),
        ("control", False, "on/off control"),
    ]
