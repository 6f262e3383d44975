"""Any SCPI multimeter or scanner that measures DC voltage: the converter of a laboratory that has no other.

The commands are those of SCPI-1999 and of IEEE 488.2; with `timer` also those with which Keysight's scanners (34970A,
34972A, DAQ970A) and multimeters (3446xA) measure on their own clock and give readings out of their memory meanwhile.
Without it, the program asks for every scan (`READ?`), which every SCPI multimeter understands, a few times a second.

After each record the driver asks for the instrument's errors (`SYST:ERR?`), so that none passes unseen. A reading of
9.9E37 means an overload, and is refused.

Source: SCPI-1999, volume 2, chapters 7.2.1 (9.9E37 is infinity) and 21.8; Keysight 34970A/34972A user's guide and
34460A/61A/65A/70A operating guide, remote interface reference.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Generator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drivers.errors import BadFrame, DriverError, OverRange, Refused, StreamError
from drivers.instrument import Check, Identity, require_positive
from drivers.recorder import Inputs, NoDigitalLines, Recorder, Samples
from drivers.transport import Address, Links
from drivers.transport.lines import TextLines

__all__ = ["Meter", "Settings", "connect"]

INFINITE_V = 9.9e37  # and beyond it, not a number
MOST_VALUES = 500  # of one answer
MOST_ERRORS = 30  # an error queue has 10 or 20 places
POLL_S = 0.02
ERROR = re.compile(r'([+-]?\d+)(?:,\s*"?(.*?)"?)?')
HINTS = {
    -113: "The instrument does not know a command: set `timer: false`, or take lines out of `setup`",
    -213: "It was still measuring; switch it off and on",
    -222: "It does not have this range, input or rate: change range_v, channels, rate_hz or nplc in the bench file",
}
HINT = "Look the error up in the instrument's manual, and change the settings in the bench file"


@dataclass(frozen=True)
class Settings(Inputs[int], NoDigitalLines):
    """Channels as {name: input}, such as 101 of a scanner; of an instrument with one input, 0.

    Those `on_request` are wired too, and are measured only if a procedure asks for them. `nplc` is the time of one
    reading in periods of the mains. `interchannel_s` is from one channel of a scan to the next. `setup` are further
    commands, sent after those of the driver. `memory` is how many readings the instrument holds.
    Raises ValueError for impossible values.
    """

    channels: Mapping[str, int] = field(default_factory=lambda: {"vx": 101, "vy": 102})
    on_request: Mapping[str, int] = field(default_factory=dict)
    rate_hz: float = 5.0
    range_v: float = 10.0
    nplc: float = 1.0
    mains_hz: float = 50.0
    timer: bool = True  # the instrument measures on its own clock
    interchannel_s: float = 0.0
    timeout_s: float = 5.0
    memory: int = 50_000
    setup: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_positive(self, "rate_hz", "range_v", "nplc", "mains_hz", "timeout_s", "memory")
        inputs = list(self.wired.values())
        if not self.channels or (min(inputs) < 1 and inputs != [0]):
            raise ValueError("channels must name inputs of the scanner, such as 101; 0 is the only input of a meter")
        self.require_valid_inputs()
        if (scan_s := len(self.channels) * self.nplc / self.mains_hz) * self.rate_hz > 1:
            raise ValueError(
                f"rate_hz must be at most {1 / scan_s:.3g}: {len(self.channels)} readings of nplc {self.nplc:g} take "
                f"{scan_s:g} s; a shorter nplc gives a higher rate and more noise"
            )

    def commands(self, scans: int) -> list[str]:
        """The commands that prepare a record of `scans` scans."""
        numbers = sorted(set(self.channels.values()) - {0})
        inputs = f"(@{','.join(str(number) for number in numbers)})" if numbers else ""
        inputs_text = f",{inputs}" if inputs else ""
        begin = [f"CONF:VOLT:DC {self.range_v:g}{inputs_text}", f"VOLT:DC:NPLC {self.nplc:g}{inputs_text}"]
        return [*begin, *([f"ROUT:SCAN {inputs}"] if inputs else []), *self._pace(scans, bool(inputs)), *self.setup]

    def _pace(self, scans: int, scanner: bool) -> list[str]:
        if not self.timer:
            return ["TRIG:SOUR IMM", "TRIG:COUN 1"]
        if scanner:
            return ["TRIG:SOUR TIM", f"TRIG:TIM {1 / self.rate_hz:.6g}", f"TRIG:COUN {scans}"]
        sample = ["SAMP:SOUR TIM", f"SAMP:TIM {1 / self.rate_hz:.6g}", f"SAMP:COUN {scans}"]
        return ["TRIG:SOUR IMM", "TRIG:COUN 1", *sample]


class Meter(Recorder[Settings]):
    """The multimeter or scanner; reset when it is connected."""

    def __init__(self, lines: TextLines, links: Links, settings: Settings, name: str) -> None:
        self.name = name
        self.settings = settings
        self._lines, self._clock = lines, links.clock
        self._lines.write("*RST")
        self._lines.write("*CLS")
        self._ask("*IDN?")  # some VISA libraries report no error for an address without an instrument

    def identify(self) -> Identity:
        """Maker, model, serial number and firmware, as `*IDN?` gives them. Raises BadFrame."""
        answer = self._ask("*IDN?")
        parts = [part.strip() for part in answer.split(",")]
        if len(parts) < 2:
            raise BadFrame(
                f"{self.name}: the answer to '*IDN?' is {answer[:60]!r}, not maker, model, serial number, firmware",
                "Check that the address is that of a SCPI instrument",
            )
        return Identity(f"{parts[0].title()} {parts[1]}", *parts[2:4])

    def self_test(self) -> list[Check]:
        """Check that the instrument accepts the settings of the bench file."""
        scan = f"{', '.join(self.settings.channels)} at {self.settings.rate_hz:g} Hz, {self.settings.range_v:g} V"
        try:
            self._configure(1)
        except Refused as refusal:
            return [Check("settings", False, refusal.what)]
        return [Check("settings", True, scan)]

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        """Record all channels for `duration_s` without a gap, and hand it out in blocks of `block_s`.

        Raises StreamError when readings are missing or late, OverRange for an overload, Refused for an error that the
        instrument reports, LinkTimeout, LinkRefused, BadFrame.
        """
        scans, block = self.scans(duration_s), self.scans(block_s)
        channels, rate_hz = tuple(self.settings.channels), self.settings.rate_hz
        self._configure(scans)
        try:
            start_s = self._clock.now()
            if self.settings.timer:
                self._lines.write("INIT")
                self._points()  # its answer shows that the instrument has begun
            for first in range(0, scans, block):
                volts = self._take(range(first, min(first + block, scans)), start_s)
                yield Samples(volts, channels, rate_hz, start_s + first / rate_hz)
        except BaseException:
            with contextlib.suppress(DriverError):  # the first error is reported
                self._lines.write("ABOR")
            raise
        self._require_no_error("while it measured")

    def _configure(self, scans: int) -> None:
        """Prepare a record. Raises Refused for an error that the instrument reports."""
        for command in ("ABOR", "*CLS", *self.settings.commands(scans)):
            self._lines.write(command)
        self._require_no_error("at its settings")

    def _take(self, scans: range, start_s: float) -> NDArray[np.float64]:
        """The volts of these scans, shape (n, channels), in the order of the channels."""
        take = self._read_memory if self.settings.timer else self._read_each
        values = take(scans, start_s)
        numbers = list(self.settings.channels.values())
        volts = np.array(values).reshape(len(scans), len(numbers))
        places = [sorted(numbers).index(number) for number in numbers]  # a scanner goes by its own numbers
        self._require_in_range(volts := volts[:, places])
        return volts

    def _read_memory(self, scans: range, start_s: float) -> list[float]:
        """The readings of these scans from the instrument's memory, while it measures."""
        width, values = len(self.settings.channels), list[float]()
        piece = max(1, MOST_VALUES // width)
        for first in range(scans.start, scans.stop, piece):
            last = min(first + piece, scans.stop)
            self._until_measured((last - first) * width, start_s + (last - 1) / self.settings.rate_hz)
            values += self._values(f"DATA:REM? {(last - first) * width}", (last - first) * width)
        return values

    def _until_measured(self, count: int, end_s: float) -> None:
        """Wait until `count` readings are in the memory, the last of them due at `end_s`."""
        self._clock.sleep(end_s - self._clock.now())
        while (count_now := self._points()) < count:
            if self._clock.now() > end_s + self.settings.timeout_s:
                self._require_no_error("while it measured")
                raise StreamError(
                    f"{self.name}: has {count_now} of {count} readings {self.settings.timeout_s:g} s after the last "
                    "was due",
                    "Check that nobody has pressed a key at it; lower rate_hz or nplc in the bench file",
                )
            self._clock.sleep(POLL_S)
        if count_now >= self.settings.memory:
            raise StreamError(
                f"{self.name}: its memory of {count_now} readings is full, and readings may be lost",
                "Lower rate_hz in the bench file, or stop other programs on this computer",
            )

    def _points(self) -> int:
        (count,) = self._values("DATA:POIN?", 1)
        if not np.isfinite(count):
            raise BadFrame(
                f"{self.name}: the answer to 'DATA:POIN?' is {count:g}, not a number of readings",
                "Switch the instrument off and on, and stop other programs that use it",
            )
        return int(count)

    def _read_each(self, scans: range, start_s: float) -> list[float]:
        """The readings of these scans, requested one by one at the rate. Raises StreamError for a late reading."""
        width, period_s, values = len(self.settings.channels), 1 / self.settings.rate_hz, list[float]()
        for scan in scans:
            due_s = start_s + scan * period_s
            self._clock.sleep(due_s - self._clock.now())
            if (late_s := self._clock.now() - due_s) > period_s:
                raise StreamError(
                    f"{self.name}: scan {scan + 1} is {late_s:.2f} s late: a reading takes longer than 1/rate_hz",
                    "Lower rate_hz or nplc in the bench file, or set `timer: true` if the instrument has a timer",
                )
            values += self._values("READ?", width)
        return values

    def _values(self, command: str, count: int) -> list[float]:
        """`count` numbers. Raises BadFrame for another answer."""
        answer = self._ask(command)
        try:
            values = [float(part) for part in answer.split(",")]
        except ValueError:
            values = []
        if len(values) != count:
            self._require_no_error(f"at {command}")
            raise BadFrame(
                f"{self.name}: the answer to {command!r} is {answer[:60]!r}, not {count} numbers",
                "Check `channels` and `setup` in the bench file: units, times or alarms must not be among the readings",
            )
        return values

    def _ask(self, command: str) -> str:
        return self._lines.query(command, self.settings.timeout_s + len(self.settings.channels) * self._reading_s)

    @property
    def _reading_s(self) -> float:
        return self.settings.nplc / self.settings.mains_hz

    def _require_in_range(self, volts: NDArray[np.float64]) -> None:
        """An overload has no voltage, and a mean with one has no meaning."""
        is_overload = ~(np.abs(volts) < INFINITE_V)
        if not is_overload.any():
            return
        k = int(np.argmax(is_overload.sum(axis=0)))
        name = list(self.settings.channels)[k]
        raise OverRange(
            f"{self.name}: {name} (input {self.settings.channels[name]}) was beyond its range of "
            f"{self.settings.range_v:g} V in {is_overload[:, k].sum()} of {len(volts)} readings",
            "Check the sensor's supply and wiring, or set a wider range_v in the bench file",
        )

    def _require_no_error(self, occasion: str) -> None:
        """Raises Refused with the first of the instrument's errors; its queue is empty afterwards."""
        errors = list[tuple[int, str]]()
        while len(errors) < MOST_ERRORS and (error := self._error())[0]:
            errors.append(error)
        if errors:
            code, text = errors[0]
            others_text = f", and {len(errors) - 1} more" if len(errors) > 1 else ""
            fault = f"{self.name}: reports error {code}, {text}, {occasion}{others_text} (SYST:ERR?)"
            raise Refused(fault, HINTS.get(code, HINT), code)

    def _error(self) -> tuple[int, str]:
        answer = self._ask("SYST:ERR?")
        if not (match := ERROR.fullmatch(answer)):
            raise BadFrame(
                f"{self.name}: the answer to 'SYST:ERR?' is {answer[:60]!r}, not a number and a text",
                "Switch the instrument off and on, and stop other programs that use it",
            )
        return int(match[1]), match[2] or "no text"


def connect(address: Address, links: Links, settings: Settings, name: str) -> Meter:
    """The instrument at `address`, a VISA resource, TCP or a serial line. Raises LinkRefused; resets it."""
    return Meter(links.lines(address.url, name), links, settings, name)
