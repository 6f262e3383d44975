"""Analog records of EPICS as a converter: the rig records the values that an IOC measures.

All channels are read at once, a few times a second, and not monitored: a monitor leaves out changes below the record's
deadband (MDEL), so its values are no even sampling. The reading of a record carries its alarm and its time stamp. A
record with an alarm, and one that an IOC does not process as often as it is read, are refused: a repeated reading would
count as a new one.

Source: EPICS Channel Access protocol specification; EPICS record reference manual, analog input record.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drivers.errors import LimitError, SensorFault, StreamError
from drivers.instrument import Check, Identity, require_positive
from drivers.recorder import Inputs, NoDigitalLines, Recorder, Samples
from drivers.transport import Address, Links
from drivers.transport.channel_access import FieldReading, Records

__all__ = ["AnalogRecords", "Settings", "connect"]

UNITS_V = {"v": 1.0, "volt": 1.0, "volts": 1.0, "mv": 1e-3, "uv": 1e-6, "µv": 1e-6}
MOST_REPEATED = 0.05  # of the readings of a record: two clocks that differ a little cause some
OLDEST = 1.5  # periods since the first reading with a time stamp: two such clocks repeat it for little more than one


@dataclass(frozen=True)
class Settings(Inputs[str], NoDigitalLines):
    """Channels as {name: record}, the record's name behind the beginning in the url.

    Inputs `on_request` are measured only if a procedure asks for them. `volts_per_unit` converts the engineering units
    of the records; without it the units must be V, mV or uV. `highest_severity` is the worst alarm with which the rig
    continues. Raises ValueError for impossible values.
    """

    channels: Mapping[str, str] = field(default_factory=lambda: {"vx": "ai1", "vy": "ai2"})
    on_request: Mapping[str, str] = field(default_factory=dict)
    rate_hz: float = 5.0
    volts_per_unit: float | None = None
    highest_severity: Literal["none", "minor", "major"] = "minor"
    timeout_s: float = 5.0

    def __post_init__(self) -> None:
        require_positive(self, "rate_hz", "timeout_s")
        if not self.channels or not all(self.wired.values()):
            raise ValueError("channels must name records of the IOC, such as {vx: ai1}")
        self.require_valid_inputs()


class AnalogRecords(Recorder[Settings]):
    """The records, read at the rate of the bench file."""

    def __init__(self, records: Records, links: Links, settings: Settings, name: str) -> None:
        """Raises LinkRefused for a missing record, LimitError if its units are not those of a voltage."""

        self.name, self.settings = name, settings
        self._records, self._clock = records, links.clock
        self._volts = {channel: self._volts_per_unit(record) for channel, record in settings.wired.items()}
        self._stamps: dict[str, Stamp] = {}  # the last one of each channel, also of the record before

    def identify(self) -> Identity:
        """The names of the records: they have no field for the maker of the converter."""
        self._scan()
        return Identity(f"EPICS records {self._records.beginning}{', '.join(self.settings.channels.values())}")

    def self_test(self) -> list[Check]:
        """Check the alarms of the records and the age of the readings."""
        checks = []
        for channel, reading in self._scan().items():
            ok = not reading.is_worse_than(self.settings.highest_severity)
            voltage_text = f"{reading.value * self._volts[channel]:.4f} V"
            checks.append(Check(channel, ok, voltage_text if ok else f"{voltage_text}, alarm {reading.alarm}"))
        return checks

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        """Record all channels for `duration_s` without a gap, and hand it out in blocks of `block_s`.

        Raises StreamError when readings are late or repeated, SensorFault for a record with an alarm or without a
        number, LinkTimeout, LinkRefused, Refused, BadFrame.
        """
        scans, block = self.scans(duration_s), self.scans(block_s)
        channels, rate_hz = tuple(self.settings.channels), self.settings.rate_hz
        start_s, fresh = self._clock.now(), Freshness(channels, self._stamps, OLDEST / rate_hz)
        for first in range(0, scans, block):
            last = min(first + block, scans)
            volts = np.array([self._volts_of_scan(scan, start_s, fresh) for scan in range(first, last)])
            self._require_fresh(fresh, last)
            yield Samples(volts, channels, rate_hz, start_s + first / rate_hz)

    def _scan(self) -> dict[str, FieldReading]:
        """One reading of every channel."""
        channels = self.settings.channels
        return dict(zip(channels, self._records.read(*channels.values()), strict=True))

    def _volts_of_scan(self, scan: int, start_s: float, fresh: Freshness) -> NDArray[np.float64]:
        """The volts of a scan at its time, shape (channels,)."""
        period_s = 1 / self.settings.rate_hz
        due_s = start_s + scan * period_s
        self._clock.sleep(due_s - self._clock.now())
        readings = self._scan()
        if (late_s := self._clock.now() - due_s) > period_s:
            raise StreamError(
                f"{self.name}: scan {scan + 1} is {late_s:.2f} s late: a reading takes longer than 1/rate_hz",
                "Lower rate_hz in the bench file, or find out what slows the network or the IOC",
            )
        for channel, reading in readings.items():
            self._require_sound(channel, reading)
        fresh.note(readings, self._clock.now())
        return np.array([reading.value * self._volts[channel] for channel, reading in readings.items()])

    def _require_sound(self, channel: str, reading: FieldReading) -> None:
        context = f"{self.name}: {channel} ({self._records.beginning}{self.settings.channels[channel]})"
        if reading.is_worse_than(self.settings.highest_severity):
            raise SensorFault(
                f"{context} has the alarm {reading.alarm}",
                "Find its cause in the IOC; set highest_severity in the bench file if the rig shall go on with it",
            )
        if not np.isfinite(reading.value):
            raise SensorFault(
                f"{context} is {reading.value:g}, which is not a voltage", "Check the IOC and the converter"
            )

    def _require_fresh(self, fresh: Freshness, scans: int) -> None:
        """Raises StreamError for a record that the IOC processes less often than it is read, or not any more."""
        channel, repeated = fresh.worst()
        if repeated > max(1, MOST_REPEATED * scans):
            rate_hz = self.settings.rate_hz * (scans - repeated) / scans
            raise StreamError(
                f"{self.name}: {channel} ({self._records.beginning}{self.settings.channels[channel]}) had a new time "
                f"stamp in {scans - repeated} of {scans} readings: the IOC processes it about {rate_hz:.2g} times a "
                "second",
                "Lower rate_hz in the bench file below that, or have the IOC process it more often (its field SCAN)",
            )
        if fresh.stopped:
            raise StreamError(
                f"{self.name}: {fresh.stopped} ({self._records.beginning}{self.settings.channels[fresh.stopped]}) kept "
                f"its time stamp for more than {OLDEST} periods of the readings: the IOC stopped processing it",
                "Check the IOC, its load and the device behind the record",
            )

    def _volts_per_unit(self, record: str) -> float:
        if self.settings.volts_per_unit is not None:
            return self.settings.volts_per_unit
        units = self._records.units(record)
        if units.lower() not in UNITS_V:
            raise LimitError(
                f"{self.name}: the units of {self._records.beginning}{record} are {units!r} (EGU), not a voltage",
                "Name a record of a voltage in the bench file, or set volts_per_unit there",
            )
        return UNITS_V[units.lower()]


@dataclass(frozen=True)
class Stamp:
    """A time stamp of the IOC, and the clock's time when it was first read."""

    stamp_s: float
    read_s: float


