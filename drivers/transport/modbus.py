"""Modbus master: one request, one answer, in bounded time. Frames and PDUs are pymodbus'; wire, time, retries ours.

`Bus` is the wire, shared by the instruments on it; `Unit` is one instrument of a bus.
Every failure is raised with the instrument, the register and a remedy (see drivers.errors).
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU, ModbusPDU
from pymodbus.pdu.bit_message import ReadDiscreteInputsRequest, WriteSingleCoilRequest
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from drivers.errors import BadFrame, LinkError, LinkRefused, LinkTimeout, Refused, WrongUnit
from drivers.transport.address import Url
from drivers.transport.link import Link

Kind = Literal["int16", "uint16", "int32", "uint32", "float32"]
CODES: dict[Kind, str] = {"int16": ">h", "uint16": ">H", "int32": ">i", "uint32": ">I", "float32": ">f"}


@dataclass(frozen=True)
class Register:
    """One value in an instrument's table; 32-bit values take two words, the high word first.

    `scale` is the value of one count in `unit`; a value is always in `unit`, words are as on the wire.
    """

    address: int
    kind: Kind
    doc: str
    unit: str = ""
    scale: float = 1.0

    def __str__(self) -> str:
        return f"register 0x{self.address:04X} ({self.doc})"

    @property
    def count(self) -> int:
        """Number of 16-bit words."""
        return struct.calcsize(CODES[self.kind]) // 2

    def decode(self, words: Sequence[int]) -> float:
        """The value of `words`, in `unit`."""
        raw = struct.unpack(CODES[self.kind], struct.pack(f">{self.count}H", *words))[0]
        return float(raw) * self.scale

    def encode(self, value: float) -> list[int]:
        """The words of `value`, rounded to the nearest count. Raises ValueError when it does not fit."""
        raw = value / self.scale
        try:
            packed = struct.pack(CODES[self.kind], raw if self.kind == "float32" else round(raw))
        except (struct.error, OverflowError) as error:
            raise ValueError(f"{value:g} {self.unit} does not fit into {self}") from error
        return list(struct.unpack(f">{self.count}H", packed))


logging.getLogger("pymodbus").addHandler(logging.NullHandler())  # our errors describe bad frames

TIMEOUT_S = 0.5  # for one answer; the slowest instrument needs a tenth of it
LATE_S = 2 * TIMEOUT_S  # of silence: then no answer to an earlier request arrives any more
REPEATED = (LinkTimeout, BadFrame, WrongUnit)  # after these a request is repeated
RETRIES = 2  # of a request, unless it may not be repeated
LINE_CHECKS = (  # what to check after silence, and after noise
    "that baud rate and parity are the instrument's",
    "shielding, termination, baud rate and parity of the line",
)
NETWORK_CHECKS = (
    "that nothing else has the instrument's address",
    "that this address and port are the instrument's, and speak Modbus TCP",
)
WRITES = (WriteSingleCoilRequest, WriteSingleRegisterRequest, WriteMultipleRegistersRequest)
REFUSALS = {
    1: ("it does not know the function", "Check that the model of the instrument is the one in the bench file"),
    2: ("it has no such register", "Check that the model of the instrument is the one in the bench file"),
    3: ("the value is not allowed", "Check the settings in the bench file against the instrument's manual"),
    4: ("it failed to do so", "Look at the instrument's display or alarm, clear the cause, then try again"),
    6: ("it is busy", "Wait until it has finished, then try again"),
}


class Bus:
    """One wire with Modbus on it: RTU frames, or TCP frames with transaction numbers."""

    def __init__(self, link: Link) -> None:
        self.link = link
        self._url = Url.parse(link.url)
        decoder = DecodePDU(is_server=False)
        self._framer = FramerRTU(decoder) if self._url.rtu else FramerSocket(decoder)
        self._checks = LINE_CHECKS if self._url.rtu else NETWORK_CHECKS
        self._transaction = 0
        self._late_expected = False  # whether answers to earlier requests may still arrive

    def ask(self, request: ModbusPDU, unit: int, action: str, retries: int = RETRIES) -> ModbusPDU:
        """The answer of `unit`; `action` begins every error, as in 'alpha: reading register 0x0080 (alarm)'.

        Raises Refused, or after the retries LinkTimeout, BadFrame or WrongUnit.
        """
        request.dev_id = unit
        self._discard_late_answers(request)
        try:
            for _ in range(retries):
                try:
                    return self._attempt(request, action)
                except REPEATED:
                    self.link.discard(self._url.gap_s)
            return self._attempt(request, action)
        except LinkRefused as link_error:
            raise LinkRefused(f"{action}: {link_error.what}", link_error.remedy) from link_error

    def _discard_late_answers(self, request: ModbusPDU) -> None:
        """RTU frames do not identify their request: a late answer must not count as that of the next request.

        The echo of a write names its register, so a write, which may be a stop, need not wait.
        """
        if self._late_expected and not isinstance(request, WRITES):
            self.link.discard(LATE_S)
            self._late_expected = False

    def _attempt(self, request: ModbusPDU, action: str) -> ModbusPDU:
        self._transaction = request.transaction_id = self._transaction % 0xFFFF + 1
        self.link.discard()
        self.link.write(self._framer.buildFrame(request))
        answer = self._receive(action)
        if self._url.scheme == "serial":  # a converter keeps the silence between frames itself
            self.link.clock.sleep(self._url.gap_s)
        if answer.dev_id != request.dev_id:
            raise WrongUnit(
                f"{action}: unit {answer.dev_id} answered instead of unit {request.dev_id}",
                "Give every instrument on the bus a unit id of its own",
            )
        if answer.isError() and answer.function_code & 0x7F == request.function_code:
            raise _refusal(action, answer.exception_code)
        if not _belongs(request, answer):
            raise self._bad_frame(action, "received the answer to another request")
        return answer

    def _receive(self, action: str) -> ModbusPDU:
        data = b""
        for next_bytes in self.link.until(self.link.clock.now() + TIMEOUT_S):
            data += next_bytes
            used, answer = self._decode(data, action)
            if answer is not None:
                return answer
            data = data[used:]
        self._late_expected = self._url.rtu
        if data:
            raise self._bad_frame(action, f"received {len(data)} bytes that are not an answer ({data[:16].hex(' ')})")
        raise LinkTimeout(
            f"{action}: no answer within {TIMEOUT_S:g} s on {self.link.url}",
            f"Check power, cable and unit id, and {self._checks[0]}",
        )

    def _decode(self, data: bytes, action: str) -> tuple[int, ModbusPDU | None]:
        """Number of decoded bytes, and the answer if there is one; a TCP frame of an earlier request is skipped."""
        expected = 0 if self._url.rtu else self._transaction
        try:
            used, answer = self._framer.handleFrame(data, 0, expected)
        except ModbusException as error:
            raise self._bad_frame(action, str(error)) from error
        if self._url.rtu and used and answer is None:
            raise self._bad_frame(action, f"the checksum of {data[:16].hex(' ')} is wrong")
        return used, answer

    def _bad_frame(self, action: str, fault: str) -> LinkError:
        return BadFrame(f"{action}: {fault}", f"Check {self._checks[1]}")


class Unit:
    """One instrument on a bus: its registers read and written as values in their units."""

    def __init__(self, bus: Bus, unit: int, name: str) -> None:
        self._bus, self._unit, self.name = bus, unit, name

    def read(self, register: Register) -> float:
        """The value of one register."""
        return self.read_block(register)[0]

    def read_block(self, *registers: Register) -> list[float]:
        """The values of neighbouring registers, lowest address first, in one exchange."""
        first, last = registers[0], registers[-1]
        words = self.read_words(first.address, last.address + last.count - first.address, str(first))
        return [r.decode(words[r.address - first.address :][: r.count]) for r in registers]

    def read_words(self, address: int, count: int, doc: str) -> Sequence[int]:
        """`count` words as on the wire."""
        request = ReadHoldingRegistersRequest(address=address, count=count)
        return self._bus.ask(request, self._unit, f"{self.name}: reading {doc}").registers

    def write(self, register: Register, value: float, retries: int = RETRIES) -> None:
        """Set one register; one word goes as function 06, two as 10h."""
        words = register.encode(value)
        if len(words) > 1:
            self.write_words(register.address, words, str(register), retries)
        else:
            request = WriteSingleRegisterRequest(address=register.address, registers=words)
            self._bus.ask(request, self._unit, f"{self.name}: writing {register}", retries)

    def write_block(self, *values: tuple[Register, float], retries: int = RETRIES) -> None:
        """Set registers that follow each other without a gap, in one exchange."""
        words = [word for register, value in values for word in register.encode(value)]
        self.write_words(values[0][0].address, words, str(values[0][0]), retries)

    def write_words(self, address: int, words: Sequence[int], doc: str, retries: int = RETRIES) -> None:
        """Set neighbouring words as on the wire."""
        request = WriteMultipleRegistersRequest(address=address, registers=words)
        self._bus.ask(request, self._unit, f"{self.name}: writing {doc}", retries)

    def read_bit(self, address: int, doc: str) -> bool:
        """One discrete input (function 02)."""
        request = ReadDiscreteInputsRequest(address=address, count=1)
        return bool(self._bus.ask(request, self._unit, f"{self.name}: reading bit 0x{address:04X} ({doc})").bits[0])

    def write_bit(self, address: int, on: bool, doc: str) -> None:
        """Set one coil (function 05)."""
        request = WriteSingleCoilRequest(address=address, bits=[on])
        self._bus.ask(request, self._unit, f"{self.name}: writing bit 0x{address:04X} ({doc})")


def _belongs(request: ModbusPDU, answer: ModbusPDU) -> bool:
    """Whether the answer belongs to this request: on a serial line a late answer to another may come first."""
    if answer.function_code != request.function_code:
        return False
    if isinstance(request, ReadHoldingRegistersRequest):
        return len(answer.registers) == request.count
    return isinstance(request, ReadDiscreteInputsRequest) or answer.address == request.address


def _refusal(action: str, code: int) -> Refused:
    explanation, remedy = REFUSALS.get(code, ("it declined", "Look the code up in the instrument's manual"))
    return Refused(f"{action}: exception {code}, {explanation}", remedy, code)
