"""PI E-727 controller with a P-611.3S NanoCube: positions and oscillations in um, GCS 2.0 over TCP or a serial line.

Safe by design: limits are checked before anything is sent, arrival is measured and not assumed, every command
is followed by `ERR?`, and a stop can always be sent. Source: see the module `parameters`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drivers.errors import LimitError, NotSettled, StreamError
from drivers.instrument import OUTSIDE_POSITION, Check, Identity, require_positive, require_range, require_within
from drivers.pi_e727 import parameters as e727
from drivers.transport import Address, Links
from drivers.transport.gcs import Gcs

POLL_S = 0.01
PATIENCE_S = 5.0  # for an arrival: a full travel at any sensible speed
STOPPING_S = 1.0
FEWEST_POINTS = 20  # of a period: coarser is no sine
SLOWEST_HZ = 1e-3  # a period of 1000 s; slower is a mistyped setting


@dataclass(frozen=True)
class Settings:
    """Axes as {name: the controller's identifier}, in the order of the wave generators; limits for each of them.

    Raises ValueError for impossible values.
    """

    axes: Mapping[str, str] = field(default_factory=lambda: {"x": "1", "y": "2", "z": "3"})
    limits_um: tuple[float, float] = (0.0, 100.0)
    limit_hz: float = 100.0  # of an oscillation: well below the loaded stage's resonance [M]
    settle_um: float = 0.05
    wave_points: int = e727.WAVE_POINTS
    record_hz: float = 1000.0  # at least; whole servo cycles

    def __post_init__(self) -> None:
        if not self.axes or len(set(self.axes.values())) < len(self.axes):
            raise ValueError("axes must name the controller's axes, each once, and at least one")
        require_range(self, "limits_um")
        require_positive(self, "settle_um", "wave_points", "record_hz", "limit_hz")

    def wave(self, name: str, frequency_hz: float, cycle_s: float = e727.USUAL_CYCLE_S) -> Wave:
        """The wave by which the controller `name` plays a frequency. Raises LimitError if it cannot play it."""
        fastest_hz = 1 / (FEWEST_POINTS * cycle_s)
        if not SLOWEST_HZ <= frequency_hz <= fastest_hz:
            raise LimitError(
                f"{name}: the wave tables cannot play {frequency_hz:g} Hz; nothing was moved",
                f"Ask for a frequency of at least {SLOWEST_HZ:g} Hz and of at most {fastest_hz:g} Hz",
            )
        if frequency_hz > self.limit_hz:
            raise LimitError(
                f"{name}: {frequency_hz:g} Hz is above its limit of {self.limit_hz:g} Hz; nothing was moved",
                "Ask for a lower frequency, or change limit_hz in the bench file after checking the mounted load",
            )
        return Wave.near(frequency_hz, cycle_s, self.wave_points)


@dataclass(frozen=True, eq=False)
class Recording:
    """Positions of one axis, measured by the controller from the start of the oscillation, `position_um` (n,)."""

    position_um: NDArray[np.float64]
    interval_s: float


@dataclass(frozen=True)
class Wave:
    """A period as the controller plays it: an even number of points, each held for `cycles` servo cycles."""

    points: int
    cycles: int
    cycle_s: float

    @classmethod
    def near(cls, frequency_hz: float, cycle_s: float, most_points: int) -> Wave:
        """The wave nearest to a frequency, as fine as its number of points allows."""
        all_cycles = 1 / (frequency_hz * cycle_s)
        cycles = math.ceil(all_cycles / most_points)
        return cls(2 * round(all_cycles / cycles / 2), cycles, cycle_s)

    @property
    def frequency_hz(self) -> float:
        return 1 / (self.points * self.cycles * self.cycle_s)


class Positioner:
    """A flexure stage that is moved to positions in um or oscillates about them."""

    def __init__(self, gcs: Gcs, settings: Settings) -> None:
        self.name = gcs.name
        self.settings = settings
        self._gcs, self._clock = gcs, gcs.link.clock
        self._swinging: str | None = None  # the axis that oscillates
        self._gcs.error()  # clear the error of an earlier client

    def identify(self) -> Identity:
        """Maker's model, serial number and firmware as the controller reports them."""
        parts = [part.strip() for part in ",".join(self._gcs.ask(e727.IDENTITY)).split(",")]
        _, model, serial, firmware = [*parts, "", "", "", ""][:4]
        return Identity(f"PI {model}", serial, firmware)

    def self_test(self) -> list[Check]:
        """Model, axes, travel, readiness. A servo that is off passes, with a remark."""
        model, known_ids, ids = self.identify().model, self._gcs.ask(e727.AXES), self.settings.axes.values()
        low, high = self._travel_um()
        lower, upper = self.settings.limits_um
        ready = self._gcs.ask_byte(e727.READY) == e727.IS_READY
        servo = self._gcs.values(e727.ASK_SERVO)
        off = [name for name, axis in self.settings.axes.items() if not servo.get(axis)]
        return [
            Check("model", "E-727" in model, model),
            Check("axes", set(ids) <= set(known_ids), f"{', '.join(ids)} of {', '.join(known_ids)}"),
            Check("travel", low <= lower and upper <= high, f"{low:g} .. {high:g} um, used {lower:g} .. {upper:g} um"),
            Check("ready", ready, "ready" if ready else "busy: wait until it has finished"),
            Check("servo", True, f"off: {', '.join(off)}" if off else "on"),
        ]

    def servo(self, on: bool) -> None:
        """Close or open the loop of every axis; moves and oscillations need it closed."""
        states = " ".join(f"{axis} {int(on)}" for axis in self.settings.axes.values())
        self._gcs.tell(f"{e727.SERVO} {states}")

    def position_um(self, axis: str) -> float:
        """Position of an axis, measured by the controller."""
        return self._gcs.number(f"{e727.POSITION} {self._id(axis)}")

    def move_to(self, axis: str, um: float) -> None:
        """Move one axis to `um` and return when it is at rest there.

        Raises LimitError before anything is sent, Refused with the controller's error, NotSettled.
        """
        self._require_within_limits(axis, um)
        axis_id = self._id(axis)
        self._gcs.tell(f"{e727.MOVE} {axis_id} {um:.6f}")
        self._poll_until(
            lambda: self._gcs.number(f"{e727.ON_TARGET} {axis_id}") == 1, PATIENCE_S, f"{axis} is not there"
        )
        position_um = self.position_um(axis)
        if not abs(position_um - um) <= self.settings.settle_um:
            raise NotSettled(
                f"{self.name}: {axis} is at {position_um:.3f} um instead of {um:.3f} um, "
                f"more than {self.settings.settle_um:g} um away",
                "Take the load off the stage, check the servo's settings, then repeat the move",
            )

    def oscillate(self, axis: str, *, peak_to_peak_um: float, frequency_hz: float, centre_um: float) -> float:
        """Swing one axis in a sine around `centre_um` until `stop`; the frequency really generated, in Hz.

        Starts from the lowest place, and the recorder with it. Raises LimitError before anything is set when the
        swing leaves the limits or the generator cannot play the frequency; Refused, NotSettled.
        """
        half_um = peak_to_peak_um / 2
        self._require_swing(peak_to_peak_um)
        self._require_within_limits(axis, centre_um - half_um)
        self._require_within_limits(axis, centre_um + half_um)
        wave = self._wave(frequency_hz)
        self.move_to(axis, centre_um - half_um)
        self._write_wave(axis, wave, peak_to_peak_um, centre_um - half_um)
        self._arm_recorder(axis, wave.cycle_s)
        self._gcs.tell(f"{e727.PLAY} {self._place(axis)} {e727.FROM_THE_START}")
        self._swinging = axis
        return wave.frequency_hz

    def recorded(self, axis: str) -> Recording:
        """The values of the axis' last oscillation that are recorded so far. Raises StreamError if there are none."""
        place = self._place(axis)
        count = int(self._gcs.number(f"{e727.RECORDED_POINTS} {place}"))
        if not count:
            remedy = "Let the axis oscillate first, for longer than one sample of the recorder"
            raise StreamError(f"{self.name}: the recorder has no values of {axis}", remedy)
        header, rows = self._gcs.rows(f"{e727.RECORDED} 1 {count} {place}")
        if len(rows) != count or not all(len(row) == 1 for row in rows) or "SAMPLE_TIME" not in header:
            fault = f"{self.name}: the record of {axis} has {len(rows)} rows instead of {count}"
            raise StreamError(fault, "Close other programs that use the controller, then repeat")
        return Recording(np.array(rows)[:, 0], float(header["SAMPLE_TIME"]))

    def require_steady(self) -> None:
        """Raises StreamError where an oscillation that was begun has stopped."""
        if self._swinging is None:
            return
        playing = int(self._gcs.ask_byte(e727.WAVES), 16)
        if not playing >> (self._place(self._swinging) - 1) & 1:
            raise StreamError(
                f"{self.name}: the oscillation of {self._swinging} has stopped",
                "Check whether the controller lost power or somebody stopped it, then resume the run",
            )

    def halt(self) -> None:
        """Stop all axes and waves and return at once; `stop` must follow."""
        self._swinging = None
        self._gcs.tell_byte(e727.STOP)

    def stop(self) -> None:
        """Stop all axes and waves at once. Returns when nothing moves."""
        self.halt()
        self._gcs.error()  # 10, stopped: that is what was asked for
        self._poll_until(self._still, STOPPING_S, "an axis still moves after a stop")

    def _still(self) -> bool:
        """Whether neither an axis nor a generator is at work: both answer with bits in hexadecimal."""
        return all(self._gcs.ask_byte(number).strip() == "0" for number in (e727.WAVES, e727.MOVING))

    def _id(self, axis: str) -> str:
        if axis not in self.settings.axes:
            known_axes = ", ".join(self.settings.axes)
            raise LimitError(f"{self.name}: there is no axis {axis!r}; nothing was sent", f"Use one of {known_axes}")
        return self.settings.axes[axis]

    def _place(self, axis: str) -> int:
        """Number of the wave generator, wave table and record table of an axis."""
        self._id(axis)
        return list(self.settings.axes).index(axis) + 1

    def _travel_um(self) -> tuple[float, float]:
        """The travel that all axes share."""
        low, high = self._gcs.values(e727.TRAVEL_LOW), self._gcs.values(e727.TRAVEL_HIGH)
        return max(low.values()), min(high.values())

    def _require_within_limits(self, axis: str, um: float) -> None:
        require_within(f"{self.name}: {axis} = ", um, self.settings.limits_um, "um", OUTSIDE_POSITION)

    def _require_swing(self, peak_to_peak_um: float) -> None:
        if not peak_to_peak_um > 0:
            fault = f"{self.name}: an oscillation of {peak_to_peak_um:g} um is not possible; nothing was sent"
            raise LimitError(fault, "Ask for a positive width, peak to peak")

    def _wave(self, frequency_hz: float) -> Wave:
        """The wave by which the controller plays a frequency. Raises LimitError if it cannot play it."""
        cycle_s = self._gcs.number(f"{e727.ASK_PARAMETER} 1 {e727.CYCLE_TIME}")
        return self.settings.wave(self.name, frequency_hz, cycle_s)

    def _write_wave(self, axis: str, wave: Wave, peak_to_peak_um: float, lowest_um: float) -> None:
        place, n = self._place(axis), wave.points
        size = f"{peak_to_peak_um:.6f} {lowest_um:.6f}"
        self._gcs.tell(f"{e727.WAVE} {place} X {e727.SINE} {n} {size} {n} 0 {n // 2}")
        self._gcs.tell(f"{e727.SELECT_WAVE} {place} {place}")
        self._gcs.tell(f"{e727.WAVE_RATE} {place} {wave.cycles} {e727.STRAIGHT}")
        self._gcs.tell(f"{e727.WAVE_CYCLES} {place} {e727.ENDLESS}")

    def _arm_recorder(self, axis: str, cycle_s: float) -> None:
        place = self._place(axis)
        self._gcs.tell(f"{e727.RECORD} {place} {self._id(axis)} {e727.ACTUAL_POSITION}")
        self._gcs.tell(f"{e727.RECORD_RATE} {max(1, int(1 / (self.settings.record_hz * cycle_s) + 1e-6))}")
        self._gcs.tell(f"{e727.RECORD_TRIGGER} {place} {e727.WITH_THE_WAVE} 0")

    def _poll_until(self, reached: Callable[[], bool], timeout_s: float, complaint: str) -> None:
        deadline = self._clock.now() + timeout_s
        while not reached():
            if self._clock.now() >= deadline:
                remedy = "Look at the stage and its load, switch the servo off and on, then repeat"
                raise NotSettled(f"{self.name}: {complaint} after {timeout_s:g} s", remedy)
            self._clock.sleep(POLL_S)


def connect(address: Address, links: Links, settings: Settings, name: str) -> Positioner:
    """The positioner at `address`. Raises LinkRefused when its wire cannot be opened, LinkTimeout when it is silent."""
    return Positioner(Gcs(links.link(address.url, name), name, e727.explain), settings)
