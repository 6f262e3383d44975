"""The simulated LabJack T7: registers, flash, and a stream that turns the world's volts into codes in blocks."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from drivers.labjack_t7 import registers as t7
from drivers.labjack_t7.driver import Settings
from drivers.labjack_t7.registers import HIGHEST_CODE
from drivers.labjack_t7.stream import BUFFER_FULL, FUNCTION, KIND, RECOVERED, UNIT, RangeCalibration, packet_type
from drivers.transport.address import Address
from drivers.transport.faults import Faults, Kind
from drivers.transport.modbus import Register
from drivers.transport.modbus_server import (
    DEVICE_FAILURE,
    ILLEGAL_ADDRESS,
    ILLEGAL_VALUE,
    MODBUS_FAULTS,
    Refusal,
    modbus_port,
)
from drivers.transport.server import Port, Server, Twin
from drivers.world.kernel import kernel

if TYPE_CHECKING:
    from drivers.world.batch import AnyWorld

# What can be wrong with the simulated T7's stream.

FAULTS = {
    **MODBUS_FAULTS,
    "overflow": Kind("skips this number of scans and reports it, once", 50, "scan", least=1),
    "buffer-full": Kind("reports a full buffer and stops the stream, once"),
    "stall": Kind("sends no data after the start of a stream"),
    "lost-packet": Kind("leaves out this packet of a stream, counted from 1", 2, least=1),
    "duplicated-packet": Kind("sends the second packet of a stream twice"),
    "swapped-packets": Kind("sends the second packet of a stream after the third"),
    "clock-step": Kind("its clock stops for this time during a stream, once", 0.5, "s", least=0.001),
    "over-range": Kind("the first input is sometimes out of range"),
    "endless": Kind("ignores the command to stop the stream"),
    "open-interlock": Kind("the contact at this digital line opens", 4, least=0),
    "restart": Kind("loses power for a moment: loses its settings and connections, once"),
}


def spoilt(data: bytes, samples: int, faults: Faults, now_s: float) -> bytes:
    """Packets of this number of samples, as from a stream with these faults."""
    packets = np.frombuffer(bytearray(data), packet_type(samples))
    if faults.size("stall", now_s) is not None:
        return b""
    if faults.size("over-range", now_s) is not None:
        packets["samples"][:, 0] = HIGHEST_CODE
    if strike := faults.once("overflow", now_s):
        packets["status"][0], packets["additional"][0] = RECOVERED, strike.size
    if faults.once("buffer-full", now_s):
        packets["status"][-1] = BUFFER_FULL
    return bytes(packets[_order(packets["transaction"].astype(np.int64), faults, now_s)].tobytes())


def _order(numbers: NDArray[np.int64], faults: Faults, now_s: float) -> NDArray[np.intp]:
    """The order in which packets with these transaction numbers are sent, as indices."""
    order = np.arange(len(numbers), dtype=np.intp)
    if (lost_packet := faults.size("lost-packet", now_s)) is not None:
        return np.flatnonzero(numbers != lost_packet - 1)
    if faults.size("duplicated-packet", now_s) is not None:
        return np.asarray(np.repeat(order, np.where(numbers == 1, 2, 1)))
    if faults.size("swapped-packets", now_s) is not None:
        return np.argsort(np.where(numbers == 1, 2.5, numbers), kind="stable")
    return order


def ends(data: bytes, samples: int) -> bool:
    """Whether these are the last packets of a stream whose buffer ran over."""
    return bool(data) and bool(np.frombuffer(data, packet_type(samples))["status"][-1] == BUFFER_FULL)


__all__ = ["FAULTS", "LISTEN", "serve"]

LISTEN = "tcp://127.0.0.1:0"
SERIAL, FIRMWARE = 470012345, 1.0312
THINKING_S = 0.0005

# An individual: the nominal constants of a T7, each a little off, as FLOAT32 like in its flash.
_NOMINAL = [(10.0, 3.1580578e-4), (1.0, 3.1580578e-5), (0.1, 3.1580578e-6), (0.01, 3.1580578e-7)]
_CONSTANTS = [
    constant
    for volts, slope in _NOMINAL
    for constant in (slope * 1.00021, -slope * 1.00017, 33518.4, -1.0585324 * volts)
]
FLASH_BYTES = struct.pack(">41f", *_CONSTANTS, *_CONSTANTS, *(13200.0, 300.0) * 2, -92.6, 467.6, 1e-5, 2e-4, 0.0)
FLASH_WORDS = struct.unpack(">82H", FLASH_BYTES)


class Inputs:
    """The analog inputs: their connections to the world, and the converter behind them."""

    def __init__(self, world: AnyWorld, wiring: Mapping[int, str]) -> None:
        self._world, self._wiring = world, wiring

    def codes(
        self, numbers: Sequence[int], ranges_v: Sequence[float], start_s: float, interval_s: float, n: int
    ) -> NDArray[np.uint16]:
        """Codes of `n` scans, shape (n, inputs). An open input reads 0 V."""
        constants = [RangeCalibration.from_flash(FLASH_WORDS, range_v) for range_v in ranges_v]
        return codes_of_volts(self._volts(numbers, start_s, interval_s, n), constants)

    def _volts(self, numbers: Sequence[int], start_s: float, interval_s: float, n: int) -> NDArray[np.float64]:
        wired = [k for k, number in enumerate(numbers) if number in self._wiring]
        names = [self._wiring[numbers[k]] for k in wired]
        if len(wired) == len(numbers):
            return self._world.adc_volts(names, start_s, interval_s, n)
        volts = np.zeros((n, len(numbers)))
        if wired:
            volts[:, wired] = self._world.adc_volts(names, start_s, interval_s, n)
        return volts


def codes_of_volts(volts: NDArray[np.float64], ranges: Sequence[RangeCalibration]) -> NDArray[np.uint16]:
    """The converter: nearest code of each column, clipped at the ends of its range."""
    constants = np.array([(c.positive_slope, c.negative_slope, c.center) for c in ranges])
    codes = np.empty(volts.shape, np.uint16)
    _round(volts, constants, codes)
    return codes


@kernel
def _round(volts: NDArray[np.float64], constants: NDArray[np.float64], codes: NDArray[np.uint16]) -> None:
    for i in range(len(volts)):
        for k in range(len(constants)):
            positive, negative, center = constants[k]
            distance = volts[i, k] / positive if volts[i, k] >= 0 else -volts[i, k] / negative
            codes[i, k] = min(max(np.rint(center + distance), 0.0), 65535.0)


class Stream:
    """A running stream: scan i is taken i intervals after the start, a packet leaves when it is full.

    Its clock has 25 ns, so all times are whole ns: however time is cut into steps, each scan has its own.
    """

    def __init__(
        self, scan: Callable[[float, float, int], NDArray[np.uint16]], start_s: float, interval_ns: int,
        channels: int, per_packet: int,
    ) -> None:  # fmt: skip
        self._scan, self._start_ns, self._interval_ns = scan, round(1e9 * start_s), interval_ns
        self._channels, self.per_packet = channels, per_packet
        self._scans = self._packets = 0
        self._unsent = np.empty(0, np.uint16)

    def packets_until(self, now_s: float) -> bytes:
        """Take all scans that have begun; the packets that became full."""
        new = (round(1e9 * now_s) - self._start_ns) // self._interval_ns + 1 - self._scans
        if new <= 0:
            return b""
        codes = self._scan(self._time_s(self._scans), 1e-9 * self._interval_ns, new)
        self._scans += new
        samples = np.concatenate([self._unsent, codes.ravel()])
        count = len(samples) // self.per_packet
        self._unsent = samples[count * self.per_packet :]
        return self._pack(samples[: count * self.per_packet].reshape(count, self.per_packet))

    def stand_still(self, seconds: float) -> None:
        """Delay all further scans by this time, without a sign in the data."""
        self._start_ns += round(1e9 * seconds)

    def due_s(self) -> float:
        """When the next packet is full: at its last scan."""
        return self._time_s(-(-(self._packets + 1) * self.per_packet // self._channels) - 1)

    def _time_s(self, scan: int) -> float:
        return 1e-9 * (self._start_ns + scan * self._interval_ns)

    def _pack(self, samples: NDArray[np.uint16]) -> bytes:
        layout = packet_type(self.per_packet)
        packets = np.zeros(len(samples), layout)
        packets["transaction"] = (self._packets + np.arange(len(samples))) % 65536
        packets["length"] = layout.itemsize - 6
        packets["unit"], packets["function"], packets["kind"] = UNIT, FUNCTION, KIND
        packets["samples"] = samples
        self._packets += len(samples)
        return packets.tobytes()


class Converter(Twin):
    """The device behind its registers."""

    functions = frozenset({3, 4, 6, 16})
    thinking_s = THINKING_S

    def __init__(self, world: AnyWorld, settings: Settings, stream_port: Port) -> None:
        self.faults = Faults()
        self.ports = [stream_port]
        self._world, self._power_dio, self._port = world, settings.power_dio, stream_port
        self._inputs = Inputs(world, {number: name for name, number in settings.wired.items()})
        self._closed = sum(1 << line for line in settings.interlocks.values())
        self._stream: Stream | None = None
        self._words = _initial_words()

    def advance(self, now_s: float) -> None:
        if self.faults.once("restart", now_s):
            self._restart()
        if self._stream and (strike := self.faults.once("clock-step", now_s)):
            self._stream.stand_still(strike.size)
        if self._stream and (packets := self._stream.packets_until(now_s)):
            self._send(spoilt(packets, self._stream.per_packet, self.faults, now_s) if self.faults else packets, now_s)

    def due_s(self) -> float:
        return self._stream.due_s() if self._stream else math.inf

    def read_words(self, address: int, count: int, now_s: float) -> Sequence[int]:
        if address < 2 * t7.INPUTS:
            return self._read_inputs(address, count, now_s)
        if address == t7.FLASH:
            return self._read_flash(count)
        self._set(t7.CORE_TIMER, round(now_s * t7.CORE_HZ) % 2**32)
        self._set(t7.LINES_STATE, self._lines(now_s))
        return [self._known_word(a) for a in range(address, address + count)]

    def write_words(self, address: int, values: Sequence[int], now_s: float) -> None:
        for offset, value in enumerate(values):
            self._known_word(address + offset)
            self._words[address + offset] = value
        if address <= t7.ENABLE.address + 1 < address + len(values):
            self._enable(bool(self._value(t7.ENABLE)), now_s)
        if self._power_dio is not None and address == t7.dio(self._power_dio).address:
            self._world.advance(now_s)
            self._world.power(bool(values[0]))

    def _send(self, packets: bytes, now_s: float) -> None:
        for connection in self._port.connections.values() if packets else ():
            connection.send(packets, now_s)
        if self.faults and self._stream and ends(packets, self._stream.per_packet):
            self._stream = None

    def _restart(self) -> None:
        """Restart as after power-on; the digital lines are then high."""
        self._stream, self._words = None, _initial_words()
        self._world.power(True)
        for port in self.ports:
            port.hang_up()

    def _enable(self, on: bool, now_s: float) -> None:
        if on and self._stream:
            self._fail(t7.STREAM_ACTIVE)
        if not on and not self._stream:
            self._fail(t7.NOT_RUNNING)
        if on or self.faults.size("endless", now_s) is None:
            self._stream = self._new_stream(now_s) if on else None

    def _new_stream(self, now_s: float) -> Stream:
        """A stream with the settings of the registers. Only continuous streams are simulated."""
        channels, per_packet = int(self._value(t7.NUM_ADDRESSES)), int(self._value(t7.SAMPLES_PER_PACKET))
        rate_hz, buffer = self._value(t7.SCAN_RATE), int(self._value(t7.BUFFER_SIZE))
        if not 0 < channels <= t7.MOST_ADDRESSES or self._value(t7.NUM_SCANS):
            self._forget_enable()
            raise Refusal(ILLEGAL_VALUE)
        if not 0 < rate_hz * channels <= t7.MOST_SAMPLES_PER_S:
            self._fail(t7.BAD_RATE)
        if not 0 < per_packet <= t7.MOST_SAMPLES_PER_PACKET:
            self._fail(t7.BAD_PACKET)
        if buffer > t7.LARGEST_BUFFER or buffer & (buffer - 1):
            self._fail(t7.BAD_BUFFER)
        core_ticks = round(t7.CORE_HZ / rate_hz)
        self._set(t7.ACTUAL_RATE, t7.CORE_HZ / core_ticks)
        return Stream(self._scanner(channels), now_s, core_ticks * t7.CORE_NS, channels, per_packet)

    def _scanner(self, channels: int) -> Callable[[float, float, int], NDArray[np.uint16]]:
        """Takes n scans of the scan list from a time on, at an interval."""
        numbers = [int(self._value(t7.scan_list(k))) // 2 for k in range(channels)]
        ranges_v = [self._range_v(number) for number in numbers]
        return lambda start_s, interval_s, n: self._inputs.codes(numbers, ranges_v, start_s, interval_s, n)

    def _read_inputs(self, address: int, count: int, now_s: float) -> list[int]:
        if self._stream:
            self._fail(t7.STREAM_ACTIVE)
        if address % 2 or count % 2 or address + count > 2 * t7.INPUTS:
            raise Refusal(ILLEGAL_ADDRESS)
        words: list[int] = []
        self._world.advance(now_s)
        for number in range(address // 2, (address + count) // 2):
            range_v = self._range_v(number)
            code = self._inputs.codes([number], [range_v], now_s, 0.0, 1)[0, 0]
            words += t7.ain(number).encode(RangeCalibration.from_flash(FLASH_WORDS, range_v).table()[code])
        return words

    def _read_flash(self, count: int) -> Sequence[int]:
        first = (int(self._value(t7.FLASH_POINTER)) - t7.CALIBRATION_ADDRESS) // 2
        if first < 0 or first + count > len(FLASH_WORDS):
            raise Refusal(ILLEGAL_VALUE)
        return FLASH_WORDS[first : first + count]

    def _range_v(self, number: int) -> float:
        """The smallest range that contains the requested one; 0 requests the widest."""
        range_v = self._value(t7.ain_range(number))
        return min((r for r in t7.RANGES_V if r >= round(range_v, 6) > 0), default=t7.RANGES_V[0])

    def _fail(self, detail: int) -> None:
        """Decline, and leave the reason where a client looks for it."""
        self._forget_enable()
        self._set(t7.LAST_ERROR, detail)
        raise Refusal(DEVICE_FAILURE)

    def _forget_enable(self) -> None:
        self._set(t7.ENABLE, int(self._stream is not None))

    def _known_word(self, address: int) -> int:
        if address not in self._words:
            raise Refusal(ILLEGAL_ADDRESS)
        return self._words[address]

    def _value(self, register: Register) -> float:
        return register.decode([self._words[register.address + i] for i in range(register.count)])

    def _lines(self, now_s: float) -> int:
        """The digital lines: high, but for contacts that are closed and outputs that are off."""
        line = self.faults.size("open-interlock", now_s)
        closed_contacts = self._closed & ~(0 if line is None else 1 << int(line))
        off = sum(1 << n for n in range(t7.LINES) if not self._value(t7.dio(n)))
        return (1 << t7.LINES) - 1 & ~closed_contacts & ~off

    def _set(self, register: Register, value: float) -> None:
        self._words.update(zip(range(register.address, register.address + 2), register.encode(value), strict=True))


def _initial_words() -> dict[int, int]:
    """All registers that exist, by address, as after power-on."""
    values: dict[Register, float] = {t7.ain_range(n): 10.0 for n in range(t7.INPUTS)}
    values |= {t7.ain_negative(n): t7.SINGLE_ENDED for n in range(t7.INPUTS)}
    values |= {t7.LINES_STATE: 0}
    values |= {t7.dio(n): 1 for n in range(t7.LINES)}
    values |= {t7.scan_list(k): 0 for k in range(t7.MOST_ADDRESSES)}
    values |= {t7.TEST: t7.TEST_VALUE, t7.PRODUCT_ID: 7.0, t7.FIRMWARE: FIRMWARE, t7.SERIAL_NUMBER: SERIAL}
    values |= {t7.FLASH_POINTER: 0, t7.CORE_TIMER: 0, t7.LAST_ERROR: 0, t7.ENABLE: 0, t7.ACTUAL_RATE: 0}
    values |= {t7.SCAN_RATE: 0, t7.NUM_ADDRESSES: 0, t7.SAMPLES_PER_PACKET: 0, t7.SETTLING: 0, t7.RESOLUTION: 0}
    values |= {t7.BUFFER_SIZE: 0, t7.CLOCK_SOURCE: 0, t7.AUTO_TARGET: 0, t7.DATATYPE: 0, t7.NUM_SCANS: 0}
    return {r.address + i: word for r, value in values.items() for i, word in enumerate(r.encode(value))}


def serve(world: AnyWorld, roles: Mapping[str, tuple[int, Settings]], listen: str = LISTEN) -> Server:
    """One device: role -> (unit id, settings). Its channels' names are the world's inputs that they are wired to."""
    ((role, (unit, settings)),) = roles.items()
    stream = Port(LISTEN)
    converter = Converter(world, settings, stream)
    port = modbus_port(listen, {unit: converter})
    converter.ports.append(port)
    return Server([port, stream], {role: converter}, {role: Address(port.url, unit, stream.url)})
