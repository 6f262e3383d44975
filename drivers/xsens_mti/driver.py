"""A motion tracker Xsens MTi over a serial line, USB or TCP.

It is in the role of the converter. A tracker that already sends the outputs of a record at `rate_hz` is left alone.
Else the driver configures it: GoToConfig, SetOutputConfiguration, GoToMeasurement. Every message has a number and the
tracker's time. A record with more than `most_lost` of its samples lost is refused, as is one with an axis stuck or at
the end of its range, which the tracker itself reports.

Source  Xsens MT Low Level Communication Protocol Documentation; Xsens MTi User Manual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drivers.digital.frames import Bytes, FrameDecoder, Frames, Ints
from drivers.digital.reception import Batch, Numbers, TimeBase
from drivers.digital.sensor import DigitalSensor
from drivers.digital.settings import FIELDS, FORCES, OUTPUTS, RATES, MessageSettings
from drivers.errors import BadFrame, DriverError, LinkTimeout, Refused, StreamError
from drivers.instrument import Identity
from drivers.transport import Address, Links
from drivers.xsens_mti import messages as xbus
from drivers.xsens_mti.messages import Packet

ANSWER_S, ATTEMPTS = 0.5, 3
TICK_S, WRAPS = 1e-4, (864_000_000, 2**32)  # of SampleTimeFine: 10 and 100 series, 1 and 600 series
HIGHEST_FILTERED_HZ = 400.0  # the highest rate of the filtered outputs; above it, the high-rate (HR) ones
PROBE_S = 0.1
WARM_S = 1.2  # from one report of the temperature to the next, with a margin
SAME = 0.01  # of a rate
TRIADS = {  # kinds of packets -> their outputs
    xbus.ACCELERATION: FORCES,
    xbus.ACCELERATION_HR: FORCES,
    xbus.RATE: RATES,
    xbus.RATE_HR: RATES,
    xbus.FIELD: FIELDS,
}
NAMES = {
    xbus.ACCELERATION: "Acceleration",
    xbus.ACCELERATION_HR: "AccelerationHR",
    xbus.RATE: "RateOfTurn",
    xbus.RATE_HR: "RateOfTurnHR",
    xbus.FIELD: "MagneticField",
}


@dataclass(frozen=True)
class Settings(MessageSettings):
    """The outputs: accelerometer (ax, ay, az) in m/s^2, gyroscope (gx, gy, gz) in rad/s, magnetometer (mx, my, mz) in
    the tracker's arbitrary unit (`count`), which is about the strength of the earth's field.

    A record has the outputs of one sensor. Above 400 Hz they are the high-rate ones, which the tracker does not filter;
    the magnetometer has none. `range` is the end of the accelerometer's range each way, m/s^2. Raises ValueError for
    impossible values.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.rate_hz <= 2000 or self.rate_hz != round(self.rate_hz):
            raise ValueError("rate_hz must be a whole number of Hz, 1 to 2000")

    @property
    def kinds(self) -> tuple[str, str, str]:
        return "m/s^2", "rad/s", "count"

    @property
    def packets(self) -> dict[int, int]:
        """The configuration for a record: identifiers and their rates."""
        fast = self.rate_hz > HIGHEST_FILTERED_HZ
        triads = {
            FORCES: xbus.ACCELERATION_HR if fast else xbus.ACCELERATION,
            RATES: xbus.RATE_HR if fast else xbus.RATE,
            FIELDS: xbus.FIELD,
        }
        rates = {kind: round(self.rate_hz) for names, kind in triads.items() if set(names) & set(self.channels)}
        with_each = dict.fromkeys((xbus.COUNTER, xbus.TIME, xbus.STATUS), xbus.MESSAGE_RATE)
        return with_each | {xbus.TEMPERATURE: 1} | rates


