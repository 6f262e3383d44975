"""A wire to a server that is cut: what comes to this port goes on to the server's, until it is enough."""

from __future__ import annotations

import random
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

PIECE = 1 << 12
RESET = struct.pack("ii", 1, 0)  # SO_LINGER: closing sends a reset, as a wire that is cut may as well


class Enough(Exception):
    """The wire is cut here."""


# Told each piece before it goes on, and whether it comes from the server; raises Enough.
Judge = Callable[[bytes, bool], None]


class Wire:
    """Each connection has a judge of its own, made when it begins. `bytes`: how many have gone on so far."""

    def __init__(self, port: int, judge: Callable[[], Judge]) -> None:
        self.bytes = 0
        self._to, self._judge = port, judge
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listener.getsockname()[1]

    def serve(self) -> None:
        """Take connections until the listener is closed."""
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(("127.0.0.1", self._to))
                judge = self._judge()
                for ends in ((near, far, False), (far, near, True)):
                    threading.Thread(target=self._carry, args=(*ends, judge), daemon=True).start()

    def close(self) -> None:
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _carry(self, source: socket.socket, sink: socket.socket, from_server: bool, judge: Judge) -> None:
        with suppress(OSError, Enough):
            while piece := source.recv(PIECE):
                judge(piece, from_server)
                sink.sendall(piece)
                self.bytes += len(piece)
        for end in (source, sink):
            with suppress(OSError):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
                end.shutdown(socket.SHUT_RDWR)
                end.close()


@contextmanager
def wire(port: int, judge: Callable[[], Judge]) -> Iterator[Wire]:
    """A wire to `port` of this machine."""
    made = Wire(port, judge)
    thread = threading.Thread(target=made.serve, daemon=True)
    thread.start()
    try:
        yield made
    finally:
        made.close()
        thread.join()


def after_bytes(draw: Callable[[], float]) -> Callable[[], Judge]:
    """Each connection ends after as many bytes, either way, as are drawn for it."""

    def begin() -> Judge:
        left = draw()

        def judge(piece: bytes, _: bool) -> None:
            nonlocal left
            left -= len(piece)
            if left < 0:
                raise Enough

        return judge

    return begin


def at_random(seed: int, most: int) -> Callable[[], Judge]:
    """Each connection ends after a random number of bytes below `most`; the same for the same seed, if one by one."""
    chance = random.Random(seed)
    return after_bytes(lambda: chance.randrange(most))


def whole() -> Judge:
    """Of a wire that is not cut."""
    return lambda *_: None
