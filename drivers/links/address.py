"""Where an instrument is found."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Address:
    """A wire and the place on it.

    `url` is one of
        tcp://host:port                             Modbus TCP, GCS
        rtu+tcp://host:port                         Modbus RTU frames through a converter on TCP
        serial:/dev/ttyUSB0?baud=115200&parity=E    a serial line (parity N, E or O): Modbus RTU, GCS, text
    `unit` is the Modbus unit id; instruments with the same url share the wire.
    `stream_url` is the second port of an instrument that has one.
    """

    url: str
    unit: int = 1
    stream_url: str | None = None
