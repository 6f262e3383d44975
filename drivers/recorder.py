"""Records of a converter, from the stream of its driver: the common part of all converters."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.errors import LimitError, NotWired

Read = TypeVar("Read")
Input = TypeVar("Input", int, str)  # a number, or the name of a record


@dataclass(frozen=True, eq=False)
class Samples:
    """A block of samples: `volts`, shape (n, channels), the first at `start_s` of the clock.

    Of a digital sensor, `volts` are in the unit of its settings. `temperature_c` is the temperature that the sensor
    reports; None if it reports none. `lost`: number of samples that are missing in or near this block. The record keeps
    neither: the temperature is that of the pose.
    """

    volts: NDArray[np.float64]
    channels: tuple[str, ...]
    rate_hz: float
    start_s: float
    temperature_c: float | None = None
    lost: int = 0


@dataclass(frozen=True)
class Inputs(Generic[Input]):
    """The inputs of a converter, as in its settings: {name: input}.

    Inputs `on_request` are wired too, but are measured only if a procedure asks for them. Both are fields of the
    settings of each converter, with its own defaults.
    """

    channels: Mapping[str, Input]
    on_request: Mapping[str, Input]
    interchannel_s = 0.0  # from one channel of a scan to the next; 0 where all are read at once

    def lag_s(self, channel: str) -> float:
        """Delay of this channel's samples after the beginning of a scan."""
        return list(self.channels).index(channel) * self.interchannel_s if self.interchannel_s else 0.0

    @property
    def wired(self) -> Mapping[str, Input]:
        """All inputs by name: the channels, and those on request."""
        return {**self.channels, **self.on_request}

    def only(self, name: str, outputs: Sequence[str]) -> Self:
        """Settings of a converter `name` whose channels are these; of a batch `a1.mx`, `a2.mx` are both `mx`.

        Raises NotWired for an output that no input is wired to.
        """
        if missing := [
            name_asked for name_asked in outputs if name_asked not in {key.rpartition(".")[2] for key in self.wired}
        ]:
            raise NotWired(
                f"{name}: no input is wired to {', '.join(missing)}; there are {', '.join(self.wired)}",
                "Name the inputs in the bench file, under channels or on_request of the converter's settings",
            )
        channels = {name_asked: k for name_asked, k in self.wired.items() if name_asked.rpartition(".")[2] in outputs}
        return replace(self, channels=channels, on_request={})

    def require_valid_inputs(self) -> None:
        """Raises ValueError for a name that is both a channel and on request, and for a negative time."""
        if not self.interchannel_s >= 0:
            raise ValueError("interchannel_s must be a time of 0 s or more")
        if duplicates := self.channels.keys() & self.on_request.keys():
            raise ValueError(f"{', '.join(sorted(duplicates))} is a channel already; remove it from on_request")


class NoDigitalLines:
    """Settings of a converter without digital lines."""

    @property
    def power_dio(self) -> None:
        """None: no line switches the sensor's power."""

    @property
    def interlocks(self) -> Mapping[str, int]:
        """Empty: the instrument has no contacts."""
        return {}


class Selectable(Protocol):
    """Settings with a rate, from which channels can be chosen."""

    @property
    def rate_hz(self) -> float: ...

    def only(self, name: str, outputs: Sequence[str]) -> Self: ...


Settings = TypeVar("Settings", bound=Selectable)


class Recorder(Generic[Settings]):
    """A converter whose driver has `stream`: a record without a gap, in blocks."""

    name: str
    settings: Settings

    def power(self, on: bool) -> None:  # noqa: ARG002
        """Raises LimitError: no line of it switches the sensor."""
        raise LimitError(
            f"{self.name}: the program cannot switch the power", "Switch the sensor by hand, or use a LabJack T7"
        )

    def only(self, *outputs: str) -> Self:
        """The device with these channels only. Raises LimitError for an unknown channel."""
        device = copy(self)
        device.settings = self.settings.only(self.name, outputs)
        return device

    def prepare(self) -> None:
        """Set up the instrument, so that the next record begins at once. Most have nothing to set up."""

    def scans(self, duration_s: float) -> int:
        """The number of whole scans in a time, at least 1."""
        return max(1, round(duration_s * self.settings.rate_hz))

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        """Record all channels for `duration_s` and hand it out in blocks of `block_s`."""
        raise NotImplementedError

    def acquire(self, duration_s: float) -> Samples:
        """Record all channels for `duration_s`, rounded to whole scans; raises as `stream`."""
        (samples,) = self.stream(duration_s, duration_s)
        return samples

    def acquire_with(self, duration_s: float, reading: Callable[[], Read]) -> tuple[Samples, Read]:
        """Acquire samples, and call `reading` in the middle of the record; return both results."""
        with contextlib.closing(self.stream(duration_s, duration_s / 2)) as stream:
            blocks = [next(stream)]
            value = reading()
            blocks += stream
        return join_samples(blocks), value

    def acquire_watched(self, duration_s: float, watch: Callable[[], object], every_s: float) -> Samples:
        """Acquire samples; call `watch` about every `every_s` and at the end. An error of `watch` ends the record."""
        blocks = []
        with contextlib.closing(self.stream(duration_s, every_s)) as stream:
            for block in stream:
                watch()
                blocks.append(block)
        return join_samples(blocks)


def join_samples(blocks: Sequence[Samples]) -> Samples:
    """Successive blocks as one."""
    first = blocks[0]
    volts = np.concatenate([block.volts for block in blocks])
    reported = [block.temperature_c for block in blocks if block.temperature_c is not None]
    temperature_c = float(np.mean(reported)) if reported else None
    lost = sum(block.lost for block in blocks)
    return Samples(volts, first.channels, first.rate_hz, first.start_s, temperature_c, lost)
