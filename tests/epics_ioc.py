"""An IOC that others wrote: caproto's simulated motor records, and a sensor of 1 V/g on their stages.

    python -m tests.epics_ioc --interfaces 127.0.0.1 --prefix test:

Motors alpha and beta, analog inputs ai1 and ai2 (V), processed 100 times a second; `slow`, processed once a second;
`mm`, in units that are no voltage.
"""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from caproto.ioc_examples.fake_motor_record import FakeMotor
from caproto.server import PVGroup, SubGroup, ioc_arg_parser, pvproperty, run

STAGE: dict[str, Any] = {"velocity": 100.0, "user_limits": (-400.0, 400.0), "tick_rate_hz": 50.0}


class Ioc(PVGroup):
    """Two motors and the sensor."""

    alpha = SubGroup(FakeMotor, prefix="alpha", **STAGE)
    beta = SubGroup(FakeMotor, prefix="beta", **STAGE)
    ai1 = pvproperty(value=2.5, record="ai", units="V", precision=6)
    ai2 = pvproperty(value=2500.0, record="ai", units="mV", precision=6)
    slow = pvproperty(value=1.0, record="ai", units="V")
    mm = pvproperty(value=1.0, record="ai", units="mm")

    @ai1.scan(period=0.01)  # type: ignore[no-redef]
    async def ai1(self, instance: Any, async_lib: Any) -> None:
        """Both outputs, without noise."""
        alpha, beta = (
            np.radians(stage.motor.field_inst.user_readback_value.value) for stage in (self.alpha, self.beta)
        )
        await instance.write(2.5 + np.sin(alpha) * np.cos(beta))
        await self.ai2.write(1e3 * (2.5 + np.sin(alpha) * np.sin(beta)))

    @slow.scan(period=1.0)  # type: ignore[no-redef]
    async def slow(self, instance: Any, async_lib: Any) -> None:
        """The same value, processed anew."""
        await instance.write(1.0)


@contextmanager
def serving(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The IOC in a process of its own, with the names test:alpha, test:beta, test:ai1 ..., where a search finds it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))
        port = udp.getsockname()[1]
    for name, value in {
        "EPICS_CA_ADDR_LIST": "127.0.0.1",
        "EPICS_CA_AUTO_ADDR_LIST": "NO",
        "EPICS_CA_SERVER_PORT": str(port),
    }.items():
        monkeypatch.setenv(name, value)
    command = [sys.executable, str(Path(__file__)), "--interfaces", "127.0.0.1", "--prefix", "test:"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert any("Server startup complete" in line for line in process.stdout), "the IOC has not begun"
        try:
            yield
        finally:
            process.terminate()


if __name__ == "__main__":
    options, run_options = ioc_arg_parser(default_prefix="test:", desc=__doc__)
    run(Ioc(**options).pvdb, **run_options)
