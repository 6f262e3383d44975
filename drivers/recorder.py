"""Records of a converter: what every converter does with the stream that its own driver makes."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.errors import LimitError

Read = TypeVar("Read")
Input = TypeVar("Input", int, str)  # a number, or the name of a record


@dataclass(frozen=True, eq=False)
class Samples:
    """A record: `volts` of shape (n, channels), the first scan at `start_s` of the clock."""

    volts: NDArray[np.float64]
    channels: tuple[str, ...]
    rate_hz: float
    start_s: float


class Recorder:
    """A converter whose driver has `stream`: a record without a gap, in blocks."""

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        """Record all channels for `duration_s` and hand it out in blocks of `block_s`."""
        raise NotImplementedError

    def acquire(self, duration_s: float) -> Samples:
        """Record all channels for `duration_s`, rounded to whole scans; raises as `stream`."""
        (samples,) = self.stream(duration_s, duration_s)
        return samples

    def acquire_with(self, duration_s: float, reading: Callable[[], Read]) -> tuple[Samples, Read]:
        """The same, and what `reading` gives in the middle of it, while the device records on."""
        with contextlib.closing(self.stream(duration_s, duration_s / 2)) as stream:
            blocks = [next(stream)]
            read = reading()
            blocks += stream
        return _joined(blocks), read

    def acquire_watched(self, duration_s: float, watch: Callable[[], object], every_s: float) -> Samples:
        """The same as `acquire`; `watch` is called about every `every_s`, and at the end. What it raises ends it."""
        blocks = []
        with contextlib.closing(self.stream(duration_s, every_s)) as stream:
            for block in stream:
                watch()
                blocks.append(block)
        return _joined(blocks)


def chosen_inputs(name: str, wired: Mapping[str, Input], outputs: Sequence[str]) -> dict[str, Input]:
    """The inputs of these outputs, of those that are `wired` to a converter `name`; of a batch `a1.mx` is `mx`.

    Raises LimitError for an output that no input is wired to.
    """
    if missing := [each for each in outputs if each not in {key.rpartition(".")[2] for key in wired}]:
        raise LimitError(
            f"{name}: no input is wired to {', '.join(missing)}; there are {', '.join(wired)}",
            "Name the inputs in the bench file, under channels or on_request of the converter's settings",
        )
    return {each: k for each, k in wired.items() if each.rpartition(".")[2] in outputs}


def _joined(blocks: Sequence[Samples]) -> Samples:
    first = blocks[0]
    volts = np.concatenate([block.volts for block in blocks])
    return Samples(volts, first.channels, first.rate_hz, first.start_s)
