"""Simulated digital sensors for tests: a world whose outputs show when they were sampled, and drivers on twins."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.clock import SimulatedClock
from drivers.transport import Links
from drivers.transport.faults import Fault, faults_of

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


class DigitalSensors:
    """Digital sensors, each with its driver and a simulated clock."""

    def __init__(self) -> None:
        self._opened: list[Any] = []

    def connect(
        self, driver: str, settings: Any, *faults: Fault, listen: str = "", world: Any = None, sends: Any = None
    ) -> Any:
        """The driver with `settings` on its twin. `sends`: other settings of the twin; `listen`: its address."""
        twin, module = import_module(f"drivers.{driver}.twin"), import_module(f"drivers.{driver}.driver")
        server = twin.serve(world or Ramp(), {"adc": (1, sends or settings)}, listen or twin.LISTEN)
        if faults:
            server.afflict("adc", faults_of(driver, faults))
        clock = SimulatedClock()
        clock.attach(server)
        links = Links(clock)
        self._opened += [links, server]
        return module.connect(server.addresses["adc"], links, settings, "adc")

    def close(self) -> None:
        for opened in self._opened:
            opened.close()
