"""From transducer to sample: output filter at its nominal corner, skew of the sampling; linear filters, noise density.

The converter takes the channels of one scan in turn: the sensor's axes `skew_x_s`, `skew_y_s`, `skew_z_s` after the
displacement (constants of the table, 0 where not given).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
import scipy  # its modules load slowly: they are imported at their first use
from numpy.typing import NDArray

from calibrations.criteria import LONGEST_STEP, MOST_UNEVEN, SHORTEST_MOTION_S
from calibrations.errors import DataError, TooFewRows
from calibrations.table import AXES, Array, Table

# A table of motion as records: stretches of evenly spaced samples at one attitude, without a gap.

RECORD_COLUMNS = ("alpha_deg", "beta_deg", "mount_deg", "flip", "record")  # throughout a record


@dataclass(frozen=True)
class Record:
    """Rows `first` to `end` (not included), at `rate_hz`."""

    first: int
    end: int
    rate_hz: float

    @property
    def rows(self) -> slice:
        """The rows."""
        return slice(self.first, self.end)

    def times_s(self, t: Array) -> Array:
        """The rows' times, evenly spaced: those of the table `t` may be rounded."""
        return np.asarray(t[self.first] + np.arange(self.end - self.first) / self.rate_hz)


@lru_cache(maxsize=8)
def find_records(table: Table) -> tuple[Record, ...]:
    """The records of at least 2 s, rows in order of time.

    Raises DataError for samples that are not evenly spaced, TooFewRows where no record is long enough.
    """
    t = table.column("t_s")
    if np.any(np.diff(t) < 0):
        row = int(np.argmax(np.diff(t) < 0)) + 2
        raise DataError(f'{table.source}: row {row}, column "t_s" falls; samples must be in order of time')
    if table.n < 2 or not t[-1] > t[0]:
        raise TooFewRows(f"{table.source}: {table.n} samples all have the same time; this not a record of a motion")
    step = float(np.median(np.diff(t))) or float(t[-1] - t[0]) / (table.n - 1)
    gaps = np.diff(t) > LONGEST_STEP * step
    for name in RECORD_COLUMNS:
        gaps |= np.diff(table.optional(name, 0.0)) != 0
    edges = np.concatenate([[0], np.flatnonzero(gaps) + 1, [table.n]])
    long = [(int(a), int(b)) for a, b in pairwise(edges) if (b - a) * step >= SHORTEST_MOTION_S - step / 2]
    if not long:
        raise TooFewRows(
            f"{table.source}: no record lasts {SHORTEST_MOTION_S:g} s at one attitude without a gap; "
            "record the motion longer"
        )
    return tuple(_check_record(table, t, a, b) for a, b in long)


def _check_record(table: Table, t: Array, first: int, end: int) -> Record:
    part = t[first:end]
    rate_hz = (len(part) - 1) / float(part[-1] - part[0])
    lateness = np.abs(part - part[0] - np.arange(len(part)) / rate_hz)
    if lateness.max() > MOST_UNEVEN / rate_hz:
        row = first + int(np.argmax(lateness)) + 1
        raise DataError(
            f'{table.source}: row {row}, column "t_s" is {lateness.max() * rate_hz:.2g} of a step off; '
            "a motion is sampled evenly, at the converter's own pace"
        )
    return Record(first, end, rate_hz)


# Linear filters on evenly sampled records, and the density of noise.
#
# A filter is given by its frequency response, analog or digital, and applied in the frequency domain. This is exact for
# signals below half the sampling rate, also for an inverse filter or a delay by a part of a sample.

Complex = NDArray[np.complex128]
Response = Callable[[Array], Complex]

PAPER_CORNER_HZ = 20.0  # of the second-order Butterworth low-pass, Ang V
MARGIN_S = 1.0  # the record is continued by this on both sides, so that its ends do not meet


