"""The only source of time, and the only way to wait.

`WallClock` is real. `SimulatedClock` moves only while the controller waits, and pumps the simulated
instruments in the controller's own thread: no threads, no races, hours in seconds, every byte on a socket.

Waiting is a rendezvous. Both ends of a wire count their bytes, so the clock knows what the kernel
still holds: time never jumps past a byte in flight, and the same calls give the same instants on
any machine. Only when all is quiet does time move, to the next thing that is due.
"""

from __future__ import annotations

import fcntl
import math
import select
import sys
import termios
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol
from weakref import WeakKeyDictionary

from drivers.errors import ClockStuck

STUCK_S = 30.0  # real seconds after which bytes in flight count as lost
DROPPED_S = 0.05  # the same on a wire where the kernel drops some
FULL_S = 0.2  # real seconds without a further byte after which the kernel is taken to have no room for more
SLICE_S = 10.0  # longest simulated step while a stream runs: bounds what its server must hold
TICK_S = 0.02  # how often `serve_forever` looks whether it shall end


class Wire(Protocol):
    """The controller's end of an open connection."""

    key: str  # names the connection; its server knows the same name
    sent: int  # bytes written so far
    received: int  # bytes read so far
    chunk: int  # bytes that the kernel usually buffers for one read
    lossy: bool  # the kernel drops what finds no room

    def fileno(self) -> int: ...


class Peer(Protocol):
    """A passive server: it acts only when the clock calls it."""

    def filenos(self) -> Sequence[int]:
        """Descriptors to listen on."""

    def advance(self, now_s: float) -> None:
        """Compute the state at `now_s`. Called before any exchange at that time."""

    def receive(self, fileno: int, now_s: float) -> None:
        """Accept connections, read the bytes that have arrived, and act on them."""

    def emit(self, now_s: float) -> None:
        """Write all bytes that are due by `now_s`."""

    def due_s(self) -> float:
        """Time of its next action without a request, s; infinity for none."""

    def progress(self, key: str) -> tuple[int, int] | None:
        """Bytes (received, emitted) on the connection of this name; None without such a connection."""


class Clock(Protocol):
    """Seconds since a fixed instant that the clock chooses."""

    def now(self) -> float: ...

    def sleep(self, seconds: float) -> None: ...

    def wait_readable(self, wire: Wire, timeout_s: float) -> bool:
        """Wait until bytes, or the end of the connection, can be read. False after the time limit."""


class WallClock:
    """Real time, counted from `now_s` at construction."""

    def __init__(self, now_s: float = 0.0) -> None:
        self._origin_s = time.monotonic() - now_s

    def now(self) -> float:
        return time.monotonic() - self._origin_s

    def sleep(self, seconds: float) -> None:
        time.sleep(max(0.0, seconds))

    def wait_readable(self, wire: Wire, timeout_s: float) -> bool:
        return _readable([wire.fileno()], max(0.0, timeout_s)) != []


