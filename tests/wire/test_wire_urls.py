"""Addresses of wires, and the time that bytes need on them."""

from __future__ import annotations

import re

import pytest

from drivers.clock import SimulatedClock
from drivers.errors import LinkRefused
from drivers.transport.address import Url
from drivers.transport.link import open_link


def test_a_serial_line_is_taken_apart() -> None:
    url = Url.parse("serial:/dev/ttyUSB0?baud=9600&parity=E&stop=2")
    assert (url.path, url.baud, url.parity, url.stop_bits) == ("/dev/ttyUSB0", 9600, "E", 2)
    assert url.rtu


def test_an_address_of_a_socket_is_parsed() -> None:
    url = Url.parse("tcp://10.0.0.7:502")
    assert (url.host, url.port, url.rtu) == ("10.0.0.7", 502, False)
    assert Url.parse("rtu+tcp://10.0.0.7:4001").rtu


def test_datagrams_have_a_place_here_or_there() -> None:
    here, there = Url.parse("udpin://0.0.0.0:14550"), Url.parse("udpout://10.0.0.7:14550")
    assert (here.port, here.rtu, there.host, there.rtu) == (14550, False, "10.0.0.7", False)
    assert here.line == Url.parse("udpin://127.0.0.1:14550").line  # one program has the port
    assert len({here.line, there.line, Url.parse("tcp://10.0.0.7:14550").line}) == 3
    assert here.on_a_network
    assert not Url.parse("udpin://127.0.0.1:14550").on_a_network


@pytest.mark.parametrize(
    "text",
    ["", "10.0.0.7", "tcp://", "udpin:", "http://a:1", "serial:", "serial:/dev/x?parity=Q", "serial:/dev/x?bauds=9600",
     "tcp://a:port", "serial:/dev/x?baud=fast", "serial:/dev/x?baud"],
)  # fmt: skip
def test_what_is_no_wire_is_refused_with_the_right_form(text: str) -> None:
    with pytest.raises(LinkRefused, match="Write tcp://host:port"):
        Url.parse(text)


def test_a_byte_with_parity_is_eleven_bits() -> None:
    even = Url.parse("serial:/dev/x?baud=9600&parity=E")
    none = Url.parse("serial:/dev/x?baud=9600&parity=N")
    assert even.character_s == pytest.approx(11 / 9600)
    assert none.line_s(100) == pytest.approx(103.5 * 10 / 9600)  # 3.5 characters of silence end a frame
    assert Url.parse("serial:/dev/x?baud=115200").gap_s == 1.75e-3  # fixed above 19200 baud


@pytest.mark.parametrize("url", ["tcp://lab", "rtu+tcp://10.0.0.7", "udpin://0.0.0.0", "udpout://lab"])
def test_an_address_on_a_network_needs_a_port(url: str) -> None:
    with pytest.raises(LinkRefused, match=f"'{re.escape(url)}' has no port. Write {re.escape(url)}:PORT"):
        Url.parse(url)


def test_a_port_nobody_listens_on_is_refused() -> None:
    with pytest.raises(LinkRefused, match=r"tcp://127.0.0.1:1: cannot be opened .* Check the address"):
        open_link("tcp://127.0.0.1:1", SimulatedClock())


def test_a_serial_line_that_is_not_there_is_refused() -> None:
    with pytest.raises(LinkRefused, match=r"line: cannot be opened \(No such file or directory\)\. Check the device's"):
        open_link("serial:/dev/no-such-line", SimulatedClock())