class SampleDecoder(FrameDecoder):
    """Samples of the outputs in `settings.channels` out of MTData2 messages."""

    def __init__(self, settings: Settings) -> None:
        super().__init__(xbus.Xbus())
        self._names = tuple(settings.channels)
        self._numbers = Numbers(1 << 16)
        self._warm_c: list[xbus.Floats] = []
        self.kinds: set[int] = set()

    def take(self, data: bytes) -> Batch:
        messages = self.stream.take(data)
        n = len(messages.starts)
        values = np.full((n, len(self._names)), np.nan)
        self._warm_c = [np.empty(0)]
        counter, time, status = np.full(n, -1), np.zeros(n), np.zeros(n, dtype=np.int64)
        for places, rows, packets in xbus.layout_groups(messages):
            for packet in packets:
                self.kinds.add(packet.kind)
                if packet.number == xbus.COUNTER:
                    counter[places] = xbus.integers(rows, packet)
                elif packet.number == xbus.TIME:
                    time[places] = xbus.integers(rows, packet)
                elif packet.number == xbus.STATUS:
                    status[places] = xbus.integers(rows, packet)
                else:
                    self._numbers_of(rows, packet, places, values)
        numbered = np.flatnonzero(counter >= 0)
        samples = numbered[np.isfinite(values[numbered]).all(axis=1)]
        gaps = self._numbers.gaps(counter[numbered], np.searchsorted(numbered, samples))
        return Batch(
            values[samples], time[samples], gaps, self._find_clipped_output(status), np.concatenate(self._warm_c)
        )

    def _numbers_of(self, rows: Bytes, packet: Packet, places: Ints, values: xbus.Floats) -> None:
        """Put the real numbers of a packet in their columns."""
        outputs = TRIADS.get(packet.kind, ())
        if outputs and packet.size == 3 * xbus.WIDTHS[packet.number & xbus.FORMAT]:
            numbers = xbus.numbers(rows, packet)
            for column, name in enumerate(self._names):
                if name in outputs:
                    values[places, column] = numbers[:, outputs.index(name)]
        elif packet.kind == xbus.TEMPERATURE and (warm_c := xbus.numbers(rows, packet)).size:
            self._warm_c.append(warm_c[:, 0])

    def _find_clipped_output(self, status: Ints) -> str:
        """The first output that the tracker reports at the end of its range."""
        flags = int(np.bitwise_or.reduce(status)) if len(status) else 0
        return next((name for name in self._names if flags >> xbus.CLIPPED + OUTPUTS.index(name) & 1), "")


