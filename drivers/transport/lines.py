"""Wires of text: a command is a line, and so is an answer. On our own links, or through VISA.

    tcp://host:port, serial:/dev/ttyUSB0?baud=9600   by our links, which a simulated clock can pump
    visa:TCPIP0::10.0.0.7::INSTR                      PyVISA with pyvisa-py: LAN (VXI-11, HiSLIP, sockets), USB, GPIB
    visa:GPIB0::22::INSTR?library=/usr/lib/libvisa.so  the same with a manufacturer's VISA library

PyVISA is the extra `labs`; it is imported when a VISA resource is opened.
"""

from __future__ import annotations

import contextlib
from typing import Any, Protocol

from drivers.clock import Clock
from drivers.errors import BadFrame, LinkError, LinkRefused, LinkTimeout
from drivers.transport.address import Url
from drivers.transport.link import Link, Tap

NO_PYVISA = "Install it: pip install 'inertial-rig[labs]'"
SILENT = "Check that it is switched on, its cable and address, and that no other program talks to it"
GONE = "Check cable and power, then resume the run"
LONGEST = 1 << 20  # bytes of an answer


class TextLines(Protocol):
    """A wire to one instrument."""

    def write(self, command: str) -> None:
        """Send a command. Raises LinkRefused if the connection is lost."""

    def query(self, command: str, timeout_s: float) -> str:
        """Send a command and return the answer without its end of line. Raises LinkTimeout, LinkRefused, BadFrame."""


class LinkLines:
    """Lines on one of our links."""

    def __init__(self, link: Link, name: str) -> None:
        self._link, self._name = link, name

    def write(self, command: str) -> None:
        self._link.write(command.encode("ascii") + b"\n")

    def query(self, command: str, timeout_s: float) -> str:
        self._link.discard()  # a late answer to an earlier question
        self.write(command)
        received = b""
        for next_bytes in self._link.until(self._link.clock.now() + timeout_s):
            received += next_bytes
            if b"\n" in received or len(received) >= LONGEST:
                return _answer_text(received.partition(b"\n")[0], self._name, command)
        raise _timeout_error(self._name, command, self._link.url, timeout_s)


class VisaLines:
    """Lines through a VISA resource.

    A lost connection raises an error once. The next command opens it again, so that a stop can be sent.
    """

    def __init__(self, url: Url, clock: Clock, name: str, tap: Tap | None = None) -> None:
        """Raises LinkRefused without PyVISA, or when the resource cannot be opened."""
        self._url, self._clock, self._name, self._tap = url, clock, name, tap
        self._visa = _pyvisa(f"{name}: {url.text}")
        self._closed = False
        self._resource: Any = self._open()

    def write(self, command: str) -> None:
        try:
            self._session().write(command)
        except (self._visa.Error, OSError) as error:
            raise self._error_of(error, command, 0.0) from error
        self._note("sent", command)

    def query(self, command: str, timeout_s: float) -> str:
        session = self._session()
        try:
            session.timeout = 1000 * timeout_s
            session.write(command)
            self._note("sent", command)
            received = session.read_raw()
        except (self._visa.Error, OSError) as error:
            raise self._error_of(error, command, timeout_s) from error
        text = _answer_text(bytes(received).rstrip(b"\r\n"), self._name, command)
        self._note("heard", text)
        return text

    def close(self) -> None:
        """Close the connection finally: each later command raises LinkRefused."""
        self._closed = True
        self._drop()

    def _session(self) -> Any:
        if self._closed:
            raise LinkRefused(f"{self._name}: {self._url.text}: the connection is closed", "Connect again")
        if self._resource is None:
            self._resource = self._open()
        return self._resource

    def _open(self) -> Any:
        try:
            resource = self._visa.ResourceManager(self._url.library).open_resource(self._url.path)
        except Exception as error:  # each backend has its own errors: of interface, host, bus, library
            remedy = (
                "`pyvisa-info` lists the interfaces that PyVISA can open, and the libraries that are missing for others"
            )
            context = f"{self._name}: {self._url.text}"
            raise LinkRefused(f"{context}: cannot be opened ({error})", f"{SILENT}; {remedy}") from error
        resource.read_termination = resource.write_termination = "\n"
        return resource

    def _error_of(self, error: Exception, command: str, timeout_s: float) -> LinkError:
        """The error as ours. A late answer is cleared, because it would count as that of the next question."""
        timeout = self._visa.constants.StatusCode.error_timeout
        if getattr(error, "error_code", None) == timeout and timeout_s:
            with contextlib.suppress(Exception):  # the time-out is reported
                self._resource.clear()
                return _timeout_error(self._name, command, self._url.text, timeout_s)
            self._drop()
            return _timeout_error(self._name, command, self._url.text, timeout_s)
        self._drop()
        return LinkRefused(f"{self._name}: {self._url.text}: the connection is lost at {command!r} ({error})", GONE)

    def _drop(self) -> None:
        if self._resource is not None:
            with contextlib.suppress(Exception):  # it is gone already
                self._resource.close()
            self._resource = None

    def _note(self, direction: Any, text: str) -> None:
        if self._tap:
            self._tap(self._clock.now(), self._name, direction, text.encode("ascii") + b"\n")


def _pyvisa(context: str) -> Any:
    try:
        import pyvisa
        import pyvisa_py  # noqa: F401 - PyVISA finds it by its name; without it the message would come later
    except ImportError as error:
        raise LinkRefused(f"{context}: needs PyVISA, and {error.name} is not installed", NO_PYVISA) from error
    return pyvisa


def _timeout_error(name: str, command: str, url: str, timeout_s: float) -> LinkTimeout:
    return LinkTimeout(f"{name}: no answer to {command!r} within {timeout_s:g} s on {url}", SILENT)


def _answer_text(data: bytes, name: str, command: str) -> str:
    try:
        return data.decode("ascii").strip()
    except UnicodeDecodeError:
        description = f"{len(data)} bytes that are not text ({data[:24]!r})"
        raise BadFrame(f"{name}: the answer to {command!r} is {description}", SILENT) from None
