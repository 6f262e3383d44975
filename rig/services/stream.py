"""Samples of a sensor at rest as a stream, from a table, an array or a run."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibrations.errors import DataError, nearest
from calibrations.noise.record import Sensed
from calibrations.table import STANDARD_GRAVITY, Array

LATE = 0.5  # sampling intervals by which a sample may be off before that is a gap
DISAGREE = 0.01  # of two rates
AXIS = re.compile(r"(v|a|g|m|)([xyz])(|_v)")  # of a channel, by its name
SENSED = {  # what outputs in these units are better known in
    "m/s^2": Sensed(1 / STANDARD_GRAVITY, "g"),
    "m/s2": Sensed(1 / STANDARD_GRAVITY, "g"),
    "deg/s": Sensed(3600.0, "deg/h"),
}
STATED = {"output_per_g": "g", "output_per_deg_s": "deg/s", "output_per_field": "field"}  # constants that data may have


@dataclass
class Stream:
    """Samples of one channel, in blocks that are read once. What was seen on the way is known when they are read."""

    source: str
    channel: str
    rate_hz: float
    unit: str
    blocks: Iterator[NDArray[Any]]
    corner_hz: float = np.inf
    others: tuple[str, ...] = ()
    closed: list[tuple[float, float]] = field(default_factory=list)  # gaps: where each begins and how long it is, s
    uneven_s: float = 0.0  # by how much the times are off the even row that is taken for them
    upright_v: dict[int, float] = field(default_factory=dict)  # output along gravity, +1 and -1 g
    constants: Mapping[str, str | float] = field(default_factory=dict)
    logged: dict[str, list[Array]] = field(default_factory=dict)  # what was read beside the samples, in their blocks
    coarse: dict[str, float] = field(default_factory=dict)  # of that, what was read with less noise than these steps

    @property
    def sensed(self) -> Sensed | None:
        """The output as what is sensed, where its scale factor is known: by its unit, from poses along gravity, or as
        the data state it (`output_per_g`, `output_per_deg_s`, `output_per_field`)."""
        if self.unit in SENSED:
            return SENSED[self.unit]
        if self.unit == "V" and (scale := self.scale_v_per_g):
            return Sensed(1 / scale, "g")
        stated = ((_number(self.constants.get(name)), unit) for name, unit in STATED.items())
        return next((Sensed(1 / abs(scale), unit) for scale, unit in stated if scale), None)

    @property
    def scale_v_per_g(self) -> float | None:
        """From poses of the same run at +1 and -1 g; None where it has none."""
        if {1, -1} <= self.upright_v.keys() and self.upright_v[1] != self.upright_v[-1]:
            return abs(self.upright_v[1] - self.upright_v[-1]) / 2
        return None


def repairs(samples: Stream, n: int) -> Iterable[str]:
    """How the samples were changed before the analysis, and what limits them."""
    if samples.closed:
        missing = sum(length for _, length in samples.closed)
        gaps = "a gap is" if len(samples.closed) == 1 else f"{len(samples.closed)} gaps are"
        yield (
            f"{gaps} closed up, {missing:.3g} s in all: longer times are too short by up to "
            f"{100 * missing * samples.rate_hz / n:.2g} %."
        )
    if samples.uneven_s:
        yield (
            f"Times are uneven by up to {samples.uneven_s:.2g} s, as if samples reached the computer in bursts; "
            f"the analysis assumes {samples.rate_hz:.6g} evenly spaced samples a second."
        )
    for name, step in samples.coarse.items():
        yield (
            f"{name} was read in steps of {1e3 * step:.3g} mV, larger than its noise: its means are wrong by part of a "
            "step, and the slope of an output that follows it is less certain than stated."
        )


def _number(constant: str | float | None) -> float:
    """A scale factor as stated; 0 where none is."""
    return constant if isinstance(constant, float) and np.isfinite(constant) else 0.0


def channel_of(channels: tuple[str, ...], channel: str | None, source: str) -> str:
    """The channel asked for, or the first. Raises DataError."""
    if not channels:
        raise DataError(f"{source}: has no channel beside the time; add a column with the sensor's output")
    wanted = channel or channels[0]
    found = next((name for name in (wanted, f"{wanted}_v") if name in channels), None)
    if found is None:
        raise DataError(f'{source}: has no channel "{wanted}"{nearest(wanted, channels)}')
    return found


def agreed(measured: float | None, stated: float, source: str) -> float:
    """The rate, Hz. Raises DataError where two disagree, or there is none."""
    if measured is None and not stated > 0:
        raise DataError(
            f"{source}: its rate is not known; give --rate HZ, or a line `# sample_rate_hz: 100` above the header"
        )
    if measured is None:
        return stated
    if stated > 0 and abs(measured / stated - 1) > DISAGREE:
        raise DataError(
            f"{source}: {stated:g} samples a second are stated, the column t_s has {measured:g}; correct one of them"
        )
    return measured
