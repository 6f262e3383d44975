"""Samples that are not noise, and noise that the samples do not show.

    hidden      noise below one step of the converter
    wild        single samples far from their neighbours: a bad packet, a spark, a knock
    stuck       a stretch of equal samples: a cable that came off, a converter that stopped
    clipped     a channel at the limit of its range

Rounding adds an error of a twelfth of a squared step to noise of half a step or more, whatever the mean. With less
noise, what is seen depends on where the mean lies between two steps. So noise is hidden where it and that error, as
they reach the converter, amount to less than for noise of half a step.

A sample is wild if it is off on the same side from the median of the three samples before it and of the three after it,
which the edge of a step is not. The scale of the noise is the ninth decile of these distances, which a few wild samples
do not move.

The lengths of runs of equal samples are compared with those that chance makes: of R runs of geometric lengths, the
longest is near their mean length times log R. A slow sensor with coarse steps has long runs everywhere.

Source  Widrow and Kollar, Quantization Noise: the quantising theorem, and dither of half a step.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibrations.criteria import (
    CLIPPED,
    CLIPPED_BEYOND_USUAL,
    FEWEST_FOR_SCALE,
    FILTER_PERIODS,
    LEAST_DITHER,
    MOST_PLACEHOLDERS,
    MOST_WILD,
    SHORTEST_STUCK,
    STUCK_BEYOND_CHANCE,
    WILD_SAMPLE,
)
from calibrations.errors import DataError
from calibrations.noise.deviations import DeviationCurve
from calibrations.table import Array

LEAST = LEAST_DITHER**2 + 1 / 12  # of a step's square: such noise, and what rounding adds
SOON = 64  # samples within which noise has to come to that
FASTEST = ("white-noise", "quantisation-noise")  # processes that are hidden in any case


@dataclass(frozen=True)
class HiddenNoise:
    """Noise below a converter's `step`, over so many `levels`; white noise is below the coefficient `white_below`.

    `all`: whether slow processes are hidden too.
    """

    step: float
    levels: int
    white_below: float
    all: bool

    @property
    def text(self) -> str:
        """The description in words, with the remedy."""
        values_text = f"{self.levels} values" if self.all else "values"
        slow = "" if self.all else "; slow noise is larger, and its coefficients are given"
        fast = "" if self.all else ", from sample to sample,"
        return (
            f"the noise{fast} is below the converter's step: the samples have {values_text} in steps of "
            f"{self.step:.4g}, so the level of the noise is not known{slow}. Amplify the output, choose a smaller "
            "range or a finer converter, or add noise of half a step or more (dither)"
        )

    def hides(self, process: str) -> bool:
        """Whether the noise of a process is below the step."""
        return self.all or process in FASTEST


class StepAndRange:
    """Step and range of the values so far. Add blocks in order, then call `hidden`."""

    def __init__(self) -> None:
        self._last, self._step = np.nan, np.inf
        self._low, self._high = np.inf, -np.inf

    def add(self, samples: Array) -> None:
        """Add the next samples, shape (n,)."""
        if not len(samples):
            return
        differences = np.abs(np.diff(samples, prepend=self._last))
        self._step = float(np.min(differences, where=differences > 0, initial=self._step))
        self._low, self._high = min(self._low, float(samples.min())), max(self._high, float(samples.max()))
        self._last = float(samples[-1])

    def hidden(self, curve: DeviationCurve, rate_hz: float, corner_hz: float) -> HiddenNoise | None:
        """Noise below the converter's step, from Allan deviations behind a first-order low-pass; None if not hidden."""
        limit = LEAST * self._step**2
        if not np.isfinite(self._step) or _variance_at_converter(curve, rate_hz, corner_hz) >= limit:
            return None
        white_bound = LEAST_DITHER * self._step / float(np.sqrt(min(rate_hz, np.pi * corner_hz)))
        levels = round((self._high - self._low) / self._step) + 1
        return HiddenNoise(self._step, levels, white_bound, bool(np.max(curve.deviation**2) < limit))


def hidden_step(values: Array) -> float | None:
    """The step that hides the fast noise of values (n,); None where none does."""
    differences = np.abs(np.diff(values))
    step = float(np.min(differences, where=differences > 0, initial=np.inf))
    return step if np.isfinite(step) and np.mean(differences**2) / 2 < LEAST * step**2 else None


def _variance_at_converter(curve: DeviationCurve, rate_hz: float, corner_hz: float) -> float:
    """The variance of noise, as it reaches the converter within some samples, or behind its low-pass."""
    variance = curve.deviation**2
    short_term = float(np.max(variance[curve.tau_s <= SOON / rate_hz]))
    if not np.isfinite(corner_hz):
        return short_term
    index = min(int(np.searchsorted(curve.tau_s, FILTER_PERIODS / corner_hz)), len(variance) - 1)
    return max(short_term, float(variance[index] * curve.tau_s[index]) * min(rate_hz, np.pi * corner_hz))


