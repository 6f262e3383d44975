"""EPICS motors and analog records, with an IOC that others wrote: caproto's simulated motor records."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from drivers.clock import WallClock
from drivers.epics_adc import driver as adc_driver
from drivers.epics_motor import driver as motor_driver
from drivers.errors import LimitError, LinkRefused, StreamError
from drivers.transport import Address, Links
from tests.epics_ioc import serving


@pytest.fixture
def ioc(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The IOC of others, where a search finds it."""
    with serving(monkeypatch):
        yield


FAST = {"deg_per_unit": 1.0, "speed_deg_s": 100.0, "speed_limit_deg_s": 200.0, "acceleration_deg_s2": 1e4}


@pytest.mark.slow
@pytest.mark.sockets
def test_motors_and_records_of_an_ioc_of_others(ioc: None) -> None:
    links = Links(WallClock())
    settings = motor_driver.Settings(**FAST)
    alpha, beta = (
        motor_driver.connect(Address(f"ca:test:{role}"), links, settings, role) for role in ("alpha", "beta")
    )
    adc = adc_driver.connect(Address("ca:test:"), links, adc_driver.Settings(rate_hz=5.0), "adc")
    alpha.move_to(90.0)
    beta.move_to(30.0)
    beta.require_steady()
    expected = (2.5 + np.cos(np.radians(30)), 2.5 + np.sin(np.radians(30)))
    np.testing.assert_allclose(adc.acquire(1.0).volts.mean(axis=0), expected, atol=1e-3)
    beta.start(300.0)
    beta.halt()
    beta.stop()
    assert beta.angle_deg() < 290
    with pytest.raises(LimitError, match=r"own limits, -400 \.\. 400 deg"):
        motor_driver.connect(
            Address("ca:test:beta"),
            links,
            motor_driver.Settings(limits_deg=(-900.0, 900.0), **FAST),
            "beta",
        ).move_to(500.0)
    slow = adc_driver.Settings({"vx": "slow"}, rate_hz=5.0)
    with pytest.raises(StreamError, match=r"vx \(test:slow\) had a new time stamp in [1-4] of 10 readings"):
        adc_driver.connect(Address("ca:test:"), links, slow, "adc").acquire(2.0)
    with pytest.raises(LimitError, match="'mm'"):
        adc_driver.connect(Address("ca:test:"), links, adc_driver.Settings({"vx": "mm"}), "adc")
    links.close()


@pytest.mark.slow
@pytest.mark.sockets
def test_a_record_that_nobody_has_is_not_found(ioc: None) -> None:
    settings = motor_driver.Settings(timeout_s=0.4)
    with pytest.raises(
        LinkRefused, match=r"alpha: no EPICS server has nobody:m1 \(asked 127\.0\.0\.1:\d+.*CA_ADDR_LIST"
    ):
        motor_driver.connect(Address("ca:nobody:m1"), Links(WallClock()), settings, "alpha")
