"""A digital sensor in the role of the converter: it sends samples without requests, in its own units.

Old samples in the buffers are discarded before a record. A record is refused if too many of its samples are lost, if
its rate is wrong, or if an axis is stuck or at the end of its range.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.digital.frames import Frames
from drivers.digital.reception import Batch, Reception, Tally, Thermometer, TimeBase
from drivers.digital.settings import FIELDS, FORCES, RATES, DigitalSettings
from drivers.errors import BadFrame, DriverError, LimitError, LinkTimeout, OverRange, SensorFault, StreamError
from drivers.instrument import Check
from drivers.recorder import Recorder, Samples
from drivers.transport.link import Link

Settings = TypeVar("Settings", bound=DigitalSettings)
QUIET_S = 2.0  # silence that ends a record; at least ten samples
POLL_S = 0.4  # samples that wait in the buffers of the system are read so often
STUCK = 100  # equal samples of one axis in successive records, while another axis of the same kind changes
LIVELY = 4  # different values in a record: a sound axis with less noise may be constant, between two steps
RATE_OFF = 0.05  # of the stated rate
TEST_S = 2.0
ONE_G = {"g": 1.0, "m/s^2": 9.80665}
STILL_G = (0.3, 3.0)  # a sensor at rest shows 1 g, its bias and scale factor within reason
SHOWN = 3  # damaged lines or messages before a share of them can be judged


class Decoder(Protocol):
    """Converts bytes to samples as they arrive. The first line or message may be incomplete and is not counted."""

    def take(self, data: bytes) -> Batch:
        """The samples that `data` completes."""

    @property
    def good(self) -> int:
        """Number of lines or messages that could be read."""

    @property
    def damaged(self) -> int:
        """Number of lines or messages that could not be read."""

    @property
    def unread(self) -> int:
        """Number of bytes after the last complete line or message."""


Decoding = TypeVar("Decoding", bound=Decoder)


@dataclass(frozen=True)
class EqualSamples:
    """Successive equal samples of an output, up to its last one; the first of them was taken at `since_s`."""

    value: float
    count: int
    since_s: float


class DigitalSensor(Recorder[Settings], Generic[Settings, Decoding]):
    """A sensor that sends samples without requests.

    A driver defines the members down to `_advice`. `carrier` is the word for what carries a sample, `longest` the most
    bytes without one.
    """

    carrier: str
    longest: int
    numbered = False
    protocol = ""  # of messages with a checksum, and the address of a serial line with a usual baud rate
    usual_line = ""

    def __init__(self, link: Link, settings: Settings, name: str) -> None:
        self.name, self.settings = name, settings
        self._link, self._clock = link, link.clock
        self._tally, self._warmth = self._new_tally(), Thermometer()
        self._equal: dict[str, EqualSamples] = {}  # by output

    @property
    @abstractmethod
    def base(self) -> TimeBase:
        """The sensor's time."""

    @abstractmethod
    def _decoder(self) -> Decoding:
        """A new decoder of the outputs in `settings.channels`, in this order."""

    @abstractmethod
    def _unreadable(self, decoder: Decoding) -> DriverError:
        """The error for bytes without a sample."""

    def _no_frames(self, stream: Frames) -> BadFrame:
        """The error for bytes without a valid message of the protocol."""
        if stream.misfits > 2:
            return BadFrame(
                f"{self.name}: {stream.misfits} messages on {self._link.url} have a wrong checksum",
                "Check the cable; or the sensor uses other definitions of these messages",
            )
        return BadFrame(
            f"{self.name}: {stream.unread} bytes on {self._link.url} are not {self.protocol}",
            f"The baud rate is probably wrong: write that of the sensor, as {self.usual_line}",
        )

    @property
    @abstractmethod
    def _expected(self) -> str:
        """What carries the samples, as the errors name it."""

    def _silence(self, timeout_s: float) -> DriverError:
        """The error for a link on which nothing arrives."""
        return LinkTimeout(
            f"{self.name}: received no {self._expected} on {self._link.url} within {timeout_s:g} s",
            "Check power and cable, and that the sensor sends it",
        )

    @abstractmethod
    def _content(self, decoder: Decoding) -> str:
        """The content of the lines or messages in words, for a self-test."""

    def _begin(self) -> None:
        """Start the samples of the sensor, and discard old ones. Raises DriverError."""
        self._link.discard()

    def _advice(self, decoder: Decoding, begun_s: float) -> list[Check]:  # noqa: ARG002
        """Further checks after a failed check, with advice."""
        return []

    def self_test(self) -> list[Check]:
        """The outputs, the rate, and the sensor's time against the host's, in two seconds of samples."""
        decoder, reception, begun_s = self._decoder(), self._reception(), self._clock.now()
        try:
            self._begin()
            decoder, begun_s = self._decoder(), self._clock.now()
            while (left_s := begun_s + TEST_S - self._clock.now()) > 0:
                reception.take(self._listen(decoder, left_s), self._clock.now())
            if not reception.count:
                raise self._unreadable(decoder)
        except DriverError as fault:
            return [Check(self.carrier, False, f"{fault}"), *self._advice(decoder, begun_s)]
        rate_hz = reception.measured_rate_hz
        fits = abs(rate_hz / self.settings.rate_hz - 1) < RATE_OFF
        rate_text = f"{rate_hz:.4g} samples a second; rate_hz is {self.settings.rate_hz:g}"
        state = f"{decoder.damaged} damaged, {reception.lost} samples lost, {reception.doubled} doubled"
        checks = [Check(self.carrier, True, f"{self._content(decoder)}; {state}"), Check("rate", fits, rate_text)]
        tally = self._new_tally()
        tally.add(reception, decoder.damaged)
        if (gain := tally.gain) is not None:
            drift = f"the sensor's time is {tally.offset_s:+.3f} s from the host's and gains {1e6 * gain:+.0f} ppm"
            checks.append(Check("time", abs(gain) < RATE_OFF, drift))
        gravity = self._gravity(reception.pull(reception.count))
        return [*checks, *gravity, *(self._advice(decoder, begun_s) if gravity else [])]

    def _gravity(self, values: NDArray[np.float64]) -> list[Check]:
        """A failed check where samples of a whole accelerometer, in a known unit, do not show gravity; else none."""
        names = tuple(self.settings.channels)
        one_g = ONE_G.get(self.settings.units.get("ax", ""))
        if one_g is None or not set(FORCES) <= set(names):
            return []
        size = float(np.median(np.linalg.norm(values[:, [names.index(name) for name in FORCES]], axis=1)))
        if STILL_G[0] <= size / one_g <= STILL_G[1]:
            return []
        unit = next((unit for unit, g in ONE_G.items() if STILL_G[0] <= size / g <= STILL_G[1]), "")
        likely = f"the unit is probably {unit}" if unit else "check the unit and the columns in the sensor's settings"
        shown = f"{', '.join(FORCES)} have the magnitude {size:.4g} {self.settings.units['ax']}"
        return [Check("gravity", False, f"{shown}; a sensor at rest shows {one_g:g}: {likely}")]

    def tally(self) -> dict[str, tuple[float, str]]:
        """Counts of lost, doubled and damaged samples since the connection, and the gain of the sensor's clock.

        Each is a value with its unit, by name.
        """
        return self._tally.values()

    @property
    def _warm(self) -> str:
        """The temperature of the sensor as the end of a sentence; "" if the sensor does not report it."""
        return "" if self._warmth.last_c is None else f"; the sensor is at {self._warmth.last_c:.1f} C"

    def power(self, on: bool) -> None:  # noqa: ARG002 - as the converter's
        """Raises LimitError: the program cannot switch the power of this sensor."""
        raise LimitError(f"{self.name}: the program cannot switch the power of a digital sensor", "Switch it by hand")

    def prepare(self) -> None:
        """Start the samples of the sensor now, which can take seconds. Raises DriverError."""
        self._begin()

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        """Record for `duration_s` without a gap, in blocks of `block_s`, both rounded to whole samples.

        Raises LinkTimeout for a silent link, BadFrame for bytes that cannot be read, StreamError for lost samples or
        another rate, OverRange, SensorFault for a stuck axis.
        """
        rate_hz, names = self.settings.rate_hz, tuple(self.settings.channels)
        total, block = self.scans(duration_s), self.scans(block_s)
        self._begin()
        self._warmth.forget()
        decoder, reception, sent = self._decoder(), self._reception(), 0
        begun_s, quiet_s, damaged, lost = self._clock.now(), max(QUIET_S, 10 / rate_hz), 0, 0
        try:
            while sent < total:
                due = min(block, total - sent)
                while reception.count < sent + due:
                    self._pause(reception, total)
                    if len((batch := self._listen(decoder, quiet_s)).values):
                        damaged = decoder.damaged
                    reception.take(batch, self._clock.now())
                    if self._clock.now() - (reception.end_s if reception.count else begun_s) > quiet_s:
                        raise self._unreadable(decoder) if decoder.damaged > damaged else self._silence(quiet_s)
                self._require_complete(reception, decoder)
                lost_before, lost = lost, self._lost(reception, decoder)
                values, start_s = reception.pull(due), reception.start_s + sent / rate_hz
                self._require_alive(values, names, reception, start_s)
                temperature_c = self._warmth.pull_c(self._clock.now())
                yield Samples(values, names, rate_hz, start_s, temperature_c, lost - lost_before)
                sent += due
        finally:
            self._tally.add(reception, decoder.damaged)

    def _pause(self, reception: Reception, total: int) -> None:
        """Wait while samples collect. The first and the last one are read at once, for their times of arrival."""
        period_s = 1 / self.settings.rate_hz
        pause_s = min(POLL_S, (total - reception.count - 2) * period_s)
        if reception.count and pause_s > 2 * period_s:
            self._clock.sleep(pause_s)

    def _new_tally(self) -> Tally:
        return Tally(self.base, self.carrier)

    def _reception(self) -> Reception:
        return Reception(self.base, self.settings.rate_hz, self.numbered)

    def _listen(self, decoder: Decoding, timeout_s: float) -> Batch:
        """The samples of the next bytes. Raises LinkTimeout, BadFrame."""
        if not (data := self._link.read(timeout_s)):
            if timeout_s < QUIET_S:
                return Batch(np.empty((0, 0)))
            raise self._silence(timeout_s)
        while next_bytes := self._link.read(0.0):  # a read has an end, and samples must not gather behind it
            data += next_bytes
        batch = decoder.take(data)
        self._warmth.take(batch.warm_c, self._clock.now())
        if decoder.damaged > SHOWN + decoder.good or decoder.unread > self.longest:
            raise self._unreadable(decoder)
        return batch

    def _require_complete(self, reception: Reception, decoder: Decoding) -> None:
        """Raises StreamError where too many samples were lost, or the rate is another."""
        if reception.back:
            raise StreamError(
                f"{self.name}: the sensor's time went back: the sensor restarted during the record",
                "Check its supply and its cable; opening its port restarts some boards",
            )
        lost_samples = self._lost(reception, decoder)
        if lost_samples > self.settings.most_lost * (reception.count + lost_samples) and lost_samples > 1:
            raise StreamError(
                f"{self.name}: {lost_samples} of {reception.count + lost_samples} samples were lost "
                f"({decoder.damaged} damaged {self.carrier}, {reception.doubled} doubled samples)",
                "Lower the sensor's rate or raise the baud rate, and check the cable; or correct rate_hz",
            )
        rate_hz = reception.measured_rate_hz if reception.length_s > 1.0 else self.settings.rate_hz
        if abs(rate_hz / self.settings.rate_hz - 1) > RATE_OFF:
            raise StreamError(
                f"{self.name}: the sensor sends {rate_hz:.4g} samples a second, "
                f"but rate_hz is {self.settings.rate_hz:g}",
                "Correct rate_hz in the sensor's settings",
            )

    def _lost(self, reception: Reception, decoder: Decoding) -> int:  # noqa: ARG002
        """Number of samples that are missing in the record so far."""
        return reception.lost

    def _require_alive(
        self, values: NDArray[np.float64], names: Sequence[str], reception: Reception, start_s: float
    ) -> None:
        """Raises OverRange for an output at the end of its range, SensorFault for a stuck one."""
        if reception.clipped:
            raise OverRange(
                f"{self.name}: the sensor reports {reception.clipped} at the end of its range",
                "Keep the sensor still, or set a wider range in it",
            )
        end = self.settings.range
        if end is not None and (
            saturated := [n for k, n in enumerate(names) if n in FORCES and _largest(values[:, k]) >= end]
        ):
            raise OverRange(
                f"{self.name}: {saturated[0]} reached the end of its range, "
                f"{end:g} {self.settings.units[saturated[0]]}",
                "Keep the sensor still, set a wider range in it, or correct `range` in the bench file",
            )
        if stuck := self._stuck(values, names, start_s):
            equal = self._equal[stuck]
            raise SensorFault(
                f"{self.name}: {stuck} gave the same value {equal.count} times while others changed: it is stuck",
                "Switch the sensor off and on, and check that the output is the right one; then resume the run, which "
                "measures the poses since then again",
                equal.since_s,
            )

    def _stuck(self, values: NDArray[np.float64], names: Sequence[str], start_s: float) -> str:
        """The first output with STUCK equal samples; "" for none. Successive short records count together."""
        differs = values[::-1] != values[-1]  # from the last sample backwards
        if not differs.any():  # of a coarse sensor at rest; it says nothing
            return ""
        counts = np.where(differs.any(axis=0), differs.argmax(axis=0), len(values))
        for name, value, count in zip(names, values[-1].tolist(), counts.tolist(), strict=True):
            earlier = self._equal.get(name)
            if count == len(values) and earlier is not None and earlier.value == value:
                self._equal[name] = replace(earlier, count=earlier.count + count)
            else:
                since_s = start_s + (len(values) - count) / self.settings.rate_hz
                self._equal[name] = EqualSamples(value, count, since_s)
        lively = {name for name, column in zip(names, values.T, strict=True) if len(np.unique(column)) >= LIVELY}
        kinds = [kind for kind in (FORCES, RATES, FIELDS) if lively.intersection(kind)]
        stuck = (name for kind in kinds for name in kind if name in names and self._equal[name].count >= STUCK)
        return next(stuck, "")


def _largest(values: NDArray[np.float64]) -> float:
    return float(np.abs(values).max())
