"""Byte links: TCP, UDP and serial, opened by url. Reads wait by the clock.

    tcp://host:port                           a socket
    rtu+tcp://host:port                       a socket; the frames on it are RTU's
    serial:/dev/ttyUSB0?baud=115200&parity=E  a serial line, 8 data bits; parity N, E or O; stop=1 or 2
    udpin://0.0.0.0:14550                     datagrams to this port of the computer, from the first sender
    udpout://host:port                        datagrams to and from this address

A link counts its bytes: a simulated clock needs the number that has not arrived yet.
"""

from __future__ import annotations

import os
import socket
import termios
from collections.abc import Callable, Iterator
from typing import Literal, Protocol

import serial

from drivers.clock import Clock, Wire
from drivers.errors import LinkRefused
from drivers.transport.address import UDP, Url

CONNECT_TIMEOUT_S = 5.0
DISCARD_S = 1.0
LARGEST = 1 << 16  # bytes of a datagram
BUFFER = 1 << 22  # bytes that the kernel may keep of datagrams; it allows less
# Called with every message: time, instrument, direction, bytes.
Tap = Callable[[float, str, Literal["sent", "heard"], bytes], None]
LOST = (OSError, termios.error, serial.SerialException)  # raised by a lost connection


class Port(Protocol):
    """The interface of a socket or a serial line for a link. A lost connection raises one of LOST.

    `chunk` is the largest number of bytes of one read, less than the kernel's buffer.
    """

    chunk: int
    lossy: bool  # the kernel discards data when its buffer is full

    @property
    def key(self) -> str:
        """The name of the connection."""

    def fileno(self) -> int: ...

    def read(self) -> bytes:
        """The bytes that have arrived, at least one; empty at the end."""

    def write(self, data: bytes) -> int:
        """Send all of `data`; the number of bytes that were sent, 0 without a receiver."""

    def close(self) -> None: ...


class OpenConnection(Wire):
    """An open connection. Its name `key` is the same at both ends."""

    def __init__(self, port: Port) -> None:
        self.port, self.key, self.chunk, self.lossy = port, port.key, port.chunk, port.lossy
        self.sent = self.received = 0

    def fileno(self) -> int:
        return self.port.fileno()

    def put(self, data: bytes) -> None:
        """Send all of `data`, and count it."""
        self.sent += self.port.write(data)

    def take(self) -> bytes:
        """Read and count the bytes that have arrived; empty at the end of the connection."""
        data = self.port.read()
        self.received += len(data)
        return data


class Link:
    """The controller's end of a link.

    A lost connection raises an error once. The next write opens it again, so that a stop can be sent.
    """

    def __init__(self, url: Url, clock: Clock, name: str = "", tap: Tap | None = None) -> None:
        """`name` is the instrument's, for its errors. Raises LinkRefused when nothing answers there."""
        self.url, self.clock = url.text, clock
        self._parsed = url
        self._place = name if url.text in name else f"{name}: {url.text}" if name else url.text
        self.users, self._tap = [name] if name else [], tap  # names of the instruments on it
        self._closed = False
        self._line: OpenConnection | None = self._connect()

    def write(self, data: bytes) -> None:
        """Send all of `data`. Raises LinkRefused if the connection is lost."""
        line = self._open_line()
        try:
            line.put(data)
        except LOST as error:
            raise self._connection_lost(error) from error
        if self._tap:
            self._tap(self.clock.now(), self._names, "sent", data)

    def read(self, timeout_s: float) -> bytes:
        """The next bytes that arrive, or none within `timeout_s`. Raises LinkRefused at the end of the connection."""
        line = self._open_line()
        if not self.clock.wait_readable(line, timeout_s):
            return b""
        try:
            data = line.take()
        except LOST as error:
            raise self._connection_lost(error) from error
        if not data and line.lossy:  # an empty datagram, or a damaged one
            return b""
        if not data:
            raise self._connection_lost("the instrument closed it")
        if self._tap:
            self._tap(self.clock.now(), self._names, "heard", data)
        return data

    def until(self, deadline_s: float) -> Iterator[bytes]:
        """All bytes that arrive by `deadline_s` of the clock. Raises LinkRefused at the end of the connection."""
        while (left_s := deadline_s - self.clock.now()) > 0:
            if data := self.read(left_s):
                yield data

    def discard(self, quiet_s: float = 0.0) -> int:
        """Discard bytes until none has arrived for `quiet_s`. Returns their number.

        Stops after DISCARD_S on a line that keeps sending; the next answer shows whether it is usable.
        """
        count, deadline = 0, self.clock.now() + DISCARD_S
        while self.clock.now() <= deadline and (data := self.read(quiet_s)):
            count += len(data)
        return count

    def hang_up(self) -> None:
        """Close the connection; the next write opens it again."""
        if self._line is not None:
            self._line.port.close()
            self._line = None

    def close(self) -> None:
        """Close the connection finally: each later read or write raises LinkRefused."""
        self._closed = True
        self.hang_up()

    @property
    def _names(self) -> str:
        return ", ".join(dict.fromkeys(self.users)) or self.url

    def _open_line(self) -> OpenConnection:
        if self._closed:
            raise LinkRefused(f"{self._place}: the connection is closed", "Connect again")
        if self._line is None:
            self._line = self._connect()
        return self._line

    def _connect(self) -> OpenConnection:
        try:
            line = OpenConnection(_open_port(self._parsed))
        except (*LOST, ValueError) as error:
            raise LinkRefused(f"{self._place}: cannot be opened ({_reason(error)})", _remedy(self._parsed)) from error
        self.clock.wait_readable(line, 0.0)  # a simulated clock finds the other end before the first byte
        return line

    def _connection_lost(self, cause: object) -> LinkRefused:
        self.hang_up()
        return LinkRefused(
            f"{self._place}: the connection is lost ({cause})", "Check cable and power, then connect again"
        )


