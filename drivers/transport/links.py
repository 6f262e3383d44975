"""The open wires of one bench."""

from __future__ import annotations

from drivers.clock import Clock
from drivers.errors import LinkRefused
from drivers.transport.address import CA_PORT, Address, Url
from drivers.transport.channel_access import Circuit, Records, find_server
from drivers.transport.lines import LinkLines, TextLines, VisaLines
from drivers.transport.link import Link, Tap, open_link
from drivers.transport.modbus import Bus, Unit
from drivers.transport.person import PersonLink


class Links:
    """Opens every link once: instruments with the same url share it, as two drives share an RS-485 line."""

    def __init__(self, clock: Clock, tap: Tap | None = None) -> None:
        """`tap` is called with every message."""
        self.clock = clock
        self._tap = tap
        self.person = PersonLink()
        self._buses: dict[str, Bus] = {}
        self._circuits: dict[tuple[str, int], Circuit] = {}
        self._links: list[Link | VisaLines] = []

    def unit(self, address: Address, name: str) -> Unit:
        """The Modbus instrument at `address`. Raises LinkRefused when its wire cannot be opened."""
        if address.url not in self._buses:
            self._buses[address.url] = Bus(self.link(address.url))
        bus = self._buses[address.url]
        bus.link.users.append(name)
        return Unit(bus, address.unit, name)

    def link(self, url: str, name: str = "") -> Link:
        """A wire of bytes that is not shared; `name` is the instrument's."""
        link = open_link(url, self.clock, name, self._tap)
        self._links.append(link)
        return link

    def lines(self, url: str, name: str) -> TextLines:
        """A wire of commands and answers of one line: a VISA resource, TCP or a serial line. Raises LinkRefused."""
        if (parsed := Url.parse(url)).scheme != "visa":
            return LinkLines(self.link(url, name), name)
        visa = VisaLines(parsed, self.clock, name, self._tap)
        self._links.append(visa)
        return visa

    def records(self, address: Address, name: str, first: str, timeout_s: float) -> Records:
        """The EPICS records whose names begin with that of `address`; `first` is searched on the network.

        The records of one server share a connection, as Channel Access requires. Raises LinkRefused.
        """
        url = Url.parse(address.url)
        if url.scheme != "ca":
            raise LinkRefused(f"{name}: {address.url} is not an EPICS address", "Write ca:NAME, or ca://host:port/NAME")
        place = (url.host, url.port or CA_PORT) if url.host else find_server(url.record + first, name, timeout_s)
        if place not in self._circuits:
            self._circuits[place] = Circuit(self.link(f"tcp://{place[0]}:{place[1]}", name), place)
        else:
            self._circuits[place].link.users.append(name)
        return Records(self._circuits[place], url.record, name, timeout_s)

    def close(self) -> None:
        """Close every wire."""
        for link in self._links:
            link.close()
        self._links.clear()
        self._buses.clear()
        self._circuits.clear()
