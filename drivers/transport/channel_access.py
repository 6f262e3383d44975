"""EPICS Channel Access: records are found by name, their fields read and written, over one of our own links.

caproto packs and unpacks the messages, and we carry the bytes, so that a simulated clock can pump them. caproto is the
extra `labs`; it is imported when a record is opened.

Source: EPICS Channel Access protocol specification; caproto's documentation, chapter on its core ("sans-I/O").
"""

from __future__ import annotations

import getpass
import socket
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from drivers.errors import BadFrame, DriverError, LinkRefused, LinkTimeout, Refused
from drivers.transport.link import Link

__all__ = ["SEVERITIES", "Circuit", "FieldReading", "Records", "channel_access", "find_server"]

NO_CAPROTO = "Install it: pip install 'inertial-rig[labs]'"
SEVERITIES = ("none", "minor", "major", "invalid")
SEARCHES = 4  # within the time-out
SILENT = "Check that the IOC runs (`caproto-get NAME` reads a record), and the network"
ELSEWHERE = (
    "Check the name in the bench file and that the IOC runs; on another subnet, set EPICS_CA_ADDR_LIST, or write "
    "ca://host:port/NAME"
)
ACCESS = "Ask who manages the IOC for access (its access security file)"
READ, WRITE = 1, 2  # access rights


def channel_access(context: str) -> Any:
    """The library caproto. Raises LinkRefused where it is not installed."""
    try:
        import caproto
    except ImportError as error:
        raise LinkRefused(f"{context}: needs caproto, which is not installed", NO_CAPROTO) from error
    return caproto


@dataclass(frozen=True)
class FieldReading:
    """The value of a field, with the alarm and the time stamp of its record (s since 1970, of the IOC's clock)."""

    value: float
    severity: int
    status: int
    stamp_s: float

    def is_worse_than(self, severity: str) -> bool:
        """Whether the alarm is worse than `severity`, one of SEVERITIES."""
        return self.severity > SEVERITIES.index(severity)

    @property
    def alarm(self) -> str:
        """The alarm as EPICS writes it, such as INVALID (COMM)."""
        ca = channel_access("")
        severity = _name(ca.AlarmSeverity, self.severity).removesuffix("_ALARM")
        return f"{severity} ({_name(ca.AlarmStatus, self.status)})"