class SocketPort:
    """A connected TCP socket, without Nagle's delay."""

    chunk, lossy = 1 << 15, False

    def __init__(self, host: str, number: int) -> None:
        self._socket = socket.create_connection((host, number), CONNECT_TIMEOUT_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    @property
    def key(self) -> str:
        return connection_key(self._socket.getsockname(), self._socket.getpeername())

    def fileno(self) -> int:
        return self._socket.fileno()

    def read(self) -> bytes:
        return self._socket.recv(self.chunk)

    def write(self, data: bytes) -> int:
        self._socket.sendall(data)
        return len(data)

    def close(self) -> None:
        self._socket.close()


class SerialPort:
    """A serial line, 8 data bits, opened for this program only."""

    chunk, lossy = 4095, False

    def __init__(self, path: str, baud: int, parity: str, stop_bits: int) -> None:
        self._path = path
        self._serial = serial.Serial(
            path, baud, parity=parity, stopbits=stop_bits, timeout=0, write_timeout=CONNECT_TIMEOUT_S, exclusive=True
        )

    @property
    def key(self) -> str:
        return self._path

    def fileno(self) -> int:
        return int(self._serial.fileno())

    def read(self) -> bytes:
        return bytes(self._serial.read(self.chunk))

    def write(self, data: bytes) -> int:
        self._serial.write(data)
        return len(data)

    def close(self) -> None:
        self._serial.close()


class DatagramPort:
    """A UDP socket: to a `host` and its port, or at a port of this computer, for the first sender to it.

    Before the first sender, data to send are lost.
    """

    chunk, lossy = 0, True

    def __init__(self, host: str, number: int, listens: bool) -> None:
        self._listens, self._known = listens, not listens
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        self._socket.setblocking(False)
        try:
            (self._socket.bind if listens else self._socket.connect)((host, number))
        except OSError:
            self._socket.close()
            raise

    @property
    def key(self) -> str:
        local = self._socket.getsockname()
        return datagram_key(local[1]) if self._listens else connection_key(local, self._socket.getpeername())

    def fileno(self) -> int:
        return self._socket.fileno()

    def read(self) -> bytes:
        """All waiting datagrams, joined."""
        data = []
        try:
            while True:
                piece, sender = self._socket.recvfrom(LARGEST)
                if not self._known:
                    self._socket.connect(sender)
                    self._known = True
                data.append(piece)
        except BlockingIOError:
            return b"".join(data)

    def write(self, data: bytes) -> int:
        return self._socket.send(data) if self._known else 0

    def close(self) -> None:
        self._socket.close()


def datagram_key(number: int) -> str:
    """The name of a link of datagrams to a port; the same at both ends."""
    return f"datagrams > {number}"


def connection_key(client: tuple[str, int], server: tuple[str, int]) -> str:
    """The name of a TCP connection; the same at both ends."""
    return f"{client[0]}:{client[1]} > {server[0]}:{server[1]}"


def open_link(url: str, clock: Clock, name: str = "", tap: Tap | None = None) -> Link:
    """Open a wire. Raises LinkRefused when nothing answers there, or for an invalid url."""
    return Link(Url.parse(url), clock, name, tap)


def _open_port(url: Url) -> SocketPort | SerialPort | DatagramPort:
    if url.scheme == "serial":
        return SerialPort(url.path, url.baud, url.parity, url.stop_bits)
    if url.scheme == "visa":
        raise ValueError("only the driver scpi_meter uses VISA")
    if url.scheme == "ca":
        raise ValueError("only the drivers epics_motor and epics_adc use Channel Access")
    if url.scheme in UDP:
        return DatagramPort(url.host, url.port, listens=url.scheme == "udpin")
    return SocketPort(url.host, url.port)


def _reason(error: Exception) -> str:
    """Why a port cannot be opened, without error number and path: the message has the path already."""
    number = getattr(error, "errno", None)
    if isinstance(error, serial.SerialException) and number:
        return os.strerror(number)
    return (error.strerror if isinstance(error, OSError) else "") or str(error)


def _remedy(url: Url) -> str:
    if url.scheme != "serial":
        return "Check the address, the network cable and that no other program uses the instrument"
    if url.path.startswith("/dev/pts/") and url.parity != "N":
        return "A pseudo-terminal has no parity: write parity=N"
    return "Check the device's path, your permission to open it, and that no other program uses it"
