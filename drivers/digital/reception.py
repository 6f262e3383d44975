"""The samples of a digital sensor as they arrive: lost and doubled samples, and the sensor's clock.

A sample needs some time to arrive, and never arrives early. So of many samples, the one with the smallest delay gives
the best time of the sensor's clock.

Source  RFC 5905, section 10: of several samples, the clock filter takes the one with the smallest delay.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
RESTARTED_S, RESTARTED = 1.0, 0.05  # with a larger difference of the clocks, and share of it, the sensor restarted
FRESH_S = 60.0  # age of a temperature that still describes the sensor
FINE = 10  # counts of the sensor's time in a period of the samples: its steps count the samples


@dataclass(frozen=True)
class TimeBase:
    """The sensor's time in counts of `unit_s`, which restart at 0 after one of the numbers in `wraps`."""

    unit_s: float
    wraps: tuple[int, ...] = ()

    def steps(self, counts: Floats) -> Floats:
        """Counts from each time to the next, shape (n - 1,); negative where the sensor's time went back."""
        steps = np.diff(counts)
        for wrap in self.wraps if (steps < 0).any() else ():
            wrapped = steps + wrap
            steps = np.where((steps < 0) & (wrapped > 0) & (2 * wrapped < wrap), wrapped, steps)
        return steps


@dataclass(frozen=True, eq=False)
class Batch:
    """Samples that arrived together.

    values   shape (n, outputs)
    time     counts of the sensor's time, shape (n,); None if the sensor sends none
    missing  messages before each sample that did not arrive, by their numbers, shape (n,); -1 for a repeated sample;
             None if messages have no numbers
    clipped  the output that the sensor reports at the end of its range; empty for none
    warm_c   temperatures that the sensor reports, C, shape (reported,)
    """

    values: Floats
    time: Floats | None = None
    missing: Ints | None = None
    clipped: str = ""
    warm_c: Floats = field(default_factory=lambda: np.empty(0))


@dataclass
class Numbers:
    """The numbers of messages, which count to `modulus`."""

    modulus: int
    _last: int | None = None
    _missing: int = 0  # messages that did not arrive since the last sample

    def gaps(self, numbers: Ints, samples: Ints) -> Ints:
        """Number of missing messages before each sample; -1 for a repeated sample. `samples`: indices of `numbers`."""
        if not len(numbers):
            return numbers
        last = int(numbers[0]) - 1 if self._last is None else self._last
        self._last = int(numbers[-1])
        missing = np.diff(np.concatenate([[last], numbers])) % self.modulus - 1
        total = self._missing + np.cumsum(np.maximum(missing, 0))
        missing_before = np.diff(np.concatenate([[0], total[samples]]))
        self._missing = int(total[-1] - (total[samples[-1]] if len(samples) else 0))
        return np.asarray(np.where(missing[samples] < 0, -1, missing_before))


@dataclass
class Thermometer:
    """The temperature that the sensor reports, maybe less often than its samples.

    A record without a report has the last one, if it is not older than `FRESH_S`. `awaited`: a driver has waited for
    the first report.
    """

    last_c: float | None = None
    last_s: float = 0.0  # the host's time
    awaited: bool = False
    _new: list[Floats] = field(default_factory=list)

    def take(self, warm_c: Floats, now_s: float) -> None:
        """Add reports that arrived by `now_s`."""
        if len(finite_c := warm_c[np.isfinite(warm_c)]):
            self.last_c, self.last_s = float(finite_c[-1]), now_s
            self._new.append(finite_c)

    def forget(self) -> None:
        """Begin a record: earlier reports are not a part of its mean."""
        self._new = []

    def pull_c(self, now_s: float) -> float | None:
        """The mean of the reports since the last call, else the last report; None without a fresh one."""
        new, self._new = self._new, []
        if new:
            return float(np.concatenate(new).mean())
        return self.last_c if now_s - self.last_s <= FRESH_S else None


class Moment(NamedTuple):
    """The same moment on both clocks, s."""

    sensor_s: float
    host_s: float


