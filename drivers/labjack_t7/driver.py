"""LabJack T7: 16 bit converter, up to ten channels in turn, streamed. Modbus TCP and a raw stream port.

A record comes as a stream, clocked by the device; never sample by sample. Every record is checked for
lost scans and turned into volts with the calibration that the device carries.
Source: T-series datasheet; see the modules `registers` and `stream`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from drivers.errors import DriverError, Interlocked, LimitError, OverRange, Refused, StreamError
from drivers.instrument import Check, Identity
from drivers.labjack_t7 import registers as t7
from drivers.labjack_t7.stream import RangeCalibration, Reception
from drivers.recorder import Inputs, Recorder, Samples
from drivers.transport import Address, Links
from drivers.transport.link import Link
from drivers.transport.modbus import REPEATED, RETRIES, Register, Unit


@dataclass(frozen=True)
class Settings(Inputs[int]):
    """Channels as {name: AIN number}, in the order of the scan; one range for all.

    Those `on_request` are wired too, and are sampled only if a procedure asks for them, see `T7.only`.
    `interchannel_s` is from one channel of a scan to the next [M: measure it with one signal on two channels].
    `interlocks` are the digital lines of contacts that must be closed while anything moves, as {name: DIO number}. A
    closed contact pulls its line to ground; an open one, or a broken wire, lets it go high.
    Raises ValueError for impossible values.
    """

    channels: Mapping[str, int] = field(default_factory=lambda: {"vx": 0, "vy": 1, "supply": 2})
    on_request: Mapping[str, int] = field(default_factory=dict)
    rate_hz: float = 1000.0
    range_v: float = 10.0
    power_dio: int | None = None  # the digital line that switches the sensor's power
    interchannel_s: float = t7.INTERCHANNEL_S
    interlocks: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.channels or not set(self.wired.values()) <= set(range(t7.INPUTS)):
            raise ValueError(f"channels must name analog inputs, 0 to {t7.INPUTS - 1}, and at least one")
        self.require_valid_inputs()
        if not 0 < self.rate_hz * len(self.channels) <= t7.MOST_SAMPLES_PER_S:
            raise ValueError(f"rate_hz must give at most {t7.MOST_SAMPLES_PER_S} samples a second in all")
        if self.range_v not in t7.RANGES_V:
            raise ValueError(f"range_v must be one of {', '.join(f'{r:g}' for r in t7.RANGES_V)} V")
        if self.power_dio is not None and self.power_dio not in range(t7.LINES):
            raise ValueError(f"power_dio must be a digital line, 0 to {t7.LINES - 1}")
        lines = [*self.interlocks.values(), *([] if self.power_dio is None else [self.power_dio])]
        if not set(lines) <= set(range(t7.LINES)) or len(set(lines)) < len(lines):
            raise ValueError(f"interlocks must be digital lines, 0 to {t7.LINES - 1}, each with one purpose")


class T7(Recorder[Settings]):
    """The converter. Its calibration is read once, when it is connected."""

    def __init__(self, unit: Unit, stream: Link, settings: Settings) -> None:
        self.name = unit.name
        self.settings = settings
        self._unit, self._stream, self._clock = unit, stream, stream.clock
        self._prepare_inputs()
        self._calibration = self._read_calibration()
        self._volts = self._calibration.table()

    def identify(self) -> Identity:
        """Product, serial number and firmware out of the device."""
        product = self._unit.read(t7.PRODUCT_ID)
        serial, firmware = self._unit.read(t7.SERIAL_NUMBER), self._unit.read(t7.FIRMWARE)
        return Identity(f"LabJack T{product:.0f}", f"{serial:.0f}", f"{firmware:.4f}")

    def self_test(self) -> list[Check]:
        """The test register, the model, the calibration."""
        test, product = int(self._unit.read(t7.TEST)), self._unit.read(t7.PRODUCT_ID)
        c, contacts = self._calibration, self._open_interlocks() if self.settings.interlocks else None
        relays = f"open: {', '.join(contacts)}" if contacts else "closed"
        return [
            Check("registers", test == t7.TEST_VALUE, f"TEST reads 0x{test:08X}"),
            Check("model", product == 7.0, f"product {product:g}"),
            Check("calibration", c.plausible, f"{c.positive_slope * 1e6:.3f} uV a code, center {c.center:.1f}"),
            *([] if contacts is None else [Check("interlocks", not contacts, relays)]),
        ]

    def power(self, on: bool) -> None:
        """Switch the sensor's power by the digital line of the settings."""
        if self.settings.power_dio is None:
            raise LimitError(f"{self.name}: the program cannot switch the power", "Set power_dio in the bench file")
        self._unit.write(t7.dio(self.settings.power_dio), int(on))

    def look(self) -> None:
        """Raises Interlocked where a contact that must be closed is open. Waiting code calls it repeatedly."""
        if self.settings.interlocks and (contacts := self._open_interlocks()):
            lines = ", ".join(f"{name} (DIO{self.settings.interlocks[name]})" for name in contacts)
            raise Interlocked(
                f"{self.name}: the interlock {lines} is open",
                "Release the emergency stop and close the guards; when nobody is near the rig, resume the run",
            )

    def _open_interlocks(self) -> list[str]:
        state = int(self._unit.read(t7.LINES_STATE))
        return [name for name, line in self.settings.interlocks.items() if state >> line & 1]

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        """Record all channels for `duration_s` without a gap, and hand it out in blocks of `block_s`.

        Both are rounded to whole scans; the last block holds the rest. The device takes one record, so the
        samples are the same whatever `block_s` is. Take the next block within a few seconds, before the
        buffers of network and device are full. Closing the iterator ends the stream.

        Raises StreamError when scans were lost, OverRange when a channel was at an end of its range, LinkTimeout,
        Refused when the device declines the settings.
        """
        channels, scans, block = tuple(self.settings.channels), self.scans(duration_s), self.scans(block_s)
        per_packet = _scans_per_packet(scans, len(channels))
        start_s = self._start(per_packet * len(channels))
        try:
            rate_hz = self._unit.read(t7.ACTUAL_RATE)
            reception = Reception(self._stream, self.name, start_s, rate_hz, len(channels), per_packet)
            for first in range(0, scans, block):
                codes = reception.take(min(block, scans - first))
                self._require_in_range(codes, channels)
                yield Samples(self._volts[codes], channels, rate_hz, start_s + first / rate_hz)
        except BaseException:
            with contextlib.suppress(DriverError):  # the first error is reported
                self._stop()
            raise
        self._stop()

    def _require_in_range(self, codes: NDArray[np.uint16], channels: tuple[str, ...]) -> None:
        """A sample at an end of the range may be any voltage beyond it, so a mean with such samples has no meaning."""
        if codes.min() > 0 and codes.max() < t7.HIGHEST_CODE:
            return
        count = np.count_nonzero((codes == 0) | (codes == t7.HIGHEST_CODE), axis=0)
        name, clipped = channels[int(np.argmax(count))], int(count.max())
        raise OverRange(
            f"{self.name}: {name} (AIN{self.settings.channels[name]}) was beyond its range of "
            f"{self.settings.range_v:g} V in {clipped} of {len(codes)} samples",
            "Check the sensor's supply and wiring, or set a wider range_v in the bench file",
        )

    def _start(self, samples_per_packet: int) -> float:
        """Start the stream; returns the time of the command.

        If its answer is lost or late, the stream runs already, and the device declines the same command again. So the
        stream is stopped and started anew.
        """
        for _ in range(RETRIES):
            with contextlib.suppress(*REPEATED):
                return self._enable(samples_per_packet)
        return self._enable(samples_per_packet)

    def _enable(self, samples_per_packet: int) -> float:
        self._configure(samples_per_packet)
        self._stream.discard()
        start_s = self._clock.now()
        try:
            self._write_block((t7.ENABLE, 1), retries=0)
        except Refused:  # a stream that runs is another program's
            raise
        except BaseException:
            with contextlib.suppress(DriverError):
                self._stop()
            raise
        return start_s

    def _configure(self, samples_per_packet: int) -> None:
        inputs = list(self.settings.channels.values())
        self._write_block(
            (t7.SCAN_RATE, self.settings.rate_hz),
            (t7.NUM_ADDRESSES, len(inputs)),
            (t7.SAMPLES_PER_PACKET, samples_per_packet),
            (t7.SETTLING, 0),
            (t7.RESOLUTION, 0),
            (t7.BUFFER_SIZE, t7.LARGEST_BUFFER),
            (t7.CLOCK_SOURCE, 0),
            (t7.AUTO_TARGET, t7.TO_ETHERNET),
            (t7.DATATYPE, 0),
            (t7.NUM_SCANS, 0),
        )
        self._write_block(*((t7.scan_list(k), t7.ain(number).address) for k, number in enumerate(inputs)))

    def _stop(self) -> None:
        """Stop the stream. Packets in flight arrive before the next stream is set up, and are discarded then."""
        with contextlib.suppress(Refused):  # it has stopped by itself
            self._unit.write(t7.ENABLE, 0)

    def _write_block(self, *values: tuple[Register, float], retries: int = RETRIES) -> None:
        """Write a block as the unit does. A refusal has the error text of the device."""
        try:
            self._unit.write_block(*values, retries=retries)
        except Refused as refusal:
            detail = int(self._unit.read(t7.LAST_ERROR))
            explanation = t7.ERRORS.get(detail, "see the list of error codes in its datasheet")
            raise Refused(
                f"{refusal.what}; device error {detail}: {explanation}", refusal.remedy, refusal.code
            ) from refusal

    def _prepare_inputs(self) -> None:
        """End a stream of a crashed program; set range and ground of all wired inputs."""
        self._stop()
        for number in self.settings.wired.values():
            self._unit.write(t7.ain_range(number), self.settings.range_v)
            self._unit.write(t7.ain_negative(number), t7.SINGLE_ENDED)

    def _read_calibration(self) -> RangeCalibration:
        self._unit.write(t7.FLASH_POINTER, t7.CALIBRATION_ADDRESS)
        words = self._unit.read_words(t7.FLASH, t7.CALIBRATION_WORDS, "the calibration in flash")
        calibration = RangeCalibration.from_flash(words, self.settings.range_v)
        if not calibration.plausible:
            raise StreamError(f"{self.name}: its calibration is {calibration}", "Have the device calibrated")
        return calibration


def _scans_per_packet(scans: int, channels: int) -> int:
    """Large packets, of a size with which the last one ends with the record or soon after, so that no time is lost."""
    most = min(scans, t7.MOST_SAMPLES_PER_PACKET // channels)
    return min(range(most, most // 2, -1), key=lambda size: -scans % size)


def connect(address: Address, links: Links, settings: Settings, name: str) -> T7:
    """The converter at `address`; its stream is on port 702 of the same host unless `stream_url` is given.

    Raises LinkRefused when a port cannot be opened, and the errors of a first exchange.
    """
    stream_url = address.stream_url or f"tcp://{urlsplit(address.url).hostname}:{t7.STREAM_PORT}"
    return T7(links.unit(address, name), links.link(stream_url, name), settings)