class Freshness:
    """Number of readings of each channel that repeat the reading before.

    `stopped`: a channel with a time stamp that was first read more than `oldest_s` before; "" for none.
    """

    def __init__(self, channels: Sequence[str], stamps: dict[str, Stamp], oldest_s: float) -> None:
        self._stamps, self._oldest_s = stamps, oldest_s
        self._repeated = dict.fromkeys(channels, 0)
        self.stopped = ""

    def note(self, readings: Mapping[str, FieldReading], now_s: float) -> None:
        """Count the readings whose time stamp is that of the reading before."""
        for channel, reading in readings.items():
            stamp = self._stamps.get(channel)
            if stamp is None or stamp.stamp_s != reading.stamp_s:
                self._stamps[channel] = Stamp(reading.stamp_s, now_s)
                continue
            self._repeated[channel] += 1
            if now_s - stamp.read_s > self._oldest_s:
                self.stopped = self.stopped or channel

    def worst(self) -> tuple[str, int]:
        """The channel with most repeated readings, and their number."""
        return max(self._repeated.items(), key=lambda item: item[1])


def connect(address: Address, links: Links, settings: Settings, name: str) -> AnalogRecords:
    """The records at `address`, ca:BEGINNING or ca://host:port/BEGINNING. Raises LinkRefused; writes nothing."""
    first = next(iter(settings.channels.values()))
    return AnalogRecords(links.records(address, name, first, settings.timeout_s), links, settings, name)