PART = 4096  # samples whose scale is common
SIDE = 3  # samples to each side
DECILE, NORMAL = 0.9, 1.6449  # and where it is in a normal distribution, in standard deviations


@dataclass(frozen=True)
class Wild:
    """Number of wild samples, the first and the wildest (numbers from 0), the deviation of the wildest in standard
    deviations, and the sum of the squared deviations."""

    count: int = 0
    first: int = 0
    wildest: int = 0
    deviations: float = 0.0
    power: float = 0.0


class Outliers:
    """Wild samples so far. Add blocks in order, then call `found`."""

    def __init__(self) -> None:
        self._waiting = np.empty(0)
        self._before = 0  # number of the first sample that waits
        self._judged = 0
        self._scale = 0.0
        self._wild = Wild()
        self._values = (np.inf, -np.inf)  # lowest and highest wild sample

    def add(self, samples: Array) -> None:
        """Add the next samples, shape (n,)."""
        waiting = np.concatenate([self._waiting, samples])
        while len(waiting) >= PART + 2 * SIDE:
            if not self._judged:  # the record goes on as its mirror image, at both ends
                waiting = np.concatenate([waiting[SIDE:0:-1], waiting])
                self._before = -SIDE
            self._judge(waiting[: PART + 2 * SIDE])
            waiting, self._before = waiting[PART:], self._before + PART
        self._waiting = waiting

    def found(self) -> Wild:
        """Wild samples of the whole record."""
        waiting = self._waiting
        if len(waiting) > 2 * SIDE:
            head = waiting[SIDE:0:-1] if not self._judged else waiting[:0]
            self._before -= len(head)
            self._judge(np.concatenate([head, waiting, waiting[-2 : -2 - SIDE : -1]]))
            self._waiting = waiting[:0]
        placeholder = self._values[0] == self._values[1]  # as 0 or -9.99 for a missing reading
        most = MOST_PLACEHOLDERS if placeholder else MOST_WILD
        return self._wild if self._wild.count <= max(1, int(most * self._judged)) else Wild()

    def _judge(self, part: Array) -> None:
        """All but the outer samples of a part."""
        middle = part[SIDE:-SIDE]
        to_left, to_right = middle - _median(part, 0), middle - _median(part, SIDE + 1)
        if len(middle) >= FEWEST_FOR_SCALE or not self._scale:
            self._scale = float(np.quantile(np.abs(to_left), DECILE)) / NORMAL
        off = np.where(np.sign(to_left) == np.sign(to_right), np.minimum(np.abs(to_left), np.abs(to_right)), 0.0)
        wild = np.flatnonzero(off > WILD_SAMPLE * self._scale)
        if len(wild) and self._scale > 0:
            self._note(self._before + SIDE + wild, off[wild])
            low, high = self._values
            self._values = min(low, float(middle[wild].min())), max(high, float(middle[wild].max()))
        self._judged += len(middle)

    def _note(self, indices: NDArray[np.intp], off: Array) -> None:
        previous, worst = self._wild, int(np.argmax(off))
        deviations = float(off[worst]) / self._scale
        wildest = (
            (int(indices[worst]), deviations)
            if deviations > previous.deviations
            else (previous.wildest, previous.deviations)
        )
        first = previous.first if previous.count else int(indices[0])
        self._wild = Wild(previous.count + len(indices), first, *wildest, previous.power + float(np.sum(off**2)))


def _median(part: Array, start: int) -> Array:
    """Medians of each three neighbouring samples, from `start` on."""
    n = len(part) - 2 * SIDE
    a, b, c = (part[start + k : start + k + n] for k in range(SIDE))
    return np.asarray(np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c)))


@dataclass(frozen=True)
class Run:
    """Equal samples: the number of the first, from 0, and how many."""

    start: int
    length: int


