"""A digital sensor that sends its samples as lines of text, unasked, over a serial line or TCP.

It is in the role of the converter, and its samples are in the `unit` of the settings in place of V. It is never written
to. Old lines in the buffers are discarded before a record, and so is a cut line at its start.

With a column `time`, lost samples are found by the gaps of the sensor's time, and repeated ones are dropped. A record
with more than `most_lost` of its samples lost is refused, as is one with an axis at the end of its range or stuck.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drivers.errors import BadFrame, DriverError, LimitError, LinkTimeout, OverRange, SensorFault, StreamError
from drivers.imu_lines.lines import Assembly
from drivers.imu_lines.proposal import proposed_settings
from drivers.imu_lines.reception import TIME, Heard, Tally
from drivers.instrument import Check, Identity, require_positive
from drivers.recorder import NoDigitalLines, Recorder, Samples
from drivers.transport import Address, Links
from drivers.transport.link import Link

FORCES, RATES, FIELDS = ("ax", "ay", "az"), ("gx", "gy", "gz"), ("mx", "my", "mz")
OUTPUTS = (*FORCES, *RATES, *FIELDS)
VOLTAGES = ("supply", "d63")  # of the board's own converter, in V, sampled with the sensor
QUIET_S = 2.0  # silence that ends a record; at least ten samples
STUCK = 100  # equal samples of one axis, while another changes
RATE_OFF = 0.05  # of the stated rate
TEST_S = 2.0
LONGEST = 1024  # bytes without an end of line
SHOWN = 3  # damaged lines before a share of them can be judged


@dataclass(frozen=True)
class Settings(NoDigitalLines):
    """The line: `columns` are {ax: 1, ay: 2, az: 3}, by number from 1, or by name for `named` and `teleplot`.

    Columns of a gyroscope (gx, gy, gz) and a magnetometer (mx, my, mz) are recorded for procedures that ask for them.
    The columns supply and d63 are voltages of the board's converter. A column `time` is the sensor's own time, in units
    of `time_unit_s`. `range` is the end of the accelerometer's range each way, in `unit`. Raises ValueError for what
    cannot be.
    """

    columns: Mapping[str, int | str] = field(default_factory=lambda: {"ax": 1, "ay": 2, "az": 3})
    format: Literal["csv", "named", "teleplot", "nmea"] = "csv"
    unit: Literal["g", "m/s^2", "count"] = "g"
    gyro_unit: Literal["deg/s", "rad/s", "count"] = "deg/s"
    field_unit: Literal["uT", "gauss", "count"] = "uT"
    rate_hz: float = 100.0
    range: float | None = None
    time_unit_s: float = 1e-6
    most_lost: float = 0.01

    def __post_init__(self) -> None:
        require_positive(self, "rate_hz", "time_unit_s", *([] if self.range is None else ["range"]))
        if not set(self.columns) & {*OUTPUTS} or not set(self.columns) <= {*OUTPUTS, *VOLTAGES, TIME}:
            others = f"{', '.join(VOLTAGES)} and {TIME}"
            raise ValueError(f"columns must name outputs of {', '.join(OUTPUTS)}, and may name {others}")
        if len(set(self.columns.values())) < len(self.columns):
            raise ValueError("columns must be different; two names have the same column")
        numbered = self.format in ("csv", "nmea")
        if any(isinstance(each, int) != numbered or each in (0, "") for each in self.columns.values()):
            raise ValueError(f"columns of {self.format} are {'numbers, from 1' if numbered else 'names'}")
        if not 0 <= self.most_lost < 1:
            raise ValueError("most_lost must be a share of 0 or more, and less than 1")

    @property
    def wired(self) -> Mapping[str, int | str]:
        """All columns but the time, by name."""
        return {name: column for name, column in self.columns.items() if name != TIME}

    @property
    def channels(self) -> Mapping[str, int | str]:
        """What is recorded unless a procedure asks for other outputs: those of one sensor, and the voltages."""
        first = next(names for names in (FORCES, RATES, FIELDS) if set(names) & set(self.columns))
        return {name: column for name, column in self.wired.items() if name in (*first, *VOLTAGES)}

    @property
    def units(self) -> Mapping[str, str]:
        """The unit of each output."""
        kinds: Mapping[Sequence[str], str] = {FORCES: self.unit, RATES: self.gyro_unit, FIELDS: self.field_unit}
        return {name: unit for names, unit in kinds.items() for name in names if name in self.columns}

    def lag_s(self, channel: str) -> float:  # noqa: ARG002 - as the converter's
        """All columns of a line are sampled at once."""
        return 0.0

    def only(self, name: str, outputs: Sequence[str]) -> Settings:
        """Settings with these outputs. Raises LimitError for one that is not in the lines."""
        if missing := [each for each in outputs if each not in self.wired]:
            raise LimitError(
                f"{name}: the lines have no {', '.join(missing)}; there are {', '.join(self.wired)}",
                "Name the columns in the bench file, under columns of the sensor's settings",
            )
        return replace(self, columns={k: c for k, c in self.columns.items() if k in outputs or k == TIME})


class LineSensor(Recorder[Settings]):
    """The sensor at the other end of the wire."""

    def __init__(self, link: Link, settings: Settings, name: str) -> None:
        self.name, self.settings = name, settings
        self._link, self._clock = link, link.clock
        self._tally = Tally(settings.time_unit_s)

    def identify(self) -> Identity:
        """Only what is known: such lines have no name."""
        return Identity(f"{self.settings.format} lines at {self.settings.rate_hz:g} Hz, in {self.settings.unit}")

    def self_test(self) -> list[Check]:
        """The columns, the rate, and the sensor's time against the host's, in two seconds of lines."""
        heard, tally, begun_s = self._heard(), Tally(self.settings.time_unit_s), self._clock.now()
        try:
            self._link.discard()
            begun_s = self._clock.now()
            while (left_s := begun_s + TEST_S - self._clock.now()) > 0:
                heard.take(self._listen(heard.assembly, left_s), self._clock.now())
            if not heard.assembly.good:
                raise self._unreadable(heard.assembly)
        except DriverError as fault:
            return [Check("lines", False, f"{fault}"), *self._proposal(heard.assembly, begun_s)]
        columns = f"the lines have the columns {', '.join(map(str, heard.assembly.seen))}"
        tally.add(heard)
        rate_hz = heard.measured_rate_hz
        fits = abs(rate_hz / self.settings.rate_hz - 1) < RATE_OFF
        told = f"{rate_hz:.4g} samples a second; rate_hz is {self.settings.rate_hz:g}"
        state = f"{heard.assembly.damaged} damaged, {heard.lost} samples lost, {heard.doubled} doubled"
        checks = [Check("lines", True, f"{columns}; {state}"), Check("rate", fits, told)]
        if (gain := tally.gain) is not None:
            said = f"the sensor's time is {tally.offset_s:+.3f} s from the host's and gains {1e6 * gain:+.0f} ppm"
            checks.append(Check("time", abs(gain) < RATE_OFF, said))
        return checks

    def _proposal(self, assembly: Assembly, begun_s: float) -> list[Check]:
        """Settings that fit the lines since `begun_s`, as far as the test goes; nothing where none do."""
        while (left_s := begun_s + TEST_S - self._clock.now()) > 0 and (data := self._link.read(left_s)):
            assembly.take(data)
        found = proposed_settings(assembly.shown, max(self._clock.now() - begun_s, 1 / self.settings.rate_hz))
        if found is None:
            return []
        columns = ", ".join(f"{name}: {column}" for name, column in found["columns"].items())
        others = ", ".join(f"{name}: {value}" for name, value in found.items() if name != "columns")
        text = f"the lines fit {{columns: {{{columns}}}, {others}}} in the sensor's settings, if it is at rest"
        return [Check("proposal", False, text)]

    def tally(self) -> dict[str, tuple[float, str]]:
        """Counts of lost, doubled and damaged samples since the connection, and the gain of the sensor's clock.

        Each is a value with its unit, by name.
        """
        return self._tally.values()

    def power(self, on: bool) -> None:  # noqa: ARG002 - as the converter's
        """Raises LimitError: no line switches its power."""
        raise LimitError(f"{self.name}: no line switches the power of a sensor that sends lines", "Switch it by hand")

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        """Record for `duration_s` without a gap, in blocks of `block_s`, both rounded to whole samples.

        Raises LinkTimeout for a silent line, BadFrame for lines that cannot be read, StreamError for lost samples or
        another rate, OverRange, SensorFault for a stuck axis.
        """
        rate_hz, names = self.settings.rate_hz, tuple(self.settings.channels)
        total, block = self.scans(duration_s), self.scans(block_s)
        self._link.discard()
        heard, given = self._heard(), 0
        try:
            while given < total:
                wanted = min(block, total - given)
                while len(heard.kept) < given + wanted:
                    heard.take(self._listen(heard.assembly, max(QUIET_S, 10 / rate_hz)), self._clock.now())
                self._require_complete(heard)
                values = np.array([[row[name] for name in names] for row in heard.kept[given : given + wanted]])
                self._require_alive(values, names)
                yield Samples(values, names, rate_hz, heard.at_s[0] + given / rate_hz)
                given += wanted
        finally:
            self._tally.add(heard)

    def _heard(self) -> Heard:
        settings = self.settings
        return Heard(Assembly(settings.format, settings.columns), settings.time_unit_s, settings.rate_hz)

    def _listen(self, assembly: Assembly, timeout_s: float) -> list[dict[str, float]]:
        """The samples of the next bytes. Raises LinkTimeout, BadFrame."""
        if not (data := self._link.read(timeout_s)):
            if timeout_s < QUIET_S:
                return []
            raise LinkTimeout(
                f"{self.name}: no line came on {self._link.url} within {timeout_s:g} s",
                "Check power and cable, and that the sensor sends by itself",
            )
        samples = assembly.take(data)
        if assembly.damaged > SHOWN + assembly.good or (not assembly.good and len(assembly.rest) > LONGEST):
            raise self._unreadable(assembly)
        return samples

    def _unreadable(self, assembly: Assembly) -> DriverError:
        wanted = ", ".join(f"{name}: {column}" for name, column in self.settings.columns.items())
        if not assembly.damaged:
            return LinkTimeout(
                f"{self.name}: no whole line came on {self._link.url}", "Check baud rate, power and cable"
            )
        if assembly.unread.isascii() and assembly.unread.isprintable():
            return BadFrame(
                f"{self.name}: lines such as {assembly.unread!r} are not {self.settings.format} with columns {wanted}",
                "Correct format and columns in the sensor's settings",
            )
        return BadFrame(
            f"{self.name}: what comes on {self._link.url} is not text ({assembly.unread[:16]!r})",
            "The baud rate is probably wrong: write the sensor's, as serial:/dev/ttyUSB0?baud=115200",
        )

    def _require_complete(self, heard: Heard) -> None:
        """Raises StreamError where too many samples were lost, or the rate is another."""
        if heard.back:
            raise StreamError(
                f"{self.name}: the sensor's time went back: the sensor began anew during the record",
                "Check its supply and its cable; opening its port restarts some boards",
            )
        lost = heard.lost + (heard.assembly.damaged if TIME not in self.settings.columns else 0)
        if lost > self.settings.most_lost * (len(heard.kept) + lost) and lost > 1:
            raise StreamError(
                f"{self.name}: {lost} of {len(heard.kept) + lost} samples were lost ({heard.assembly.damaged} damaged "
                f"lines, {heard.doubled} doubled samples)",
                "Lower the sensor's rate or raise the baud rate, and check the cable; or correct rate_hz",
            )
        rate_hz = heard.measured_rate_hz if heard.length_s > 1.0 else self.settings.rate_hz
        if abs(rate_hz / self.settings.rate_hz - 1) > RATE_OFF:
            raise StreamError(
                f"{self.name}: {rate_hz:.4g} samples a second come, and rate_hz is {self.settings.rate_hz:g}",
                "Correct rate_hz in the sensor's settings",
            )

    def _require_alive(self, values: NDArray[np.float64], names: Sequence[str]) -> None:
        end = self.settings.range
        if end is not None and (over := [n for k, n in enumerate(names) if n in FORCES and _most(values[:, k]) >= end]):
            raise OverRange(
                f"{self.name}: {over[0]} reached the end of its range, {end:g} {self.settings.unit}",
                "Keep the sensor still, set a wider range in it, or correct `range` in the bench file",
            )
        still = np.ptp(values, axis=0) == 0
        if len(values) >= STUCK and still.any() and not still.all():
            name = names[int(np.argmax(still))]
            raise SensorFault(
                f"{self.name}: {name} gave the same value {len(values)} times while others changed: it is stuck",
                "Switch the sensor off and on; check that the column is the right one",
            )


def _most(values: NDArray[np.float64]) -> float:
    return float(np.abs(values).max())


def connect(address: Address, links: Links, settings: Settings, name: str) -> LineSensor:
    """The sensor at `address`. Raises LinkRefused when its wire cannot be opened."""
    return LineSensor(links.link(address.url, name), settings, name)