class Circuit:
    """The connection to one server. After a loss, the next request opens it and its channels again."""

    def __init__(self, link: Link, place: tuple[str, int]) -> None:
        self.link, self.place = link, place
        self._ca = channel_access(link.url)
        self._circuit: Any = None
        self._channels: dict[str, Any] = {}

    def open(self, names: Sequence[str], device: str, timeout_s: float) -> None:
        """Open the channels of these fields that are not open yet. Raises LinkRefused, LinkTimeout."""
        if missing := [name for name in names if name not in self._channels]:
            self._begin()
            channels = {name: self._ca.ClientChannel(name, self._circuit) for name in missing}
            self._send(*(channel.create() for channel in channels.values()))

            def complete(_command: object) -> bool:
                states = {name: channel.states[self._ca.CLIENT] for name, channel in channels.items()}
                if missing_names := [name for name, state in states.items() if state is self._ca.FAILED]:
                    others_text = f", and {len(missing_names) - 1} more are not there" if missing_names[1:] else ""
                    raise LinkRefused(
                        f"{device}: the server {self.link.url} has no {missing_names[0]}{others_text}", ELSEWHERE
                    )
                return all(state is self._ca.CONNECTED for state in states.values())

            self._receive_until(complete, missing[0], device, timeout_s)
            self._channels |= channels

    def read(self, names: Sequence[str], device: str, timeout_s: float) -> list[FieldReading]:
        """The values of these fields, requested together. Raises LinkTimeout, LinkRefused, Refused, BadFrame."""
        kind = self._ca.ChannelType.TIME_DOUBLE
        return [self._decode(_reading, answer, device) for answer in self._request(names, kind, device, timeout_s)]

    def units(self, name: str, device: str, timeout_s: float) -> str:
        """The engineering units of a record (EGU)."""
        (answer,) = self._request([name], self._ca.ChannelType.GR_DOUBLE, device, timeout_s)
        return str(self._decode(_units, answer, device))

    def write(self, name: str, value: float, device: str, timeout_s: float) -> None:
        """Write a field, without waiting until its record is processed: a motor record is so at the end of its move."""
        self.open([name], device, timeout_s)
        channel = self._channels[name]
        if not (channel.access_rights or 0) & WRITE:
            raise Refused(
                f"{device}: the IOC does not let this computer and user write {name}",
                ACCESS,
                int(channel.access_rights or 0),
            )
        self._send(channel.write([value], notify=False, data_type=self._ca.ChannelType.DOUBLE))

    def _request(self, names: Sequence[str], kind: Any, device: str, timeout_s: float) -> list[Any]:
        self.open(names, device, timeout_s)
        requests = [self._channels[name].read(data_type=kind, data_count=1) for name in names]
        self._send(*requests)
        replies: dict[int, Any] = {}

        def complete(command: Any) -> bool:
            if isinstance(command, self._ca.ReadNotifyResponse):
                replies[command.ioid] = command
            return all(request.ioid in replies for request in requests)

        self._receive_until(complete, names[0], device, timeout_s)
        answers = [replies[request.ioid] for request in requests]
        for name, answer in zip(names, answers, strict=True):
            if not (status := self._decode(_status, answer, device)).success:
                code = int(status.code_with_severity)
                raise Refused(f"{device}: the IOC does not let this program read {name} ({status.name})", ACCESS, code)
        return answers

    def _begin(self) -> None:
        """Open a new connection with the greeting of the protocol."""
        if self._circuit is not None:
            return
        self._circuit = self._ca.VirtualCircuit(self._ca.CLIENT, self.place, 0)
        self._send(
            self._ca.VersionRequest(0, self._ca.DEFAULT_PROTOCOL_VERSION),
            self._ca.HostNameRequest(socket.gethostname()),  # access security of the IOC uses these two
            self._ca.ClientNameRequest(_user()),
        )

    def _send(self, *commands: Any) -> None:
        data = b"".join(bytes(part) for command in commands for part in self._circuit.send(command))
        try:
            self.link.write(data)
        except LinkRefused:
            self._forget()
            raise

    def _receive_until(self, complete: Any, field: str, device: str, timeout_s: float) -> None:
        """Receive messages until one of them makes `complete` true."""
        deadline = self.link.clock.now() + timeout_s
        while True:
            left_s = deadline - self.link.clock.now()
            try:
                data = self.link.read(left_s) if left_s > 0 else b""
            except LinkRefused:
                self._forget()
                raise
            if not data:
                self._forget()
                raise LinkTimeout(f"{device}: no answer to {field} within {timeout_s:g} s on {self.link.url}", SILENT)
            if self._take(data, complete, device):
                return

    def _take(self, data: bytes, complete: Any, device: str) -> bool:
        try:
            commands, _ = self._circuit.recv(data)
            for command in commands:
                self._circuit.process_command(command)
            for command in commands:
                self._require_no_error(command, device)
            return any(complete(command) for command in commands)
        except DriverError:
            raise
        except Exception as error:  # caproto has many, also those of struct and ctypes
            raise self._bad_frame(f"{len(data)} bytes", device, error) from error

    def _decode(self, take: Callable[[Any], Any], answer: Any, device: str) -> Any:
        """The result of `take` for a message, which caproto unpacks here. Raises BadFrame."""
        try:
            return take(answer)
        except Exception as error:
            raise self._bad_frame("a message", device, error) from error

    def _bad_frame(self, content: str, device: str, error: Exception) -> BadFrame:
        self._forget()
        reason = str(error) or type(error).__name__
        return BadFrame(
            f"{device}: {content} from {self.link.url} cannot be read as Channel Access ({reason})",
            "Check that the address is that of an EPICS server",
        )

    def _require_no_error(self, command: Any, device: str) -> None:
        if isinstance(command, self._ca.ErrorResponse):
            status = _status(command)
            words = command.error_message.decode("latin-1").strip("\0 ")
            raise Refused(f"{device}: the IOC reports {status.name} ({words})", SILENT, int(status.code_with_severity))
        if isinstance(command, self._ca.ServerDisconnResponse):
            self._forget()
            raise LinkRefused(f"{device}: the IOC has removed the record", "Restart the IOC, then resume the run")

    def _forget(self) -> None:
        """Reconnect at the next request: the answers on this connection can no longer be assigned to requests."""
        self._circuit, self._channels = None, {}
        self.link.hang_up()


