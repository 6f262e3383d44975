"""A digital sensor that sends lines of text without requests, over a serial line, TCP or UDP.

It is in the role of the converter, and its samples are in the `unit` of the settings in place of V. The driver writes
nothing to it. It discards old lines in the buffers before a record, and an incomplete first line.

With a column `time`, lost samples are found by the gaps of the sensor's time, and repeated ones are dropped. A record
with more than `most_lost` of its samples lost is refused, as is one with an axis at the end of its range or stuck.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from drivers.digital.reception import Batch, Reception, TimeBase
from drivers.digital.sensor import TEST_S, DigitalSensor
from drivers.digital.settings import OUTPUTS, TEMPERATURE, VOLTAGES, DigitalSettings
from drivers.errors import BadFrame, DriverError, LinkTimeout
from drivers.imu_lines.lines import TIME, Assembly
from drivers.imu_lines.proposal import propose_settings
from drivers.instrument import Check, Identity, require_positive
from drivers.transport import Address, Links

WRAP = 2**32  # counts of the sensor's time
LONGEST = 1024  # bytes without an end of line
DEFAULT_COLUMNS = (TIME, TEMPERATURE)  # columns that every record reads


@dataclass(frozen=True)
class Settings(DigitalSettings):
    """The line: `columns` are {ax: 1, ay: 2, az: 3}, by number from 1, or by name for `named` and `teleplot`.

    Columns of a gyroscope (gx, gy, gz) and a magnetometer (mx, my, mz) are recorded for procedures that ask for them.
    The columns supply and d63 are voltages of the board's converter. A column `temperature` is the sensor's, in C: it
    becomes the temperature of a pose. A column `time` is the sensor's own time, in units
    of `time_unit_s`. `range` is the end of the accelerometer's range each way, in `unit`. Raises ValueError for
    impossible values.
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
        self.require_valid()
        require_positive(self, "time_unit_s")
        if not set(self.columns) & {*OUTPUTS} or not set(self.columns) <= {*OUTPUTS, *VOLTAGES, *DEFAULT_COLUMNS}:
            other_names = f"{', '.join(VOLTAGES)}, {TEMPERATURE} and {TIME}"
            raise ValueError(f"columns must name outputs of {', '.join(OUTPUTS)}, and may name {other_names}")
        if len(set(self.columns.values())) < len(self.columns):
            raise ValueError("columns must be different; two names have the same column")
        numbered = self.format in ("csv", "nmea")
        if any(isinstance(column, int) != numbered or column in (0, "") for column in self.columns.values()):
            raise ValueError(f"columns of {self.format} are {'numbers, from 1' if numbered else 'names'}")

    @property
    def wired(self) -> Mapping[str, int | str]:
        """All columns but time and temperature, by name."""
        return {name: column for name, column in self.columns.items() if name not in DEFAULT_COLUMNS}

    @property
    def kinds(self) -> tuple[str, str, str]:
        return self.unit, self.gyro_unit, self.field_unit

    def chosen(self, outputs: Sequence[str]) -> Settings:
        return replace(self, columns={k: c for k, c in self.columns.items() if k in (*outputs, *DEFAULT_COLUMNS)})


class LineDecoder:
    """Samples of the columns `names`, and the sensor's time, out of lines."""

    def __init__(self, settings: Settings) -> None:
        self.assembly = Assembly(settings.format, settings.columns)
        self._names = tuple(settings.channels)

    @property
    def good(self) -> int:
        return self.assembly.good

    @property
    def damaged(self) -> int:
        return self.assembly.damaged

    @property
    def unread(self) -> int:
        return len(self.assembly.remainder)

    def take(self, data: bytes) -> Batch:
        rows = self.assembly.take(data)
        values = np.array([[row[name] for name in self._names] for row in rows]).reshape(len(rows), len(self._names))
        time = np.array([row[TIME] for row in rows], dtype=float) if rows and TIME in rows[0] else None
        warm_c = [row[TEMPERATURE] for row in rows] if rows and TEMPERATURE in rows[0] else []
        return Batch(values, time, warm_c=np.array(warm_c, dtype=float))


class LineSensor(DigitalSensor[Settings, LineDecoder]):
    """The sensor at the other end of the wire."""

    carrier = "lines"
    longest = LONGEST

    def identify(self) -> Identity:
        """A general name: such lines do not identify the sensor."""
        return Identity(f"{self.settings.format} lines at {self.settings.rate_hz:g} Hz, in {self.settings.unit}")

    @property
    def base(self) -> TimeBase:
        return TimeBase(self.settings.time_unit_s, (WRAP,))

    def _decoder(self) -> LineDecoder:
        return LineDecoder(self.settings)

    def _content(self, decoder: LineDecoder) -> str:
        return f"the lines have the columns {', '.join(map(str, decoder.assembly.last_columns))}{self._warm}"

    def _advice(self, decoder: LineDecoder, begun_s: float) -> list[Check]:
        """Settings that fit the lines since `begun_s`, after this test; none if no settings fit."""
        assembly = decoder.assembly
        for data in self._link.until(begun_s + TEST_S):
            assembly.take(data)
        proposal = propose_settings(assembly.shown, max(self._clock.now() - begun_s, 1 / self.settings.rate_hz))
        if proposal is None:
            return []
        columns = ", ".join(f"{name}: {column}" for name, column in proposal["columns"].items())
        other_settings = ", ".join(f"{name}: {value}" for name, value in proposal.items() if name != "columns")
        text = f"if the sensor is at rest, its lines fit the settings {{columns: {{{columns}}}, {other_settings}}}"
        return [Check("proposal", False, text)]

    @property
    def _expected(self) -> str:
        return "line"

    def _unreadable(self, decoder: LineDecoder) -> DriverError:
        assembly = decoder.assembly
        columns = ", ".join(f"{name}: {column}" for name, column in self.settings.columns.items())
        if not assembly.damaged:
            return LinkTimeout(
                f"{self.name}: received no complete line on {self._link.url}", "Check baud rate, power and cable"
            )
        if assembly.unread.isascii() and assembly.unread.isprintable():
            return BadFrame(
                f"{self.name}: lines such as {assembly.unread!r} are not {self.settings.format} with columns {columns}",
                "Correct format and columns in the sensor's settings",
            )
        return BadFrame(
            f"{self.name}: received bytes on {self._link.url} that are not text ({assembly.unread[:16]!r})",
            "The baud rate is probably wrong: write the sensor's, as serial:/dev/ttyUSB0?baud=115200",
        )

    def _lost(self, reception: Reception, decoder: LineDecoder) -> int:
        """Number of lost samples. Without a time, each damaged line is a lost sample."""
        return reception.lost + (decoder.damaged if TIME not in self.settings.columns else 0)


def connect(address: Address, links: Links, settings: Settings, name: str) -> LineSensor:
    """The sensor at `address`. Raises LinkRefused when its wire cannot be opened."""
    return LineSensor(links.link(address.url, name), settings, name)
