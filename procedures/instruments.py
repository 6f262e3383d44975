"""The interface of each instrument by its role on the bench. A driver with these methods can have the role."""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from drivers.motor_stage import Turn
    from drivers.recorder import Samples

Read = TypeVar("Read")
OUTPUTS = (("vx", "vy", "vz"), ("ax", "ay", "az"))  # of an analog accelerometer, and of a digital one


def output_channel(axis: str, channels: Collection[str]) -> str | None:
    """The channel of the accelerometer's output along "x", "y" or "z"; None if the sensor does not have this axis."""
    return next((names["xyz".index(axis)] for names in OUTPUTS if names["xyz".index(axis)] in channels), None)


class Stage(Protocol):
    """One rotary stage."""

    def move_to(self, deg: float) -> None: ...
    def angle_deg(self) -> float: ...
    def home(self) -> None: ...
    def referenced(self) -> bool: ...
    def stop(self) -> None: ...
    def rate_deg_s(self, wanted_deg_s: float) -> float:
        """The nearest rate that the stage can turn at."""

    def turning(self, rate_deg_s: float, first_deg: float, last_deg: float) -> AbstractContextManager[Turn]:
        """A turn from one angle to another. The stage has the rate when the body begins, and is at rest after it."""


class Adc(Protocol):
    """The converter of the sensor's outputs."""

    def prepare(self) -> None:
        """Set up the instrument, so that the next record begins at once."""

    def acquire(self, duration_s: float) -> Samples: ...
    def acquire_with(self, duration_s: float, reading: Callable[[], Read]) -> tuple[Samples, Read]:
        """The samples, and the value of `reading` in the middle of the dwell."""

    def acquire_watched(self, duration_s: float, watch: Callable[[], object], every_s: float) -> Samples:
        """The samples; `watch` is called every `every_s`, and at the end."""

    def only(self, *outputs: str) -> Adc:
        """The converter with the channels of these outputs only. Raises if the bench has no such channel."""

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        """The samples in blocks of `block_s`, without a gap between them. Closing it ends the record."""

    def power(self, on: bool) -> None:
        """Switch the sensor's supply."""


class Oven(Protocol):
    """Oven and thermometer."""

    def temperature_c(self) -> float | None:
        """Temperature of the sensor, C; None on a bench without a thermometer."""

    def set_temperature(self, c: float) -> None: ...
    def run(self, on: bool) -> None: ...


class Tilt(Protocol):
    """A reading of the level, deg."""

    @property
    def x_deg(self) -> float: ...
    @property
    def y_deg(self) -> float: ...
    @property
    def std_deg(self) -> float: ...


class Level(Protocol):
    """The digital level on the table of beta."""

    def read(self) -> Tilt: ...


class Positioner(Protocol):
    """The nano-positioner that shakes the sensor along its x axis."""

    def servo(self, on: bool) -> None: ...
    def move_to(self, axis: str, um: float) -> None: ...
    def oscillate(self, axis: str, *, peak_to_peak_um: float, frequency_hz: float, centre_um: float) -> float:
        """Begin a sine motion. Returns its actual frequency, Hz."""

    def stop(self) -> None: ...


class Clock(Protocol):
    """The only way to wait."""

    def now(self) -> float: ...
    def sleep(self, seconds: float) -> None: ...