@dataclass
class Reception:
    """The samples of a record. `rate_hz` is the nominal rate; `numbered`: every number of a message is a sample."""

    base: TimeBase
    rate_hz: float
    numbered: bool = False
    count: int = 0
    lost: int = 0
    doubled: int = 0
    back: bool = False  # the sensor's time went back: it restarted
    clipped: str = ""
    start_s: float = 0.0  # the host's time of the first sample
    end_s: float = 0.0  # and of the last
    _first: int = 0  # samples in the first batch
    _waiting: deque[Floats] = field(default_factory=deque)
    _moments: list[Moment] = field(default_factory=list)  # of the last sample of each batch
    _last: float | None = None  # the sensor's time of the last sample
    _sensor: float = 0.0  # the same, counted on over its wraps

    def take(self, batch: Batch, now_s: float) -> None:
        """Add the samples that arrived by `now_s`. Repeated samples are left out."""
        values = batch.values
        if not len(values):
            return
        self.clipped = self.clipped or batch.clipped
        repeated, gaps = self._compare_numbers(batch)
        if batch.time is not None:
            first = batch.time[:1] if self._last is None else np.array([self._last])
            steps = self.base.steps(np.concatenate([first, batch.time]))
            if batch.missing is None:
                repeated = steps == 0
                repeated[0] &= self._last is not None
            self.back = self.back or bool((steps < 0).any())
            self.lost += self._lost_count(steps, gaps)
            self._sensor = (float(first[0]) if self._last is None else self._sensor) + float(steps.sum())
            self._last = float(batch.time[-1])
        elif gaps is not None:
            self.lost += int(gaps.sum())
        self.doubled += int(repeated.sum())
        self._keep(values[~repeated], now_s, timed=batch.time is not None)

    def pull(self, n: int) -> Floats:
        """Remove and return the next `n` samples, shape (n, outputs)."""
        parts: list[Floats] = []
        while n > 0:
            values = self._waiting.popleft()
            if len(values) > n:
                self._waiting.appendleft(values[n:])
            parts.append(values[:n])
            n -= len(parts[-1])
        return np.concatenate(parts)

    @property
    def length_s(self) -> float:
        """Time from the first arrival to the last, s."""
        return self.end_s - self.start_s

    @property
    def measured_rate_hz(self) -> float:
        """Sample rate by the host's clock, Hz."""
        return (self.count - self._first) / self.length_s if self.length_s else 0.0

    @property
    def moments(self) -> list[Moment]:
        """The sample with the smallest delay of each half; none if the sensor sends no time."""
        half = len(self._moments) // 2
        parts = [self._moments[:half], self._moments[half:]]
        return [min(part, key=lambda moment: moment.host_s - moment.sensor_s) for part in parts if part]

    def _compare_numbers(self, batch: Batch) -> tuple[NDArray[np.bool_], Ints | None]:
        """Compare the message numbers: which samples are repeated, and how many messages are missing before each."""
        if batch.missing is None:
            return np.zeros(len(batch.values), dtype=bool), None
        return batch.missing < 0, np.maximum(batch.missing, 0)

    def _lost_count(self, steps: Floats, gaps: Ints | None) -> int:
        """Number of lost samples. A time of low resolution only shows that a missing message can be a sample."""
        if gaps is not None and self.numbered:
            return int(gaps.sum())
        missing_by_time = np.maximum(np.rint(steps * self.base.unit_s * self.rate_hz) - 1, 0).astype(np.int64)
        fine = FINE * self.base.unit_s * self.rate_hz < 1.001
        return int((missing_by_time if gaps is None or fine else np.minimum(missing_by_time, gaps)).sum())

    def _keep(self, values: Floats, now_s: float, timed: bool) -> None:
        if not len(values):
            return
        if not self.count:
            self.start_s, self._first = now_s, len(values)
        self.end_s = now_s
        self.count += len(values)
        self._waiting.append(values)
        if timed:
            self._moments.append(Moment(self.base.unit_s * self._sensor, now_s))


@dataclass
class Tally:
    """The counts of all records since the connection, and the sensor's clock against the host's.

    `carrier` is the word for what carries a sample, such as `lines`.
    """

    base: TimeBase
    carrier: str
    samples: int = 0
    lost: int = 0
    doubled: int = 0
    damaged: int = 0
    restarts: int = 0
    first: Moment | None = None  # since the sensor began to count
    last: Moment | None = None

    def add(self, reception: Reception, damaged: int) -> None:
        """Add the counts of a record that has ended."""
        self.samples += reception.count
        self.lost += reception.lost
        self.doubled += reception.doubled
        self.damaged += damaged
        for moment in reception.moments:
            self._note(moment)

    @property
    def offset_s(self) -> float | None:
        """The sensor's time minus the host's time at the last measurement, s."""
        return None if self.last is None else self.last.sensor_s - self.last.host_s

    @property
    def gain(self) -> float | None:
        """The relative gain of the sensor's clock; None before it is known."""
        if self.first is None or self.last is None or self.last.host_s <= self.first.host_s:
            return None
        return (self.last.sensor_s - self.first.sensor_s) / (self.last.host_s - self.first.host_s) - 1

    def values(self) -> dict[str, tuple[float, str]]:
        """The numbers by name, each as (value, unit)."""
        counts = {"samples": self.samples, "samples-lost": self.lost, "samples-doubled": self.doubled}
        counts |= {f"{self.carrier}-damaged": self.damaged, "sensor-restarts": self.restarts}
        clock = {} if self.gain is None else {"sensor-clock-gain": (1e6 * self.gain, "ppm")}
        return {name: (float(count), "") for name, count in counts.items()} | clock

    def _note(self, moment: Moment) -> None:
        if self.first is None or self.last is None:
            self.first = self.last = moment
            return
        passed_s = moment.host_s - self.last.host_s
        expected_s = self.last.sensor_s + passed_s
        periods_s = [wrap * self.base.unit_s for wrap in self.base.wraps]
        possible = [
            moment.sensor_s,
            *(moment.sensor_s + p * round((expected_s - moment.sensor_s) / p) for p in periods_s),
        ]
        sensor_s = min(possible, key=lambda at_s: abs(at_s - expected_s))
        if abs(sensor_s - expected_s) > RESTARTED_S + RESTARTED * passed_s:
            self.restarts += 1
            self.first = self.last = moment
        else:
            self.last = Moment(sensor_s, moment.host_s)
