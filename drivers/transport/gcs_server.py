"""PI General Command Set 2.0, the instrument's side: parses the commands, and schedules the answers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol, TypeVar

from drivers.transport.server import Connection, Port

THINKING_S = 0.0005  # from the end of a command to the start of its answer
LATIN = "latin-1"  # one character is one byte
SYNTAX, UNKNOWN_COMMAND, OUT_OF_RANGE, PARAMETER_COUNT = 1, 2, 17, 24

Value = TypeVar("Value")


class Refusal(Exception):
    """Raised by a device that refuses a command: its error becomes `code`."""

    def __init__(self, code: int) -> None:
        super().__init__(f"error {code}")
        self.code = code


class Device(Protocol):
    """The function that answers a command."""

    def answer(self, command: str, now_s: float) -> str | None:
        """The answer to a line, or to a command of one byte; None without an answer."""


def gcs_port(listen: str, device: Device) -> Port:
    """A port that answers for `device`."""
    port = Port(listen)

    def answer(connection: Connection, now_s: float) -> None:
        for command in commands(connection.inbox):
            if (text := device.answer(command, now_s)) is not None:
                data = text.encode(LATIN)
                connection.send(data, now_s + THINKING_S + port.timing.line_s(len(data)))

    port.answer = answer
    return port


def commands(inbox: bytearray) -> Iterable[str]:
    """Remove all complete commands from `inbox`: single bytes below space, and lines that end with LF."""
    while inbox:
        if inbox[0] < ord(" "):
            length = 1
        elif (length := inbox.find(b"\n") + 1) == 0:
            return
        command = inbox[:length].decode(LATIN).rstrip("\r\n")
        del inbox[:length]
        if command:
            yield command


def lines(texts: Iterable[str]) -> str:
    """An answer of several lines."""
    return " \n".join(texts) + "\n"


def table(values: Iterable[tuple[object, object]]) -> str:
    """An answer of lines `key=value`."""
    return lines(f"{key}={value}" for key, value in values)


def groups(arguments: Sequence[str], size: int) -> list[Sequence[str]]:
    """Arguments that repeat, as in `MOV 1 10 2 20`; refused unless there are whole groups, and at least one."""
    if not arguments or len(arguments) % size:
        raise Refusal(PARAMETER_COUNT)
    return [arguments[k : k + size] for k in range(0, len(arguments), size)]


def one_of(text: str, allowed: Iterable[str], code: int) -> str:
    """`text`, refused with `code` unless it is known."""
    if text not in allowed:
        raise Refusal(code)
    return text


def number(text: str) -> float:
    """A decimal number."""
    return _convert(float, text)


def parse_integer(text: str, low: int, high: float) -> int:
    """An integer within its bounds, in decimal or as 0x hexadecimal."""
    value = _convert(lambda digits: int(digits, 0), text)
    if not low <= value <= high:
        raise Refusal(OUT_OF_RANGE)
    return value


def _convert(convert: Callable[[str], Value], text: str) -> Value:
    try:
        return convert(text)
    except ValueError:
        raise Refusal(SYNTAX) from None
