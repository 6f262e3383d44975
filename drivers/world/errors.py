"""Errors of the simulated world.

DriverError
└── SimulationError
    ├── UnknownSetting   a configuration names something that does not exist
    ├── BadSetting       a configuration value is no finite number, or a kept state does not fit
    ├── UnknownInput     a converter input or a stage axis that the world does not have
    └── TimeReversal     the world was asked about a time that has passed
"""

from __future__ import annotations

from drivers.errors import DriverError


class SimulationError(DriverError):
    """Root of the simulated world's errors."""


class UnknownSetting(SimulationError):
    """A configuration names something that does not exist."""


class BadSetting(SimulationError):
    """A configuration value is no finite number, or a kept state does not fit."""


class UnknownInput(SimulationError):
    """A converter input or a stage axis that the world does not have."""


class TimeReversal(SimulationError):
    """A request for a time before the present time of the world."""
