"""A scripted instrument: it expects bytes written out in hexadecimal and answers with such bytes."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from drivers.clock import SimulatedClock
from drivers.transport import Address, Links
from drivers.transport.modbus import Unit
from drivers.transport.server import Connection, Port, Server

ANSWER_S = 0.001
RTU = "rtu+tcp://127.0.0.1:0"


class Script:
    """Pairs of (request, answer); an answer of "" is silence. Fails on any other request."""

    def __init__(self, listen: str, exchanges: list[tuple[str, str]]) -> None:
        self.port = Port(listen, self._answer)
        self.server = Server([self.port], {}, {})
        self.exchanges = list(exchanges)

    def _answer(self, connection: Connection, now_s: float) -> None:
        request = bytes(connection.inbox).hex(" ").upper()
        connection.inbox.clear()
        assert self.exchanges, f"nothing more was expected, but {request} came"
        expected, answer = self.exchanges.pop(0)
        assert request == expected
        if answer:
            connection.send(bytes.fromhex(answer), now_s + ANSWER_S)


@pytest.fixture
def clock() -> SimulatedClock:
    return SimulatedClock()


@pytest.fixture
def links(clock: SimulatedClock) -> Iterator[Links]:
    opened = Links(clock)
    yield opened
    opened.close()


@pytest.fixture
def script(clock: SimulatedClock) -> Iterator[Callable[..., Address]]:
    """Start a scripted instrument; gives its address. At the end nothing may be left unasked."""
    scripts: list[Script] = []

    def start(exchanges: list[tuple[str, str]], listen: str = RTU, unit: int = 1) -> Address:
        scripts.append(Script(listen, exchanges))
        clock.attach(scripts[-1].server)
        return Address(scripts[-1].server.url, unit)

    yield start
    for one in scripts:
        one.server.close()
        assert not one.exchanges, f"never asked: {one.exchanges}"


@pytest.fixture
def unit(script: Callable[..., Address], links: Links) -> Callable[..., Unit]:
    """A Modbus unit 1, called alpha, at a scripted instrument."""
    return lambda exchanges, listen=RTU: links.unit(script(exchanges, listen), "alpha")
