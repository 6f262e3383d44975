"""The simulated IOC with analog records: processed whenever they are read, as with a fast converter behind them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from drivers.epics_adc.driver import Settings
from drivers.transport.address import Address
from drivers.transport.channel_access_server import Field, records_port
from drivers.transport.faults import Faults, Kind
from drivers.transport.server import Server, Twin

if TYPE_CHECKING:
    from drivers.world.batch import AnyWorld

__all__ = ["FAULTS", "LISTEN", "serve"]

LISTEN = "tcp://127.0.0.1:0"
BEGINNING = "sim:"
READ_ALARM = 1  # EPICS: the status READ
FAULTS = {
    "severity": Kind("its records have an alarm of this severity: 1 minor, 2 major, 3 invalid", 3, least=1),
    "frozen": Kind("its records are not processed any more"),
}


class Ioc(Twin):
    """The records by name. All are processed at the same time."""

    def __init__(self, world: AnyWorld, settings: Settings) -> None:
        self.faults = Faults()
        self._world = world
        self._wiring = {f"{BEGINNING}{record}": name for name, record in settings.wired.items()}
        self._volts: dict[str, float] = {}
        self._stamp_s = -math.inf

    def has(self, name: str) -> bool:
        return name in self._wiring

    def field(self, name: str, now_s: float) -> Field:
        if now_s > self._stamp_s and (not self._volts or self.faults.size("frozen", now_s) is None):
            self._process(now_s)
        severity = self.faults.size("severity", now_s)
        status = READ_ALARM if severity else 0
        return Field(self._volts[self._wiring[name]], self._stamp_s, int(severity or 0), status, "V")

    def put(self, name: str, value: float, now_s: float) -> None:
        """Does nothing: an input record is not written."""

    def _process(self, now_s: float) -> None:
        names = list(self._wiring.values())
        self._world.advance(now_s)
        volts = self._world.adc_volts(names, now_s, 0.0, 1)[0]
        self._volts, self._stamp_s = dict(zip(names, map(float, volts), strict=True)), now_s


def serve(world: AnyWorld, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """One IOC: role -> (unit id, not used by an IOC; settings). Its channels are the world's inputs."""
    ((role, (unit, settings)),) = roles.items()
    ioc = Ioc(world, settings)
    port = records_port(listen, [ioc])
    place = port.url.replace("tcp", "ca", 1)
    return Server([port], {role: ioc}, {role: Address(f"{place}/{BEGINNING}", unit, port.url)})