class Tracker(DigitalSensor[Settings, SampleDecoder]):
    """The tracker at the other end of the line."""

    carrier = "messages"
    protocol, usual_line = "XBus", "serial:/dev/ttyUSB0?baud=115200"
    longest = 2 * xbus.LONGEST
    numbered = True

    def identify(self) -> Identity:
        """Product code, device identifier and firmware. It stops the tracker's data until the next record."""
        self._enter_configuration()
        number = self._ask(xbus.DEVICE_ID).hex().upper()
        product = self._ask(xbus.PRODUCT_CODE).decode("ascii", "replace").strip("\0 ")
        firmware = ".".join(str(part) for part in self._ask(xbus.FIRMWARE)[:3])
        return Identity(f"Xsens {product}", number, firmware)

    @property
    def base(self) -> TimeBase:
        return TimeBase(TICK_S, WRAPS)

    def _decoder(self) -> SampleDecoder:
        return SampleDecoder(self.settings)

    def _begin(self) -> None:
        """Let the tracker send. Raises Refused, StreamError for another rate, LinkTimeout, BadFrame."""
        self._link.discard()
        if not self._is_sending():
            self._enter_configuration()
            self._configure()
            self._ask(xbus.GO_TO_MEASUREMENT)
        self._link.discard()
        self._await_temperature()

    def _await_temperature(self) -> None:
        """Wait for the temperature before the first record: it comes once a second, and each record needs one."""
        if self._warmth.awaited:
            return
        self._warmth.awaited = True
        decoder = self._decoder()
        for data in self._link.until(self._clock.now() + WARM_S):
            self._warmth.take(decoder.take(data).warm_c, self._clock.now())
            if self._warmth.last_c is not None:
                break
        self._link.discard()

    def _is_sending(self) -> bool:
        """Whether the outputs already come at the rate of the settings."""
        decoder, rate_hz, times = self._decoder(), self.settings.rate_hz, np.empty(0)
        for data in self._link.until(self._clock.now() + 3 / rate_hz + PROBE_S):
            batch = decoder.take(data)
            times = np.concatenate([times, np.empty(0) if batch.time is None else batch.time])
            if len(times) > 1:
                break
        steps = self.base.steps(times) * TICK_S * rate_hz
        return bool(len(steps) and (np.abs(steps - 1) < SAME).all())

    def _enter_configuration(self) -> None:
        """Stop the tracker's data. Raises LinkTimeout, BadFrame."""
        self._ask(xbus.GO_TO_CONFIG)

    def _configure(self) -> None:
        """Set the outputs. Raises Refused, StreamError for a rate that the tracker does not have."""
        answer = self._ask(xbus.OUTPUT_CONFIGURATION, xbus.configuration(self.settings.packets))
        try:
            configured = xbus.pairs(answer)
        except ValueError as error:
            raise BadFrame(f"{self.name}: the answer to SetOutputConfiguration: {error}", "Check the line") from error
        for kind in (kind for kind in self.settings.packets if kind in TRIADS):
            if (rate_hz := configured.get(kind, 0)) != self.settings.rate_hz:
                raise StreamError(
                    f"{self.name}: the tracker sends {NAMES[kind]} at {rate_hz} Hz, and rate_hz is "
                    f"{self.settings.rate_hz:g}",
                    "Write a rate that this tracker has, in the sensor's settings",
                )

    def _ask(self, number: int, data: bytes = b"") -> bytes:
        """The data of the answer to a command. Raises Refused, LinkTimeout without an answer, BadFrame."""
        stream = Frames(xbus.Xbus())
        for _ in range(ATTEMPTS):
            self._link.discard()
            self._link.write(xbus.message(number, data))
            for received in self._link.until(self._clock.now() + ANSWER_S):
                for kind, answer in xbus.messages(stream.take(received)):
                    if kind == xbus.ERROR:
                        raise self._refusal(number, answer)
                    if kind == number + 1:
                        return answer
        if not stream.good and (stream.unread > xbus.LONGEST or stream.misfits > 2):
            raise self._no_frames(stream)
        raise LinkTimeout(
            f"{self.name}: no answer of the tracker to message {number:#04x} on {self._link.url}",
            "Check power and cable, the baud rate, and that no other program talks to it",
        )

    def _refusal(self, number: int, answer: bytes) -> Refused:
        code = answer[0] if answer else 0
        return Refused(
            f"{self.name}: the tracker refuses message {number:#04x}: {xbus.ERRORS.get(code, 'error')} ({code:#04x})",
            "Choose outputs and a rate that this tracker has, in the sensor's settings",
            code,
        )

    def _content(self, decoder: SampleDecoder) -> str:
        names = ", ".join(name for kind, name in NAMES.items() if kind in decoder.kinds)
        return f"{decoder.good} messages with {names}{self._warm}"

    @property
    def _expected(self) -> str:
        return f"MTData2 with {', '.join(NAMES[kind] for kind in self.settings.packets if kind in NAMES)}"

    def _unreadable(self, decoder: SampleDecoder) -> DriverError:
        return self._no_frames(decoder.stream) if decoder.unread else self._silence(2.0)


def connect(address: Address, links: Links, settings: Settings, name: str) -> Tracker:
    """The tracker at `address`. Raises LinkRefused when its line cannot be opened."""
    return Tracker(links.link(address.url, name), settings, name)
