"""MEAS/TE DPG2: digital level with two axes, at 9600 8N1.

After power-on it sends readings without a request: `X=+01.234` CR LF `Y=-00.007` CR LF, in deg, again and again.
Commands are single letters without an end of line: `s` stop (echoed), `S` start; when stopped `R` one reading, `V`
version and serial.

The driver stops it and asks for readings one by one. It takes the next whole pair of lines and ignores the bytes before
it: a part of a line, an echo inside a line, and lines of a level that did not receive the stop.

Source: instruction manual of the DPG series, July 2015, 6.1 and 6.2. Beyond its range it shows `+++++++` or `-------`
by the manual of the same maker's P series, 5.7.4.2; for the DPG2 this is from memory, like its range.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from drivers.errors import BadFrame, InstrumentError, LinkTimeout, NotSettled
from drivers.instrument import Check, Identity, require_positive
from drivers.transport import Address, Links
from drivers.transport.link import Link

STOP, ONE_READING, VERSION = b"s", b"R", b"V"
PAIR = re.compile(rb"X=([+-]\d\d\.\d{2,3}|\+{6,7}|-{6,7})\r\nY=([+-]\d\d\.\d{2,3}|\+{6,7}|-{6,7})\r\n")
NAMED = re.compile(rb"([A-Z][ -~]*)\r\nSN:([ -~]+)\r\n")
RESOLUTION_DEG = 0.001
QUIET_S = 0.3  # a free-running level is never silent for so long
TIMEOUT_S = 0.5  # for one answer
ATTEMPTS = 3  # every command of ours may be repeated
REMEDY = "Check power and cable, and that the line has 9600 baud, 8 data bits and no parity"


@dataclass(frozen=True)
class Settings:
    """How a reading is taken, and the accuracy of the level. Raises ValueError for impossible values."""

    readings: int = 10  # that are averaged
    interval_s: float = 0.1  # from one to the next
    accuracy_deg: float = 0.1  # of the rig's level (Ang V)
    unrest_deg: float = 0.02  # standard deviation of the readings above which the level still swings
    patience_s: float = 10.0  # to come to rest
    frozen: int = 30  # number of equal readings that means a stuck level
    range_deg: float = 30.0  # each way; of the model NS-30 [M]

    def __post_init__(self) -> None:
        require_positive(self, "interval_s", "accuracy_deg", "unrest_deg", "patience_s", "range_deg")
        if not 1 <= self.readings < self.frozen:
            raise ValueError("readings must be at least 1, and frozen more than readings")


@dataclass(frozen=True)
class LevelReading:
    """Inclination of the level's axes, in deg, positive where the axis' positive end is up.

    `std_deg` is the standard deviation of either mean, of `n` readings: from their scatter, and never less than that
    of the last digit's rounding. `accuracy_deg` is the accuracy of the level without that rounding.
    """

    x_deg: float
    y_deg: float
    std_deg: float
    n: int
    accuracy_deg: float


class Level:
    """The level, silent except when it is asked."""

    def __init__(self, link: Link, settings: Settings, name: str) -> None:
        self.name = name
        self.settings = settings
        self._link, self._clock = link, link.clock
        self._silence()

    def identify(self) -> Identity:
        """Version and serial number, as the level reports them. Raises LinkTimeout, BadFrame."""
        self._silence()
        version, serial = self._query(VERSION, NAMED, "version")
        return Identity("MEAS DPG2", serial, version)

    def self_test(self) -> list[Check]:
        """Check that the level shows an angle at rest."""
        try:
            reading = self.read()
        except InstrumentError as fault:
            return [Check("reading", False, fault.what)]
        angles = f"x {reading.x_deg:+.3f}, y {reading.y_deg:+.3f} deg"
        return [Check("reading", True, f"{angles}, standard deviation {reading.std_deg:.4f} deg")]

    def read(self) -> LevelReading:
        """The mean of `settings.readings` readings, once they agree.

        Raises:
            NotSettled: the level still swings when the patience is over.
            InstrumentError: it is beyond its range, or its reading has stuck.
            LinkTimeout, BadFrame: it is silent, or it sends bytes that are not readings.
        """
        self._silence()
        deadline, readings = self._clock.now() + self.settings.patience_s, [self._read_once()]
        while not self._has_settled(readings, deadline):
            self._clock.sleep(self.settings.interval_s)
            readings.append(self._read_once())
        return self._mean(readings[-self.settings.readings :])

    def _mean(self, readings: list[tuple[float, float]]) -> LevelReading:
        x_deg, y_deg = np.mean(readings, axis=0)
        std_deg = max(_std_deg(readings) / math.sqrt(len(readings)), RESOLUTION_DEG / math.sqrt(12))
        return LevelReading(float(x_deg), float(y_deg), std_deg, len(readings), self.settings.accuracy_deg)

    def _has_settled(self, readings: list[tuple[float, float]], deadline: float) -> bool:
        """Whether the last readings agree. Raises NotSettled after the patience, InstrumentError for equal readings."""
        recent = readings[-self.settings.readings :]
        if len(recent) < self.settings.readings:
            return False
        if (scatter_deg := _std_deg(recent)) > self.settings.unrest_deg:
            if self._clock.now() <= deadline:
                return False
            raise NotSettled(
                f"{self.name}: after {self.settings.patience_s:g} s readings still scatter by {scatter_deg:.3f} deg",
                "Wait until the plate is at rest, and keep machines that shake it away",
            )
        if len(readings) >= self.settings.frozen and len(set(readings[-self.settings.frozen :])) == 1:
            raise self._stuck(*readings[-1])
        return len(recent) == 1 or len(set(recent)) > 1

    def _stuck(self, x_deg: float, y_deg: float) -> InstrumentError:
        return InstrumentError(
            f"{self.name}: x {x_deg:+.3f}, y {y_deg:+.3f} deg was received {self.settings.frozen} times in a row",
            "Switch the level off and on; if the level has very low noise, increase `frozen` in the bench file",
        )

    def _read_once(self) -> tuple[float, float]:
        """One reading. Raises InstrumentError beyond the range."""
        texts = self._query(ONE_READING, PAIR, "reading")
        for axis, text in zip("xy", texts, strict=True):
            if not text[-1].isdigit():
                raise InstrumentError(
                    f"{self.name}: the {axis} axis is beyond its range of {self.settings.range_deg:g} deg ({text})",
                    "Turn alpha to 0, and check that the level lies flat on the table",
                )
        return float(texts[0]), float(texts[1])

    def _silence(self) -> None:
        """Stop its output and discard it. The next answer shows whether the level received the command."""
        self._link.write(STOP)
        self._link.discard(QUIET_S)

    def _query(self, command: bytes, answer: re.Pattern[bytes], quantity: str) -> tuple[str, str]:
        """The two parts of the first whole `answer`. Raises LinkTimeout after silence, BadFrame after other bytes."""
        received = b""
        for _ in range(ATTEMPTS):
            self._link.discard()  # a late answer, or output of a level that did not receive the stop
            self._link.write(command)
            received, match = self._listen(answer)
            if match:
                return match[1].decode(), match[2].decode()
        context = f"{self.name}: asking for its {quantity} ({command.decode()}) on {self._link.url}"
        if received:
            raise BadFrame(
                f"{context}: received {len(received)} bytes that are not a reading ({received[:24]!r})", REMEDY
            )
        raise LinkTimeout(f"{context}: no answer within {TIMEOUT_S:g} s, {ATTEMPTS} times", REMEDY)

    def _listen(self, answer: re.Pattern[bytes]) -> tuple[bytes, re.Match[bytes] | None]:
        """The bytes received until the answer is complete or the time is over."""
        received = b""
        for next_bytes in self._link.until(self._clock.now() + TIMEOUT_S):
            received += next_bytes
            if match := answer.search(received):
                return received, match
        return received, None


def _std_deg(readings: list[tuple[float, float]]) -> float:
    """Standard deviation of single readings, both axes pooled; 0 for one reading."""
    return float(np.sqrt(np.var(readings, axis=0, ddof=1).mean())) if len(readings) > 1 else 0.0


def connect(address: Address, links: Links, settings: Settings, name: str) -> Level:
    """The level at `address`, with its output stopped. Raises LinkRefused if the link cannot be opened."""
    return Level(links.link(address.url, name), settings, name)
