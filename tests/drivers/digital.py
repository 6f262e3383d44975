"""Simulated digital sensors for tests: a world whose outputs show when they were sampled, and drivers on twins."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.clock import SimulatedClock
from drivers.transport import Links
from drivers.transport.faults import Fault, faults_of
from drivers.transport.server import Server

FORCE_G = {"ax": 0.1, "ay": -0.2, "az": 1.0}
RATE_DEG_S = {"gx": 3.0, "gy": -40.0, "gz": 15.0}
FIELD_UT = {"mx": 20.0, "my": -5.0, "mz": 43.0}
LEVEL = FORCE_G | RATE_DEG_S | FIELD_UT


class Ramp:
    """Outputs of LEVEL, with a ramp of 1e-3 g, deg/s and uT a second."""

    samples = 0  # taken so far

    def die_c(self) -> float:
        return 24.5

    def sensed(self, outputs: Sequence[str], start_s: float, interval_s: float, n: int) -> NDArray[np.float64]:
        t_s = start_s + interval_s * np.arange(n)
        self.samples += n
        return np.column_stack([LEVEL[name] + 1e-3 * t_s for name in outputs])


@contextmanager
def connected(
    name: str,
    world: Any,
    settings: Any,
    role: str = "alpha",
    *,
    listen: str = "",
    sends: Any = None,
    faults: Sequence[Fault] = (),
) -> Iterator[tuple[Any, Server, SimulatedClock]]:
    """A driver on its simulated instrument, the server of the instrument, and the clock.

    `sends`: other settings of the simulated instrument. `faults` are there before the driver connects.
    """
    driver, twin = import_module(f"drivers.{name}.driver"), import_module(f"drivers.{name}.twin")
    server, clock = twin.serve(world, {role: (1, sends or settings)}, listen or twin.LISTEN), SimulatedClock()
    if faults:
        server.afflict(role, faults_of(name, faults))
    clock.attach(server)
    links = Links(clock)
    yield driver.connect(server.addresses[role], links, settings, role), server, clock
    links.close()
    server.close()


def usual_settings(name: str, **settings: Any) -> Any:
    """The default settings of a driver; a T7 has one input, which the small world has too."""
    wired = {"channels": {"supply": 0}} if name == "labjack_t7" else {}
    return import_module(f"drivers.{name}.driver").Settings(**wired, **settings)


class DigitalSensors:
    """Digital sensors, each with its driver and a simulated clock."""

    def __init__(self) -> None:
        self._opened = ExitStack()

    def connect(
        self, driver: str, settings: Any, *faults: Fault, listen: str = "", world: Any = None, sends: Any = None
    ) -> Any:
        """The driver with `settings` on its twin. `sends`: other settings of the twin; `listen`: its address."""
        made = connected(driver, world or Ramp(), settings, "adc", listen=listen, sends=sends, faults=faults)
        return self._opened.enter_context(made)[0]

    def close(self) -> None:
        self._opened.close()
