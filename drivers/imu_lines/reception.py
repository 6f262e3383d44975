"""What a digital sensor's lines tell about themselves: lost and doubled samples, and the sensor's clock.

The sensor's time counts to 2^32 and begins again. A sample is known to be on its way for a while, and never to come
early: so of many samples, the one with the smallest delay gives the time of the sensor's clock best.

Source  RFC 5905, section 10: of several samples, the clock filter takes the one with the smallest delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from drivers.imu_lines.lines import Assembly

TIME = "time"
WRAP = 2**32  # counts of the sensor's time
RESTARTED_S, RESTARTED = 1.0, 0.05  # the clocks differ by more than this, and this share: the sensor began anew


class Moment(NamedTuple):
    """One moment on both clocks, s."""

    sensor_s: float
    host_s: float


@dataclass
class Heard:
    """The samples of a record, with the host's time of each. `rate_hz` is the nominal rate."""

    assembly: Assembly
    time_unit_s: float
    rate_hz: float
    kept: list[dict[str, float]] = field(default_factory=list)
    at_s: list[float] = field(default_factory=list)
    lost: int = 0
    doubled: int = 0
    back: bool = False  # the sensor's time went back: it began anew

    def take(self, samples: Sequence[dict[str, float]], now_s: float) -> None:
        """Add samples that came by `now_s`; one with the time of the sample before it is dropped."""
        for sample in samples:
            if self.kept and TIME in sample:
                step = sample[TIME] - self.kept[-1][TIME]
                step += WRAP if step < -WRAP / 2 else 0
                if step == 0:
                    self.doubled += 1
                    continue
                self.back = self.back or step < 0
                self.lost += max(0, round(step * self.time_unit_s * self.rate_hz) - 1)
            self.kept.append(sample)
            self.at_s.append(now_s)

    @property
    def length_s(self) -> float:
        """From the first arrival to the last."""
        return self.at_s[-1] - self.at_s[0] if self.at_s else 0.0

    @property
    def measured_rate_hz(self) -> float:
        """Samples a second, by the host's clock."""
        first = sum(at_s == self.at_s[0] for at_s in self.at_s)
        return (len(self.at_s) - first) / self.length_s if self.length_s else 0.0

    @property
    def moments(self) -> list[Moment]:
        """The sample with the smallest delay of each half; none for lines without the sensor's time."""
        if len(self.kept) < 2 or TIME not in self.kept[0]:
            return []
        counts: NDArray[np.float64] = np.array([sample[TIME] for sample in self.kept])
        counts += WRAP * np.cumsum(np.diff(counts, prepend=counts[0]) < -WRAP / 2)
        sensor_s, host_s = self.time_unit_s * counts, np.array(self.at_s)
        halves = np.array_split(np.arange(len(counts)), 2)
        best = [half[int(np.argmin(host_s[half] - sensor_s[half]))] for half in halves]
        return [Moment(float(sensor_s[k]), float(host_s[k])) for k in best]


@dataclass
class Tally:
    """The counts of all records since the connection, and the sensor's clock against the host's."""

    time_unit_s: float
    samples: int = 0
    lost: int = 0
    doubled: int = 0
    damaged: int = 0
    restarts: int = 0
    first: Moment | None = None  # since the sensor began to count
    last: Moment | None = None

    def add(self, heard: Heard) -> None:
        """Add a record, at its end."""
        self.samples += len(heard.kept)
        self.lost += heard.lost
        self.doubled += heard.doubled
        self.damaged += heard.assembly.damaged
        for moment in heard.moments:
            self._note(moment)

    @property
    def offset_s(self) -> float | None:
        """The sensor's time minus the host's, at the last moment."""
        return None if self.last is None else self.last.sensor_s - self.last.host_s

    @property
    def gain(self) -> float | None:
        """The relative gain of the sensor's clock; None before it is known."""
        if self.first is None or self.last is None or self.last.host_s <= self.first.host_s:
            return None
        return (self.last.sensor_s - self.first.sensor_s) / (self.last.host_s - self.first.host_s) - 1

    def values(self) -> dict[str, tuple[float, str]]:
        """The numbers by name, each with its unit."""
        counts = {"samples": self.samples, "samples-lost": self.lost, "samples-doubled": self.doubled}
        counts |= {"lines-damaged": self.damaged, "sensor-restarts": self.restarts}
        clock = {} if self.gain is None else {"sensor-clock-gain": (1e6 * self.gain, "ppm")}
        return {name: (float(count), "") for name, count in counts.items()} | clock

    def _note(self, moment: Moment) -> None:
        if self.first is None or self.last is None:
            self.first = self.last = moment
            return
        passed_s, period_s = moment.host_s - self.last.host_s, WRAP * self.time_unit_s
        sensor_s = moment.sensor_s + period_s * round((self.last.sensor_s + passed_s - moment.sensor_s) / period_s)
        if abs(sensor_s - self.last.sensor_s - passed_s) > RESTARTED_S + RESTARTED * passed_s:
            self.restarts += 1
            self.first = self.last = moment
        else:
            self.last = Moment(sensor_s, moment.host_s)
