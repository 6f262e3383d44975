"""A simulated server of EPICS records: answers Channel Access on a port, with the records of twins.

caproto packs and unpacks the messages, here in the role of a server. Their content is ours.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol
from weakref import WeakKeyDictionary

from drivers.transport.channel_access import READ, WRITE, channel_access
from drivers.transport.server import Connection, Port

__all__ = ["Field", "RecordHost", "Session", "records_port"]

THINKING_S = 0.001
EPOCH_S = 1.7e9  # of the simulated clock's zero, s since 1970
SUCCESS = 1


@dataclass(frozen=True)
class Field:
    """The value of a field. `stamp_s` is the simulated clock's time at which its record was processed."""

    value: float
    stamp_s: float
    severity: int = 0
    status: int = 0
    units: str = ""


class RecordHost(Protocol):
    """A twin that has records."""

    def has(self, name: str) -> bool:
        """Whether it has the field of this name."""

    def field(self, name: str, now_s: float) -> Field:
        """A field that it has."""

    def put(self, name: str, value: float, now_s: float) -> None:
        """Write a field that it has."""


def records_port(listen: str, hosts: Sequence[RecordHost]) -> Port:
    """A port that answers for the records of `hosts`."""
    port = Port(listen)
    circuits: WeakKeyDictionary[Connection, Session] = WeakKeyDictionary()

    def answer(connection: Connection, now_s: float) -> None:
        session = circuits.get(connection)
        if session is None:
            session = circuits[connection] = Session(hosts)
        data, connection.inbox[:] = bytes(connection.inbox), b""
        try:
            reply = session.answers(data, now_s)
        except ValueError:
            connection.ended = True  # as a real server does with another protocol
            return
        if reply:
            connection.send(reply, now_s + THINKING_S + port.timing.line_s(len(reply)))

    port.answer = answer
    return port


class Session:
    """One client: its circuit, and its channels by the server's number."""

    def __init__(self, hosts: Sequence[RecordHost]) -> None:
        self._hosts, self._ca = hosts, channel_access("the simulated EPICS server")
        self._circuit = self._ca.VirtualCircuit(self._ca.SERVER, ("client", 0), None)
        self._names: dict[int, tuple[RecordHost, str]] = {}
        self._numbers = itertools.count(1)

    def answers(self, data: bytes, now_s: float) -> bytes:
        """The server's reply to these bytes of its client. Raises ValueError for bytes that are not Channel Access."""
        try:
            commands, _ = self._circuit.recv(data)
            sent = bytearray()
            for command in commands:
                self._circuit.process_command(command)
                for answer in self._answers(command, now_s):
                    sent += b"".join(bytes(part) for part in self._circuit.send(answer))
            return bytes(sent)
        except Exception as error:  # caproto has many, and those of struct and ctypes
            raise ValueError(f"not Channel Access: {error}") from error

    def _answers(self, command: Any, now_s: float) -> list[Any]:
        ca = self._ca
        if isinstance(command, ca.VersionRequest):
            return [ca.VersionResponse(ca.DEFAULT_PROTOCOL_VERSION)]
        if isinstance(command, ca.CreateChanRequest):
            return self._open_channel(command)
        if isinstance(command, ca.ReadNotifyRequest):
            return [self._read(command, now_s)]
        if isinstance(command, ca.WriteRequest):
            host, name = self._names[command.sid]
            host.put(name, float(command.data[0]), now_s)
        if isinstance(command, ca.EchoRequest):
            return [ca.EchoResponse()]
        return []

    def _open_channel(self, command: Any) -> list[Any]:
        name = command.name.decode("latin-1") if isinstance(command.name, bytes) else command.name
        for host in self._hosts:
            if host.has(name):
                number = next(self._numbers)
                self._names[number] = host, name
                return [
                    self._ca.AccessRightsResponse(command.cid, READ | WRITE),
                    self._ca.CreateChanResponse(self._ca.ChannelType.DOUBLE, 1, command.cid, number),
                ]
        return [self._ca.CreateChFailResponse(command.cid)]

    def _read(self, command: Any, now_s: float) -> Any:
        host, name = self._names[command.sid]
        field = host.field(name, now_s)
        kind = self._ca.ChannelType(command.data_type)
        metadata = self._ca.DBR_TYPES[kind]()
        metadata.status, metadata.severity = field.status, field.severity
        if hasattr(metadata, "units"):
            metadata.units = field.units.encode("latin-1")
        else:
            metadata.stamp = self._ca.TimeStamp.from_unix_timestamp(EPOCH_S + field.stamp_s)
        return self._ca.ReadNotifyResponse([field.value], kind, 1, SUCCESS, command.ioid, metadata=metadata)