def apply_response(x: Array, rate_hz: float, response: Response) -> Array:
    """`x`, shape (n, ...), through a filter. Ends are continued by odd reflection that fades to the mean."""
    n, mean = len(x), x.mean(axis=0).reshape(-1)
    flat = x.reshape(n, -1) - mean
    margin = min(n - 1, int(np.ceil(MARGIN_S * rate_hz)))
    padding = scipy.fft.next_fast_len(n + 2 * margin, real=True) - n - 2 * margin
    fade = ((1 + np.cos(np.pi * np.arange(1, margin + 1) / (margin + 1))) / 2)[:, None]
    head = (2 * flat[0] - flat[1 : margin + 1]) * fade
    tail = (2 * flat[-1] - flat[-2 : -margin - 2 : -1]) * fade
    extended = np.concatenate([head[::-1], flat, tail, np.zeros((padding, flat.shape[1]))])
    f = scipy.fft.rfftfreq(len(extended), 1 / rate_hz)
    H = response(np.maximum(f, f[1] / 2))[:, None]  # the mean, which a response may treat apart, is not in here
    filtered = scipy.fft.irfft(scipy.fft.rfft(extended, axis=0) * H, len(extended), axis=0)[margin : margin + n]
    return np.asarray((filtered + mean * response(np.zeros(1)).real).reshape(x.shape))


def first_order(corner_hz: float) -> Response:
    """The R-C low-pass at the sensor's output: 1 / (1 + j f / corner)."""
    return lambda f: np.asarray(1 / (1 + 1j * f / corner_hz))


def delay(by_s: float) -> Response:
    """A delay."""
    return lambda f: np.asarray(np.exp(-2j * np.pi * f * by_s))


def butterworth(rate_hz: float) -> Response:
    """The digital Butterworth low-pass of Ang V, of second order."""
    b, a = scipy.signal.butter(2, PAPER_CORNER_HZ, fs=rate_hz)
    return lambda f: np.asarray(scipy.signal.freqz(b, a, f, fs=rate_hz)[1])


def correct_at(response: Response, at_hz: float) -> Response:
    """A low-pass without its attenuation and delay at one frequency, as the corrected filter of Ang V.

    The mean passes as it is: corrected like the motion, an offset would grow.
    """
    response_at_line = response(np.array([at_hz]))[0]
    late_s = -np.angle(response_at_line) / (2 * np.pi * at_hz)
    return lambda f: np.where(f > 0, response(f) / np.abs(response_at_line) * np.exp(2j * np.pi * f * late_s), 1.0)


def periodogram(x: Array, rate_hz: float) -> tuple[Array, Array]:
    """(frequency, one-sided density) with a Hann window, without the mean; shape (n // 2 + 1,)."""
    window = np.hanning(len(x) + 2)[1:-1]
    power = np.abs(scipy.fft.rfft((x - x.mean()) * window)) ** 2
    return scipy.fft.rfftfreq(len(x), 1 / rate_hz), 2 * power / (rate_hz * np.sum(window**2))


NOMINAL_CORNER_HZ = 15.07  # 32 kOhm and 0.33 uF, Ang V, if the table gives none


def corner_hz(table: Table) -> float:
    """The output filter's nominal corner."""
    return table.number("filter_corner_hz", NOMINAL_CORNER_HZ)


def skew_s(table: Table, axis: int) -> float:
    """Delay of the samples of this axis after the displacement, s."""
    return table.number(f"skew_{AXES[axis]}_s", 0.0)


def nominal_response(table: Table, axis: int) -> Response:
    """From the transducer's output to the samples of one axis. A later sample is an advance."""
    low_pass, advance = first_order(corner_hz(table)), delay(-skew_s(table, axis))
    return lambda f: np.asarray(low_pass(f) * advance(f))


def filter_output(v: Array, table: Table, response: Callable[[int], Response]) -> Array:
    """Each column of `v`, shape (n, axes), through its own filter, record by record; other rows as they are.

    Axes that were not measured are left as they are: nothing reads them.
    """
    filtered = np.array(v)
    for record in find_records(table):
        for k in range(min(v.shape[1], len(table.axes))):
            filtered[record.rows, k] = apply_response(v[record.rows, k], record.rate_hz, response(k))
    return filtered


def sample_output(v: Array, table: Table) -> Array:
    """The transducer's output, shape (n, axes), as it is sampled behind the nominal output filter."""
    return filter_output(v, table, lambda k: nominal_response(table, k))
