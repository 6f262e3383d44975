"""The servers of the simulated instruments: passive, without threads, on TCP ports and pseudo-terminals.

A `Port` listens and has its connections. A `Server` has the ports of one instrument, or of one bus, and their twins. It
acts only when the clock gives it the time, so the same server is deterministic with a simulated clock, and serves any
client in real time.
"""

from __future__ import annotations

import contextlib
import heapq
import itertools
import math
import os
import pty
import socket
import tty
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from drivers.transport.address import UDP, Address, Url
from drivers.transport.faults import END, Faults, Message, Wire, disturb
from drivers.transport.link import LARGEST, connection_key, datagram_key

NO_FAULTS = Faults()
FAULTS_OF = "faults of"
MOST = 60_000  # bytes of a datagram that is sent
SILENCE_S = 0.05  # ends an RTU frame: generous, since a computer sends a frame in pieces


class Twin:
    """The interface of a simulated instrument for its server, without answers. This default acts on requests only."""

    def advance(self, now_s: float) -> None:
        """Compute the state at `now_s`; by default nothing."""

    def due_s(self) -> float:
        """When it next sends by itself, s; infinity for never."""
        return math.inf

    def state(self) -> dict[str, Any]:
        """The state for a resumed run, as JSON values; empty if a driver sets all that it needs when it connects."""
        return {}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from `state`."""


class Connection:
    """One client: received bytes, and bytes to send at their times."""

    def __init__(
        self, fileno: int, key: str, close: Callable[[], None], leaving: Callable[[Message], Iterable[Message]]
    ) -> None:
        self.fileno, self.key, self.close = fileno, key, close
        self.inbox = bytearray()
        self.received = self.emitted = 0
        self._after_faults = leaving  # a message after the faults of the link
        self._outbox: list[tuple[float, int, bytes]] = []  # a heap: time, order, data
        self._order = itertools.count()
        self._last_s = -math.inf
        self._full = False
        self._heard_s = -math.inf
        self.ended = False  # whether it is to be closed

    def read(self, now_s: float, patience_s: float) -> bool:
        """Read the received bytes; False at the end of the connection.

        Bytes received more than `patience_s` earlier are an incomplete request and are discarded.
        """
        if now_s - self._heard_s > patience_s:
            self.inbox.clear()
        self._heard_s = now_s
        try:
            data = os.read(self.fileno, 1 << 16)
        except BlockingIOError:
            return True
        except OSError:
            return False
        self.inbox += data
        self.received += len(data)
        return bool(data)

    def send(self, data: bytes, due_s: float) -> None:
        """Send `data` at `due_s`, after all earlier data; a fault of the link can change or delay them."""
        if not data:
            return
        self._last_s = max(self._last_s, due_s)
        pieces = list(self._after_faults(Message(data, self._last_s)))
        for piece in pieces:
            heapq.heappush(self._outbox, (piece.due_s, next(self._order), piece.data))
        if pieces and b"".join(piece.data for piece in pieces) == data:  # data that are only late keep their order
            self._last_s = pieces[-1].due_s

    def emit(self, now_s: float) -> None:
        """Write the due data that the kernel accepts."""
        self._full = False
        while self._outbox and not self._full and self._outbox[0][0] <= now_s:
            due_s, order, data = heapq.heappop(self._outbox)
            self.ended = self.ended or data == END
            count = self._write(data)
            self.emitted += count
            if count < len(data):
                self._full = True
                heapq.heappush(self._outbox, (due_s, order, data[count:]))

    def due_s(self) -> float:
        """The time of its next write; infinity while the client does not read."""
        return self._outbox[0][0] if self._outbox and not self._full else math.inf

    def progress(self, key: str) -> tuple[int, int] | None:
        """Bytes (received, emitted) of the client of this name; None without such a client."""
        return (self.received, self.emitted) if key == self.key else None

    def is_behind(self, now_s: float) -> bool:
        """Whether data that was due by `now_s` is not written yet."""
        return bool(self._outbox) and self._outbox[0][0] <= now_s

    def _write(self, data: bytes) -> int:
        try:
            return os.write(self.fileno, data)
        except BlockingIOError:
            return 0
        except OSError:  # the client is gone: its data are lost
            return len(data)


class Datagrams(Connection):
    """A UDP socket. Its client is at `to`, or is the last sender."""

    def __init__(
        self, udp_socket: socket.socket, peer: tuple[str, int] | None, leaving: Callable[[Message], Iterable[Message]]
    ) -> None:
        super().__init__(udp_socket.fileno(), datagram_key(peer[1]) if peer else "", udp_socket.close, leaving)
        self._socket, self._fixed, self._client = udp_socket, peer, peer
        self._earlier: dict[str, tuple[int, int]] = {}  # clients before this one

    def read(self, now_s: float, patience_s: float) -> bool:  # noqa: ARG002 - a datagram is whole
        """Read the received datagrams; True, because they have no end."""
        with contextlib.suppress(BlockingIOError, ConnectionRefusedError):
            while True:
                data, sender = self._socket.recvfrom(LARGEST)
                if not self._fixed and sender != self._client:
                    self._earlier[self.key] = self.received, self.emitted
                    self._client, self.key = sender, connection_key(sender, self._socket.getsockname())
                    self.received, self.emitted = self._earlier.get(self.key, (0, 0))
                self.inbox += data
                self.received += len(data)
        return True

    def is_behind(self, now_s: float) -> bool:
        """Whether bytes are late for the peer; False before the first datagram."""
        return self._client is None or super().is_behind(now_s)

    def progress(self, key: str) -> tuple[int, int] | None:
        return super().progress(key) or self._earlier.get(key)

    def forget(self) -> None:
        """Forget the client."""
        self._client, self.ended = self._fixed, False

    def _write(self, data: bytes) -> int:
        if self._client is None:
            return len(data)
        try:
            return self._socket.sendto(data[:MOST], self._client)
        except BlockingIOError:
            return 0
        except OSError:  # nobody is there
            return len(data)


class Port:
    """A port for clients. `answer` is called with a connection after each read from it.

    `wire` has the properties that faults need. `capacity`: approximate number of bytes that the system buffers for a
    client that does not read; None for the system's default.
    """

    def __init__(
        self, listen: str, answer: Callable[[Connection, float], None] | None = None, capacity: int | None = None
    ) -> None:
        self.timing = Url.parse(listen)
        self.wire = Wire(mends=self.timing.scheme == "tcp")
        self._faults: dict[int, Faults] = {}  # by unit
        self.connections: dict[int, Connection] = {}
        self.answer, self._capacity = answer or _ignore, capacity
        self._socket: socket.socket | None = None
        if self.timing.scheme == "pty":
            self.url = self._open_pty()
        elif self.timing.scheme in UDP:
            self.url = self._open_datagrams()
        else:
            self.url = self._listen()

    def filenos(self) -> list[int]:
        listening = [self._socket.fileno()] if self._socket else []
        return [*listening, *self.connections]

    def emit(self, now_s: float) -> None:
        for connection in list(self.connections.values()):
            connection.emit(now_s)
            if connection.ended:
                self._drop(connection)

    def receive(self, fileno: int, now_s: float) -> None:
        if self._socket and fileno == self._socket.fileno():
            self._accept()
            return
        connection = self.connections[fileno]
        if not connection.read(now_s, SILENCE_S if self.timing.rtu else math.inf):
            self._drop(connection)
        elif self._accepts_request(connection, now_s):
            self.answer(connection, now_s)

    def afflict(self, unit: int, faults: Faults) -> None:
        """Give the instrument of this number `faults` of its link."""
        self._faults[unit] = faults

    def hang_up(self) -> None:
        """Close all connections."""
        for connection in list(self.connections.values()):
            self._drop(connection)

    def close(self) -> None:
        self.hang_up()
        for connection in self.connections.values():  # of datagrams
            connection.close()
        self.connections.clear()
        if self._socket:
            self._socket.close()
            self._socket = None

    def _drop(self, connection: Connection) -> None:
        if isinstance(connection, Datagrams):
            connection.forget()
            return
        del self.connections[connection.fileno]
        connection.close()

    def _accepts_request(self, connection: Connection, now_s: float) -> bool:
        """Whether a request reaches the instrument."""
        if not (faults := self._faults_of(bytes(connection.inbox))):
            return True
        faults.asked()
        if faults.size("disconnect", now_s) is not None:
            self._drop(connection)
            return False
        if faults.size("silence", now_s) is not None:
            connection.inbox.clear()
        return bool(connection.inbox)

    def _after_faults(self, sent: Message) -> list[Message]:
        return disturb(sent, self._faults_of(sent.data), self.wire)

    def _faults_of(self, message: bytes) -> Faults:
        """The faults of the unit that a message is to or from; on a wire of one instrument, of that instrument."""
        unit = self.wire.unit_of(message) if self._faults and message else None
        if unit is None:
            return next(iter(self._faults.values()), NO_FAULTS)
        return self._faults.get(unit, NO_FAULTS)

    def _listen(self) -> str:
        self._socket = socket.create_server((self.timing.host, self.timing.port))
        self._socket.setblocking(False)
        return f"{self.timing.scheme}://{self.timing.host}:{self._socket.getsockname()[1]}"

    def _accept(self) -> None:
        assert self._socket  # noqa: S101 - only a listening port accepts
        with contextlib.suppress(BlockingIOError):
            client, peer = self._socket.accept()
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            if self._capacity is not None:
                client.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, self._capacity)
            key = connection_key(peer, client.getsockname())
            self.connections[client.fileno()] = Connection(client.fileno(), key, client.close, self._after_faults)

    def _open_datagrams(self) -> str:
        """A UDP socket that sends to an address or listens at one, and the url of the other end."""
        udp_socket, sends = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), self.timing.scheme == "udpout"
        udp_socket.setblocking(False)
        place = (self.timing.host, self.timing.port)
        udp_socket.bind(("", 0) if sends else place)
        self.connections[udp_socket.fileno()] = Datagrams(udp_socket, place if sends else None, self._after_faults)
        if sends:
            return f"udpin://{self.timing.host}:{self.timing.port}"
        return f"udpout://{self.timing.host}:{udp_socket.getsockname()[1]}"

    def _open_pty(self) -> str:
        """A raw pseudo-terminal. Its other end stays open, so that clients can reconnect."""
        inner, far = pty.openpty()
        tty.setraw(far)
        os.set_blocking(inner, False)
        path = os.ttyname(far)

        def close() -> None:
            os.close(inner)
            os.close(far)

        self.connections[inner] = Connection(inner, path, close, self._after_faults)
        return f"serial:{path}"


class Server:
    """The simulated instruments of one link, by role."""

    def __init__(self, ports: Sequence[Port], twins: Mapping[str, Twin], addresses: Mapping[str, Address]) -> None:
        self.addresses = dict(addresses)
        self._ports, self._twins = list(ports), dict(twins)
        self._faults: dict[str, Faults] = {}

    @property
    def url(self) -> str:
        """The url of its first port."""
        return self._ports[0].url

    def afflict(self, role: str, faults: Faults) -> None:
        """Give the instrument in `role` these `faults` from now on, of its links and of itself."""
        self._faults[role] = faults
        address, twin = self.addresses[role], self._twins[role]
        for port in self._ports:
            if port.url in (address.url, address.stream_url):
                port.afflict(address.unit, faults)
        if hasattr(twin, "faults"):
            twin.faults = faults

    def filenos(self) -> list[int]:
        return [fileno for port in self._ports for fileno in port.filenos()]

    def advance(self, now_s: float) -> None:
        for twin in self._twins.values():
            twin.advance(now_s)

    def receive(self, fileno: int, now_s: float) -> None:
        for port in self._ports:
            if fileno in port.filenos():
                port.receive(fileno, now_s)

    def emit(self, now_s: float) -> None:
        for port in self._ports:
            port.emit(now_s)

    def due_s(self) -> float:
        twins = [twin.due_s() for twin in self._twins.values()]
        return min([c.due_s() for port in self._ports for c in port.connections.values()] + twins, default=math.inf)

    def progress(self, key: str) -> tuple[int, int] | None:
        connections = [connection for port in self._ports for connection in port.connections.values()]
        return next((progress_now for connection in connections if (progress_now := connection.progress(key))), None)

    def state(self) -> dict[str, Any]:
        """The states of the twins and of their faults by role, of types that JSON has; called between exchanges."""
        twins = {role: twin.state() for role, twin in self._twins.items()}
        faults = {f"{FAULTS_OF} {role}": faults.state() for role, faults in self._faults.items()}
        return twins | faults

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue every twin from `state`; a fault that `state` does not have has not happened yet."""
        for role, twin in self._twins.items():
            twin.restore(state[role])
        for role, faults in self._faults.items():
            if (fault_state := state.get(f"{FAULTS_OF} {role}")) is not None:
                faults.restore(fault_state)

    def close(self) -> None:
        """Close all ports; clients see the end of their connections."""
        for port in self._ports:
            port.close()


def _ignore(connection: Connection, now_s: float) -> None:  # noqa: ARG001 - a port that only sends
    connection.inbox.clear()