class Records:
    """The fields of the records with one beginning of a name, for the instrument `device`."""

    def __init__(self, circuit: Circuit, beginning: str, device: str, timeout_s: float) -> None:
        self.beginning = beginning
        self._circuit, self._device, self._timeout_s = circuit, device, timeout_s

    def read(self, *fields: str) -> list[FieldReading]:
        """The values of fields, requested together. Raises LinkTimeout, LinkRefused, Refused, BadFrame."""
        return self._circuit.read([self.beginning + field for field in fields], self._device, self._timeout_s)

    def write(self, field: str, value: float) -> None:
        """Write a field; returns at once. Raises LinkTimeout, LinkRefused, Refused without write access."""
        self._circuit.write(self.beginning + field, value, self._device, self._timeout_s)

    def written(self, field: str, value: float) -> float:
        """Write a field, and read it. A server handles requests in their order, so this is the value afterwards."""
        self.write(field, value)
        return self.read(field)[0].value

    def units(self, field: str) -> str:
        """The engineering units."""
        return self._circuit.units(self.beginning + field, self._device, self._timeout_s)


def find_server(record: str, device: str, timeout_s: float) -> tuple[str, int]:
    """Host and port of the server that has a record, by a search on the network. Raises LinkRefused.

    The addresses are those of EPICS_CA_ADDR_LIST, and the broadcast address unless EPICS_CA_AUTO_ADDR_LIST is NO.
    """
    ca = channel_access(f"{device}: {record}")
    broadcaster, number = ca.Broadcaster(our_role=ca.CLIENT), 1
    addresses = ca.get_client_address_list()
    question = broadcaster.send(
        ca.VersionRequest(0, ca.DEFAULT_PROTOCOL_VERSION),
        ca.SearchRequest(record, number, ca.DEFAULT_PROTOCOL_VERSION),
    )
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        udp.settimeout(timeout_s / SEARCHES)
        for _ in range(SEARCHES):
            unreachable = [error for address in addresses if (error := _send_error(udp, question, address))]
            if answer := _find_answer(udp, broadcaster, number, time.monotonic() + timeout_s / SEARCHES):
                return answer
    places = ", ".join(f"{host}:{port}" for host, port in addresses)
    cause_text = f"; {unreachable[0]}" if unreachable else ""
    raise LinkRefused(
        f"{device}: no EPICS server has {record} (asked {places} for {timeout_s:g} s{cause_text})", ELSEWHERE
    )


def _send_error(udp: socket.socket, question: bytes, address: tuple[str, int]) -> OSError | None:
    try:
        udp.sendto(question, address)
    except OSError as error:  # no network, no such host
        return error
    return None


def _find_answer(udp: socket.socket, broadcaster: Any, number: int, deadline: float) -> tuple[str, int] | None:
    ca = channel_access("")
    while time.monotonic() < deadline:
        try:
            data, sender = udp.recvfrom(ca.MAX_UDP_RECV)
            commands = broadcaster.recv(data, sender)
        except (OSError, ca.CaprotoError):  # silence, or a datagram of another program
            continue
        for command in commands:
            if isinstance(command, ca.SearchResponse) and command.cid == number:
                host, port = ca.extract_address(command)
                return str(host), int(port)
    return None


def _reading(answer: Any) -> FieldReading:
    alarm = answer.metadata
    return FieldReading(float(answer.data[0]), int(alarm.severity), int(alarm.status), float(alarm.timestamp))


def _units(answer: Any) -> str:
    return bytes(answer.metadata.units).split(b"\0")[0].decode("latin-1").strip()


def _name(codes: Any, code: int) -> str:
    """The name of a code, or its number where the protocol has no such code."""
    return str(codes(code).name) if code in list(codes) else str(code)


def _status(command: Any) -> Any:
    """The status code of a message; caproto gives some as members of an enumeration."""
    return getattr(command.status, "value", command.status)


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # a container's user without a name
        return "rig"
