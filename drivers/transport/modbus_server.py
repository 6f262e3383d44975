"""Modbus slave: simulated devices answer the requests on a port, with the delays of the line.

An absent unit sends nothing, as on RS-485. The same holds after a request with a wrong checksum.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.pdu import bit_message as bits
from pymodbus.pdu import register_message as words

from drivers.transport.address import Url
from drivers.transport.faults import Faults, Kind, Wire
from drivers.transport.server import Connection, Port

MODBUS_FAULTS = {"exception": Kind("answers every request with this exception", 4, least=1)}
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE, DEVICE_FAILURE = 1, 2, 3, 4


class Refusal(Exception):
    """Raised by a device to answer with the exception `code`."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}")
        self.code = code


class Device(Protocol):
    """A unit's registers. Raises Refusal for a register that it does not have."""

    faults: Faults
    functions: frozenset[int]  # the Modbus functions of the unit; others are refused before they reach it
    thinking_s: float  # from the end of a request to the start of its answer

    def read_words(self, address: int, count: int, now_s: float) -> Sequence[int]: ...

    def write_words(self, address: int, values: Sequence[int], now_s: float) -> None: ...


class BitDevice(Device, Protocol):
    """A unit that has bits as well: functions 01, 02, 05."""

    def read_bits(self, address: int, count: int) -> Sequence[bool]: ...

    def write_bit(self, address: int, on: bool, now_s: float) -> None: ...


def modbus_port(listen: str, devices: Mapping[int, Device]) -> Port:
    """A port that answers for `devices`, by unit id."""
    port = Port(listen)
    port.answer = Responder(devices, port.timing).answer
    port.wire = RTU if port.timing.rtu else TCP
    return port


def _place(place: int) -> Callable[[bytes], int | None]:
    """A function that reads the unit's number at its place in a frame."""
    return lambda frame: frame[place] if len(frame) > place else None


def _rtu_of_unit(frame: bytes, unit: int) -> bytes:
    """The frame of another unit, with its checksum."""
    body = bytes([unit % 256]) + frame[1:-2]
    return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")


def _tcp_of_unit(frame: bytes, unit: int) -> bytes:
    return frame[:6] + bytes([unit % 256]) + frame[7:]


RTU = Wire(mends=False, unit_of=_place(0), of_unit=_rtu_of_unit)
TCP = Wire(mends=True, unit_of=_place(6), of_unit=_tcp_of_unit)


class Responder:
    """Makes answers to the requests of a connection, each due after its line time."""

    def __init__(self, devices: Mapping[int, Device], timing: Url) -> None:
        self._devices, self._timing = devices, timing
        decoder = DecodePDU(is_server=True)
        self._framer = FramerRTU(decoder) if timing.rtu else FramerSocket(decoder)

    def answer(self, connection: Connection, now_s: float) -> None:
        """Handle every whole request in the inbox."""
        while connection.inbox:
            data = bytes(connection.inbox)
            try:
                used, request = self._framer.handleFrame(data, 0, 0)
            except ModbusException:  # pymodbus does not know the function: no answer
                used, request = len(data), None
            del connection.inbox[:used]
            if request is None:
                return
            self._handle(connection, request, used, now_s)

    def _handle(self, connection: Connection, request: ModbusPDU, length: int, now_s: float) -> None:
        device = self._devices.get(request.dev_id)
        if device is None:
            return
        answer = respond(device, request, now_s)
        answer.dev_id, answer.transaction_id = request.dev_id, request.transaction_id
        frame = self._framer.buildFrame(answer)
        delay_s = self._timing.line_s(length) + device.thinking_s + self._timing.line_s(len(frame))
        connection.send(frame, now_s + delay_s)


def respond(device: Device, request: ModbusPDU, now_s: float) -> ModbusPDU:
    """The device's answer, an exception answer included."""
    if (code := device.faults.size("exception", now_s)) is not None:
        return ExceptionResponse(request.function_code, int(code))
    handler = HANDLERS.get(request.function_code)
    if handler is None or request.function_code not in device.functions:
        return ExceptionResponse(request.function_code, ILLEGAL_FUNCTION)
    try:
        return handler(device, request, now_s)
    except Refusal as refusal:
        return ExceptionResponse(request.function_code, refusal.code)


def _read_coils(device: BitDevice, request: ModbusPDU, _now_s: float) -> ModbusPDU:
    return bits.ReadCoilsResponse(bits=device.read_bits(request.address, request.count))


def _read_inputs(device: BitDevice, request: ModbusPDU, _now_s: float) -> ModbusPDU:
    return bits.ReadDiscreteInputsResponse(bits=device.read_bits(request.address, request.count))


def _read_holding(device: Device, request: ModbusPDU, now_s: float) -> ModbusPDU:
    return words.ReadHoldingRegistersResponse(registers=device.read_words(request.address, request.count, now_s))


def _read_input(device: Device, request: ModbusPDU, now_s: float) -> ModbusPDU:
    return words.ReadInputRegistersResponse(registers=device.read_words(request.address, request.count, now_s))


def _write_coil(device: BitDevice, request: ModbusPDU, now_s: float) -> ModbusPDU:
    device.write_bit(request.address, request.bits[0], now_s)
    return bits.WriteSingleCoilResponse(address=request.address, bits=request.bits)


def _write_word(device: Device, request: ModbusPDU, now_s: float) -> ModbusPDU:
    device.write_words(request.address, request.registers, now_s)
    return words.WriteSingleRegisterResponse(address=request.address, registers=request.registers)


def _write_words(device: Device, request: ModbusPDU, now_s: float) -> ModbusPDU:
    if request.count != len(request.registers):
        raise Refusal(ILLEGAL_VALUE)
    device.write_words(request.address, request.registers, now_s)
    return words.WriteMultipleRegistersResponse(address=request.address, count=request.count)


def _read_write(device: Device, request: ModbusPDU, now_s: float) -> ModbusPDU:
    assert isinstance(request, words.ReadWriteMultipleRegistersRequest)  # noqa: S101 - its function is 17h
    device.write_words(request.write_address, request.write_registers, now_s)
    values = device.read_words(request.read_address, request.read_count, now_s)
    return words.ReadWriteMultipleRegistersResponse(registers=values)


HANDLERS: dict[int, Callable[[Any, ModbusPDU, float], ModbusPDU]] = {
    1: _read_coils,
    2: _read_inputs,
    3: _read_holding,
    4: _read_input,
    5: _write_coil,
    6: _write_word,
    16: _write_words,
    23: _read_write,
}