class SimulatedClock:
    """Time that moves only inside `sleep` and `wait_readable`."""

    def __init__(self, now_s: float = 0.0) -> None:
        self._now_s = now_s
        self._peers: list[Peer] = []
        self._bases: WeakKeyDictionary[Wire, tuple[int, int]] = WeakKeyDictionary()

    def attach(self, peer: Peer) -> None:
        """Include `peer` in the simulation from now on."""
        self._peers.append(peer)

    def restore(self, now_s: float) -> None:
        """Continue an earlier run at `now_s`, together with the states of its twins, while no byte is in flight."""
        self._now_s = now_s

    def now(self) -> float:
        return self._now_s

    def sleep(self, seconds: float) -> None:
        deadline = self._now_s + max(0.0, seconds)
        while self._now_s < deadline:
            idle = self._due_s() >= deadline
            self._now_s = deadline if idle else min(deadline, self._now_s + SLICE_S)
            step(self._peers, self._now_s)

    def wait_readable(self, wire: Wire, timeout_s: float) -> bool:
        deadline = self._now_s + max(0.0, timeout_s)
        start_s = time.monotonic()
        self._bases.setdefault(wire, self._progress(wire))
        while True:
            step(self._peers, self._now_s)
            outbound, inbound = self._bytes_in_flight(wire)
            if inbound > 0 or _readable([wire.fileno()], 0.0):
                if self._wait_arrival(wire, inbound):
                    return True
            elif outbound > 0:
                self._wait_for_peers(wire, start_s)
            elif self._now_s >= deadline:
                return False
            else:
                self._now_s = min(deadline, max(self._now_s, self._due_s()))

    def _due_s(self) -> float:
        return min((peer.due_s() for peer in self._peers), default=math.inf)

    def _progress(self, wire: Wire) -> tuple[int, int]:
        for peer in self._peers:
            if (progress := peer.progress(wire.key)) is not None:
                return progress
        return 0, 0

    def _bytes_in_flight(self, wire: Wire) -> tuple[int, int]:
        """Bytes in flight to the server, and from it."""
        received, emitted = self._progress(wire)
        base_received, base_emitted = self._bases[wire]
        return wire.sent - (received - base_received), emitted - base_emitted - wire.received

    def _wait_arrival(self, wire: Wire, count: int) -> bool:
        """Wait until all that was emitted can be read at once: how the kernel cuts it up must not matter.

        A backlog that is longer than one read arrives in parts, as does one for which the kernel opens no window before
        something is read. Returns True then as well: the rest arrives after the next read. A `count` of 0 is the end of
        the connection. Returns False if the kernel has dropped all of it; these bytes no longer count as in flight.
        """
        begin_s = growth_s = time.monotonic()
        pending = 0
        while count > 0 and (now_pending := _pending(wire.fileno())) < (count if count <= wire.chunk else 1):
            time.sleep(0)
            if now_pending != pending:
                pending, growth_s = now_pending, time.monotonic()
            if pending and not wire.lossy and time.monotonic() - growth_s > FULL_S:
                return True
            waited_s = time.monotonic() - begin_s
            if waited_s > DROPPED_S and wire.lossy:
                self._bases[wire] = self._bases[wire][0], self._bases[wire][1] + count
                return False
            if waited_s > STUCK_S:
                raise ClockStuck(f"{wire.key}: the simulated answer did not arrive", "Report this defect")
        return True

    def _wait_for_peers(self, wire: Wire, start_s: float) -> None:
        _readable(list(_filenos(self._peers)), 0.1)
        if time.monotonic() - start_s > STUCK_S:
            raise ClockStuck(f"{wire.key}: no simulated instrument took the request", "Attach it to the clock")


def step(peers: Sequence[Peer], now_s: float) -> None:
    """One turn of all servers: compute the state, read received bytes, write the due ones.

    All servers compute their state before any acts, so that no server sees changes of another at this instant.
    """
    ready = set(_readable(list(_filenos(peers)), 0.0))
    for peer in peers:
        peer.advance(now_s)
    for peer in peers:
        if ready:
            for fileno in ready.intersection(peer.filenos()):
                peer.receive(fileno, now_s)
        peer.emit(now_s)


def serve_forever(
    peers: Sequence[Peer], is_over: Callable[[], bool] = lambda: False, clock: Clock | None = None
) -> None:
    """Serve any client in real time until `is_over()` is true, with the servers that a simulated clock uses too.

    `clock` starts at the time of the servers' world; by default at 0.
    """
    clock = clock or WallClock()
    while not is_over():
        due = min(peer.due_s() for peer in peers) - clock.now()
        _readable(list(_filenos(peers)), min(max(0.0, due), TICK_S))
        step(peers, clock.now())


def _filenos(peers: Sequence[Peer]) -> Iterator[int]:
    for peer in peers:
        yield from peer.filenos()


def _pending(fileno: int) -> int:
    """Number of bytes that can be read now."""
    return int.from_bytes(fcntl.ioctl(fileno, termios.FIONREAD, bytes(4)), sys.byteorder)


def _readable(filenos: list[int], timeout_s: float) -> list[int]:
    """The `filenos` that can be read. With poll, because select stops at descriptor 1023."""
    poll = select.poll()
    for fileno in filenos:
        poll.register(fileno, select.POLLIN)
    return [fileno for fileno, _ in poll.poll(timeout_s * 1000)]
