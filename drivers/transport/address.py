"""The address of an instrument: the url of its link, the unit on it, and the time of a byte on the link."""

from __future__ import annotations

import ipaddress
import os
import re
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

from drivers.errors import LinkRefused


@dataclass(frozen=True)
class Address:
    """A link, and the unit on it.

    `url` is one of
        tcp://host:port                             Modbus TCP, GCS
        rtu+tcp://host:port                         Modbus RTU frames through a converter on TCP
        serial:/dev/ttyUSB0?baud=115200&parity=E    a serial line (parity N, E or O): Modbus RTU, GCS, text
        udpin://0.0.0.0:14550                       datagrams that an instrument sends to this port: MAVLink, text
        udpout://host:port                          datagrams to and from an instrument at this address
        visa:TCPIP0::10.0.0.7::INSTR                a VISA resource: SCPI; `?library=` another library than pyvisa-py
        ca:13IDC:m1                                 a record of EPICS, which Channel Access finds on the network
        ca://10.0.0.7:5064/13IDC:m1                 the same on a server whose address is known
    `unit` is the Modbus unit id; instruments with the same url share the wire.
    `stream_url` is the second port of an instrument that has one, and the port of a simulated server of EPICS.
    """

    url: str
    unit: int = 1
    stream_url: str | None = None


SCHEMES = ("tcp", "rtu+tcp", "serial", "pty", "visa", "ca", "udpin", "udpout")
UDP = ("udpin", "udpout")
NETWORK = ("tcp", "rtu+tcp", *UDP)  # each needs a port
CA_PORT = 5064  # of a server of Channel Access
TCP_LATENCY_S = 150e-6  # one way through a switch and a small embedded stack
USER = re.compile("//.*@")
VISA_SOCKET = re.compile(r"TCPIP\d*::([^:]+)::(\d+)::SOCKET", re.IGNORECASE)
REMEDY = "Write tcp://host:port, rtu+tcp://host:port or serial:/dev/ttyUSB0?baud=115200&parity=E"
PYVISA_PY = "@py"


@dataclass(frozen=True)
class Url:
    """The parts of a link's address. `pty:` requests a new pseudo-terminal from a server.

    It has no user and no password, so that none comes into a record.
    """

    text: str
    scheme: str
    host: str = ""
    port: int = 0
    path: str = ""
    baud: int = 115200
    parity: str = "N"
    stop_bits: int = 1
    library: str = PYVISA_PY  # of a VISA resource

    @classmethod
    def parse(cls, text: str) -> Url:
        """Parse `text`. Raises LinkRefused if it is not the address of a link."""
        try:
            parts = urlsplit(text)
            options = {
                key: values[-1] for key, values in parse_qs(parts.query, strict_parsing=bool(parts.query)).items()
            }
            url = cls(
                text,
                parts.scheme,
                parts.hostname or "",
                parts.port or 0,
                parts.path,
                int(options.pop("baud", "115200")),
                options.pop("parity", "N"),
                int(options.pop("stop", "1")),
                options.pop("library", PYVISA_PY),
            )
        except ValueError as error:
            raise LinkRefused(f"{_display_text(text)} is not the address of an instrument ({error})", REMEDY) from error
        if "@" in parts.netloc:
            raise LinkRefused(f"{_display_text(text)} has a user name; remove it", REMEDY)
        if options or not url._complete():
            raise LinkRefused(f"{_display_text(text)} is not the address of an instrument", REMEDY)
        if parts.port is None and url.scheme in NETWORK:
            raise LinkRefused(f"{_display_text(text)} has no port", f"Write {url.scheme}://{url.host}:PORT")
        return url

    def _complete(self) -> bool:
        places = {"serial": bool(self.path), "visa": "::" in self.path, "pty": True, "ca": True}
        place = places.get(self.scheme, bool(self.host))
        return self.scheme in SCHEMES and place and self.parity in ("N", "E", "O") and self.baud > 0

    @property
    def line(self) -> str:
        """The name of the link for any spelling of its address: the real path of the device, or host:port."""
        if self.scheme in ("serial", "pty"):
            return os.path.realpath(self.path)
        if self.scheme == "ca":
            return f"ca:{self.record}"
        host, port = self.host.rstrip("."), self.port
        if self.scheme == "udpin":
            return f"udp port {port}"
        if self.scheme == "visa":
            if not (match := VISA_SOCKET.fullmatch(self.path)):
                return f"visa:{self.path.upper()}"
            host, port = match[1].rstrip("."), int(match[2])
        udp = "udp " if self.scheme == "udpout" else ""
        try:
            address = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
        except ValueError:  # a name, which is not looked up
            return f"{udp}{host}:{port}"
        return f"{udp}{'127.0.0.1' if address == ipaddress.IPv6Address('::1') else address}:{port}"

    @property
    def record(self) -> str:
        """The name of an EPICS record, or the common beginning of several names."""
        return self.path.removeprefix("/")

    @property
    def on_a_network(self) -> bool:
        """Whether other computers can reach the wire: a network address, and not one of this computer alone."""
        if self.scheme == "visa":
            return self.path.upper().startswith(("TCPIP", "VICP"))
        if self.scheme == "ca":
            return self.host not in ("localhost", "127.0.0.1", "::1")  # an EPICS record is there for all clients
        if self.scheme in UDP:
            return self.host != "localhost" and not self.host.startswith("127.")
        return self.scheme in NETWORK and not self.line.startswith("127.")

    @property
    def rtu(self) -> bool:
        """Whether the frames on the wire are those of Modbus RTU."""
        return self.scheme not in ("tcp", "ca", *UDP)

    @property
    def character_s(self) -> float:
        """Time of one character on the serial line: start, 8 data, parity and stop bits."""
        return (9 + (self.parity != "N") + self.stop_bits) / self.baud

    @property
    def gap_s(self) -> float:
        """Silence that ends an RTU frame: 3.5 characters, and 1.75 ms above 19200 baud (Modbus over serial line)."""
        return 1.75e-3 if self.baud > 19200 else 3.5 * self.character_s

    def line_s(self, count: int) -> float:
        """Time to transmit `count` bytes."""
        return count * self.character_s + self.gap_s if self.rtu else TCP_LATENCY_S


def _display_text(text: str) -> str:
    """The address without user and password, for messages."""
    return repr(USER.sub("//***@", text))