class Stuck:
    """Runs of equal samples so far. Add blocks in order, then call `found`."""

    def __init__(self) -> None:
        self._n, self._runs = 0, 0  # samples, and runs that have ended
        self._longest, self._present = Run(0, 0), Run(0, 0)
        self._last = np.nan

    def add(self, samples: Array) -> None:
        """Add the next samples, shape (n,)."""
        if not len(samples):
            return
        begins = np.flatnonzero(np.diff(samples, prepend=self._last) != 0)
        if len(begins):
            self._end(int(begins[0]))
            lengths = np.diff(begins)
            if len(lengths):
                best = int(np.argmax(lengths))
                self._keep(Run(self._n + int(begins[best]), int(lengths[best])))
            self._runs += len(lengths) + (self._n > 0)
            self._present = Run(self._n + int(begins[-1]), 0)
        self._present = Run(self._present.start, self._n + len(samples) - self._present.start)
        self._n, self._last = self._n + len(samples), float(samples[-1])

    def found(self) -> Run | None:
        """The longest run; None where chance makes such runs."""
        longest = max(self._longest, self._present, key=lambda run: run.length)
        count = max(1, self._runs)
        by_chance = (self._n - longest.length) / count * (1 + np.log(count))
        return longest if longest.length > max(SHORTEST_STUCK, STUCK_BEYOND_CHANCE * by_chance) else None

    def _end(self, count: int) -> None:
        """The present run ends after `count` samples."""
        self._keep(Run(self._present.start, self._n + count - self._present.start))

    def _keep(self, run: Run) -> None:
        if run.length > self._longest.length:
            self._longest = run


class Ends:
    """The highest and the lowest value so far, and the number of samples that have them."""

    def __init__(self) -> None:
        self._n = 0
        self._alike = 1.0  # share of samples that have one value
        self._ends: dict[str, tuple[float, int]] = {}

    def add(self, samples: Array) -> None:
        """Add the next samples, shape (n,)."""
        if not len(samples):
            return
        if not self._n:
            self._alike = 1 / len(np.unique(samples))
        self._n += len(samples)
        for name, value in (("highest", float(samples.max())), ("lowest", float(samples.min()))):
            extreme, count = self._ends.get(name, (value, 0))
            exceeds = value > extreme if name == "highest" else value < extreme
            if exceeds or value == extreme:
                count = int(np.count_nonzero(samples == value)) + (0 if exceeds else count)
                self._ends[name] = value, count

    def check(self, source: str) -> None:
        """Raises DataError where the channel is at a limit, or does not change at all."""
        if len({value for value, _ in self._ends.values()}) == 1:
            raise DataError(
                f"{source}: every sample is the same; check that the sensor is connected, powered and not at its limit"
            )
        for name, (value, count) in self._ends.items():
            if count > max(CLIPPED * self._n, CLIPPED_BEYOND_USUAL * self._alike * self._n, 3):
                raise DataError(
                    f"{source}: {count} of {self._n} samples are at the {name} value, {value:g}: the channel is "
                    "clipped; choose a wider range of the converter, or a part of the record within it"
                )


WILD, CONSTANT, COARSE = "wild-samples", "constant-stretch", "coarse-steps"


@dataclass(frozen=True)
class Oddity:
    """A fault in the samples, with a text. `matters`: it changes the level of white noise by more than its uncertainty.

    `hidden`: the noise, if the fault is that the noise is below the converter's step.
    """

    kind: str
    text: str
    matters: bool
    hidden: HiddenNoise | None = None


def hidden_in(oddities_of_channel: Iterable[Oddity]) -> HiddenNoise | None:
    """The noise below a converter's step; None if the noise is above it."""
    return next((oddity.hidden for oddity in oddities_of_channel if oddity.hidden is not None), None)


def oddities(
    wild: Wild, stuck: Run | None, hidden_noise: HiddenNoise | None, n: int, rate_hz: float, variance: float
) -> tuple[Oddity, ...]:
    """Faults in a record of n samples whose neighbours have the Allan variance `variance`."""
    result = []
    if wild.count:
        result.append(_wild(wild, n, rate_hz, variance))
    if stuck is not None and hidden_noise is None:  # below a step, samples are the same for long
        start_s, length_s = stuck.start / rate_hz, stuck.length / rate_hz
        text = f"{stuck.length} samples from t = {start_s:.6g} s on are equal, for {length_s:.4g} s"
        result.append(Oddity(CONSTANT, text, stuck.length / n > _relative_uncertainty(n)))
    if hidden_noise is not None:
        result.append(Oddity(COARSE, hidden_noise.text, True, hidden_noise))
    return tuple(result)


def _wild(wild: Wild, n: int, rate_hz: float, variance: float) -> Oddity:
    share = min(1.0, wild.power / (n * variance))
    count_words = "one sample is" if wild.count == 1 else f"{wild.count} samples are"
    text = (
        f"{count_words} far from the neighbours: by up to {wild.deviations:.3g} standard deviations at "
        f"t = {wild.wildest / rate_hz:.6g} s (sample {wild.wildest + 1}): {100 * share:.2g} % of the noise's power"
    )
    return Oddity(WILD, text, share > _relative_uncertainty(n))


def _relative_uncertainty(n: int) -> float:
    """Relative standard uncertainty of the power of white noise, of n samples."""
    return float(np.sqrt(2 / n))
