"""Turns of a gyroscope between two rests as rows that a model can be fitted to.

    u1 = R u0        R: the turn by the rates between the rests; u0, u1: directions upward before and after

An accelerometer on the same board gives the directions. The rates by a model, integrated from rest to rest, must turn
u0 into u1. The difference is a rotation e about two axes at right angles to u1; a turn about the vertical is not seen.
The earth's rotation about the vertical is subtracted from the rates at rest if the latitude is known.

    channels of a row    e over the duration of the turn, along the axis of the turn and across it, deg/s
                         the rates at rest, about x, y and z, deg/s

The directions are in the frame of the accelerometer: x along its x axis, and y in the plane of its x and y axes.

Source  Tedaldi, Pretto and Menegatti, A robust and easy to implement method for IMU calibration without external
        equipments, ICRA 2014: integration of the rates between rests; Savage, Strapdown Analytics (2000), attitude.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import groupby, product
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from calibrations.criteria import FEWEST_TURNS_OF_A_GYROSCOPE, SMALLEST_TURN_DEG
from calibrations.errors import DataError, TooFewRows
from calibrations.geometry.clipped_turns import find_clipped_turns
from calibrations.geometry.rate_table import at_rest, vertical_deg_s
from calibrations.geometry.sphere import unit_vectors
from calibrations.geometry.triad import gravity_directions
from calibrations.table import AXES, Array, Table

CHANNELS = ("along the turn", "across the turn", *(f"{axis} at rest" for axis in AXES))
RATES, FORCES = tuple(f"g{axis}" for axis in AXES), tuple(f"a{axis}" for axis in AXES)
BLOCK_HZ = 100.0  # of the rates: block means of faster samples
NOISE_BLOCK_S = 0.05  # longer than the correlation of the noise behind a filter
SIGNS = tuple(product((1.0, -1.0), repeat=3))  # of the axes: a board may turn a sensor over
SCALES = np.geomspace(0.4, 1.25, 16)  # of the largest possible output per deg/s: the turn is the shortest way or longer


@dataclass(frozen=True, eq=False, kw_only=True)
class Turns(Table):
    """A row for each turn: means of its samples, among them that of the rate (its size and axis), and the outputs of
    the rest before it.

    `samples` has for each turn its rest before, block means of the turn, and its rest after, between `bounds` (n, 2).
    `before`, `after`: directions upward (n, 3). `along`: two directions (n, 2, 3) at right angles to `after`, the first
    next to the axis of the turn. `white` (channels, n), deg/s.
    """

    samples: Table
    bounds: NDArray[np.intp]
    before: Array
    after: Array
    along: Array
    white: Array
    raw_digest: str

    @property
    def digest(self) -> str:
        """The value of the samples."""
        return self.raw_digest

    def rows(self, selection: NDArray[np.bool_] | NDArray[np.intp]) -> Turns:
        """The table with these turns only."""
        common = super().rows(selection)
        return replace(
            self,
            columns=common.columns,
            labels=common.labels,
            numbers=common.numbers,
            bounds=self.bounds[selection],
            before=self.before[selection],
            after=self.after[selection],
            along=self.along[selection],
            white=self.white[:, selection],
        )

    @property
    def duration_s(self) -> Array:
        """Duration of each turn, s, (n,)."""
        return np.array([self.samples.column("duration_s")[a + 1 : b - 1].sum() for a, b in self.bounds])

    def residual(self, rates_deg_s: Array) -> Array:
        """Residual of the rates of the samples (samples, 3), shape (channels, n)."""
        predicted = _turn_directions(self.before, self._steps(rates_deg_s))
        error = np.degrees(np.cross(predicted, self.after)) / self.duration_s[:, None]
        rests = (rates_deg_s[self.bounds[:, 0]] + rates_deg_s[self.bounds[:, 1] - 1]) / 2
        rests = rests - vertical_deg_s(self) * (self.before + self.after) / 2
        return np.vstack([np.einsum("nji,ni->jn", self.along, error), rests.T])

    def by_rate(self, rates_deg_s: Array) -> Array:
        """d residual of its turn / d the rates of each sample, shape (samples, channels, 3)."""
        durations = self.samples.column("duration_s")
        result = np.zeros((self.samples.n, len(CHANNELS), 3))
        to_end = _frames_to_end(self._steps(rates_deg_s))
        for k, (a, b) in enumerate(self.bounds):
            share = durations[a + 1 : b - 1] / durations[a + 1 : b - 1].sum()
            result[a + 1 : b - 1, :2] = share[:, None, None] * (self.along[k] @ to_end[k, : b - a - 2])
            result[[a, b - 1], 2:] = np.eye(3) / 2
        return result

    def add_up(self, by_sample: Array) -> Array:
        """The sums over the samples of each turn, from (samples, channels, m), shape (channels, n, m)."""
        sums = np.concatenate([np.zeros((1, *by_sample.shape[1:])), np.cumsum(by_sample, axis=0)])
        return np.asarray((sums[self.bounds[:, 1]] - sums[self.bounds[:, 0]]).transpose(1, 0, 2))

    def _steps(self, rates_deg_s: Array) -> Array:
        """The rotation vectors of the steps of each turn, rad, padded with zeros, shape (n, steps, 3)."""
        angles = np.radians(rates_deg_s) * self.samples.column("duration_s")[:, None]
        return _pad([angles[a + 1 : b - 1] for a, b in self.bounds])


@lru_cache(maxsize=8)
def make_turns(table: Table) -> Turns:
    """The rows of a table of samples, without the turns that are clipped. Raises DataError, TooFewRows."""
    if isinstance(table, Turns):
        return table
    found = _find_turns(table)
    clipped = find_clipped_turns(table)
    blocks = [_block(table, *rows) for number, rows in found if number not in clipped]
    if len(blocks) < FEWEST_TURNS_OF_A_GYROSCOPE:
        clipped_words = f", and {len(clipped)} in which an output reached the end of its range" if clipped else ""
        raise TooFewRows(
            f"{table.source}: {len(blocks)} turns between rests{clipped_words}; a gyroscope needs "
            f"{FEWEST_TURNS_OF_A_GYROSCOPE} or more, about different axes"
        )
    lengths = np.array([len(block["t_s"]) for block in blocks])
    ends = np.cumsum(lengths)
    bounds = np.column_stack([ends - lengths, ends])
    columns = {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}
    samples = Table("turns", MappingProxyType(columns), table.constants, table.source)
    before, after = _directions(samples, bounds)
    return _rows(table, samples, bounds, before, after)


def _find_turns(table: Table) -> list[tuple[int, tuple[int, int]]]:
    """The number of each turn, its first row and its end row, with its rests. Raises DataError for a turn without one
    of them.
    """
    numbers, is_resting = table.column("turn"), table.column("resting") > 0.5
    turns, first = [], 0
    for number, group in groupby(numbers.tolist()):
        last = first + len(list(group))
        resting = is_resting[first:last]
        if not (resting[0] and resting[-1]) or resting.all():
            raise DataError(
                f"{table.source}: turn {number:g} has no rest before it, or after it, or no sample between them; "
                'remove its rows, or correct the column "resting"'
            )
        turns.append((int(number), (first, last)))
        first = last
    return turns


def _block(table: Table, first: int, last: int) -> dict[str, Array]:
    """One turn: its rest before as one row, block means of the turn, its rest after as one row."""
    rows = table.rows(np.arange(first, last))
    rate_hz = rows.number("sample_rate_hz", 0.0) or (rows.n - 1) / float(np.ptp(rows.time_s))
    moving = np.flatnonzero(rows.column("resting") < 0.5)
    begin, end = int(moving[0]), int(moving[-1]) + 1
    size = max(1, int(rate_hz / BLOCK_HZ))
    cuts = [(0, begin), *((k, min(k + size, end)) for k in range(begin, end, size)), (end, rows.n)]
    lengths = np.array([b - a for a, b in cuts])
    columns = {name: np.add.reduceat(values, [a for a, _ in cuts]) / lengths for name, values in rows.columns.items()}
    return columns | {"duration_s": lengths / rate_hz} | _rest_noise(rows, begin, end, rate_hz)


def _rest_noise(rows: Table, begin: int, end: int, rate_hz: float) -> dict[str, Array]:
    """For each output the variance of a mean over 1 s, from block means at rest, at the rows of both rests."""
    size = max(1, round(NOISE_BLOCK_S * rate_hz))
    variances = {}
    for name in (*RATES, *FORCES):
        parts = []
        for part in (rows.column(name)[:begin], rows.column(name)[end:]):
            means = part[: len(part) // size * size].reshape(-1, size).mean(axis=1)
            parts.append(means.var(ddof=1) if len(means) > 1 else 0.0)
        count = len(range(begin, end, max(1, int(rate_hz / BLOCK_HZ))))
        per_s = float(np.mean(parts)) * size / rate_hz
        variances[f"{name}_per_s"] = np.full(count + 2, per_s)
    return variances


def _directions(samples: Table, bounds: NDArray[np.intp]) -> tuple[Array, Array]:
    """Upward directions before and after each turn, shape (n, 3) each."""
    force = np.column_stack([samples.column(name) for name in FORCES])
    rests = np.vstack([force[bounds[:, 0]], force[bounds[:, 1] - 1]])
    directions = gravity_directions(rests)
    return directions[: len(bounds)], directions[len(bounds) :]


def _rows(table: Table, samples: Table, bounds: NDArray[np.intp], before: Array, after: Array) -> Turns:
    """The row of each turn by an approximate calibration, which gives axes, noise and start values of a fit."""
    angle_deg = np.degrees(np.arccos(np.clip(np.sum(before * after, axis=1), -1, 1)))
    if np.median(angle_deg) < SMALLEST_TURN_DEG:
        raise DataError(
            f"{table.source}: the sensor has nearly the same orientation before and after most turns; turn it from "
            "side to side, so that ax, ay and az change"
        )
    durations = samples.column("duration_s")
    bias, matrix = _rough_calibration(samples, bounds, before, after)
    rates = (np.column_stack([samples.column(name) for name in RATES]) - bias) @ matrix.T
    steps = _pad([np.radians(rates[a + 1 : b - 1]) * durations[a + 1 : b - 1, None] for a, b in bounds])
    axis = unit_vectors(-Rotation.from_matrix(_products(_rotations(-steps))).as_rotvec())

    def means(values: Array) -> Array:
        weighted = (np.average(values[a + 1 : b - 1], axis=0, weights=durations[a + 1 : b - 1]) for a, b in bounds)
        return np.array(list(weighted))

    mean_rates = means(rates)
    columns = {name: means(values) for name, values in samples.columns.items() if name in table}
    columns |= {at_rest(name): samples.column(name)[bounds[:, 0]] for name in RATES}
    columns |= {"rate_deg_s": np.linalg.norm(mean_rates, axis=1)}
    columns |= {f"axis_{letter}": part for letter, part in zip(AXES, unit_vectors(mean_rates).T, strict=True)}
    return Turns(
        kind="turns",
        columns=MappingProxyType(columns),
        constants=table.constants,
        source=table.source,
        numbers=np.array([int(samples.column("turn")[a]) for a, _ in bounds]),
        samples=replace(samples, columns=MappingProxyType({**samples.columns, **_sample_rates(bounds, columns)})),
        bounds=bounds,
        before=before,
        after=after,
        along=_bases(axis, after),
        white=_white(samples, bounds, matrix),
        raw_digest=table.digest,
    )


def _sample_rates(bounds: NDArray[np.intp], columns: dict[str, Array]) -> dict[str, Array]:
    """Mean rate and axis of the turn for each sample; the rate is 0 at rest."""
    counts = bounds[:, 1] - bounds[:, 0]
    repeated = {name: np.repeat(columns[name], counts) for name in ("rate_deg_s", *(f"axis_{axis}" for axis in AXES))}
    repeated["rate_deg_s"][bounds[:, 0]] = repeated["rate_deg_s"][bounds[:, 1] - 1] = 0.0
    return repeated


def _bases(axis: Array, after: Array) -> Array:
    """Two directions perpendicular to `after`, the first one closest to `axis`, shape (n, 2, 3)."""
    along = axis - np.sum(axis * after, axis=1)[:, None] * after
    other = np.cross(after, np.eye(3)[np.argmin(np.abs(after), axis=1)])
    small = np.linalg.norm(along, axis=1) < 1e-3  # a turn about the vertical
    along = unit_vectors(np.where(small[:, None], other, along))
    return np.stack([along, np.cross(after, along)], axis=1)


def _white(samples: Table, bounds: NDArray[np.intp], matrix: Array) -> Array:
    """Standard deviation of each channel by white noise, deg/s, shape (channels, n)."""
    durations = samples.column("duration_s")
    rate_variance = np.array([np.median(samples.column(f"{name}_per_s")) for name in RATES])
    rate_variance = (matrix**2) @ rate_variance  # about each axis, (deg/s)^2 over 1 s
    force = np.column_stack([samples.column(name) for name in FORCES])
    rests = np.concatenate([bounds[:, 0], bounds[:, 1] - 1])
    size = float(np.mean(np.linalg.norm(force[rests] - force[rests].mean(axis=0), axis=1)))
    tilt_variance = float(np.mean([np.median(samples.column(f"{name}_per_s")) for name in FORCES]))
    tilt_variance *= np.degrees(1 / size) ** 2  # deg^2 over 1 s
    turn_s = np.array([durations[a + 1 : b - 1].sum() for a, b in bounds])
    rest_s = durations[bounds[:, 0]], durations[bounds[:, 1] - 1]
    turning = rate_variance.mean() / turn_s + tilt_variance * (1 / rest_s[0] + 1 / rest_s[1]) / turn_s**2
    resting = rate_variance[:, None] * (1 / rest_s[0] + 1 / rest_s[1]) / 4
    return np.asarray(np.sqrt(np.vstack([turning, turning, resting])))


def _rough_calibration(samples: Table, bounds: NDArray[np.intp], before: Array, after: Array) -> tuple[Array, Array]:
    """Outputs at rest (3,), and the matrix (3, 3) from outputs without these to deg/s, by the turns."""
    outputs, durations = np.column_stack([samples.column(name) for name in RATES]), samples.column("duration_s")
    bias = outputs[np.concatenate([bounds[:, 0], bounds[:, 1] - 1])].mean(axis=0)
    parts = [(outputs[a + 1 : b - 1] - bias) * durations[a + 1 : b - 1, None] for a, b in bounds]
    steps = _pad(parts)
    angles = np.arccos(np.clip(np.sum(before * after, axis=1), -1, 1))
    path = np.array([np.linalg.norm(part, axis=1).sum() for part in parts])
    if not np.all(path > 0):
        raise DataError(f"{samples.source}: gx, gy and gz do not change in a turn; check the channels and the cable")
    large = angles > np.radians(SMALLEST_TURN_DEG)
    largest = float(np.median(path[large] / angles[large]))

    def residual(theta: Array) -> Array:
        predicted = _turn_directions(before, steps @ theta.reshape(3, 3).T)
        return np.asarray(np.cross(predicted, after).ravel())

    starts = [np.diag(np.array(signs) / (largest * scale)) for scale in SCALES for signs in SIGNS]
    costs = [float(np.sum(residual(start) ** 2)) for start in starts]
    best = starts[int(np.argmin(costs))]
    found = least_squares(residual, best.ravel(), x_scale=1 / largest)
    return bias, np.degrees(found.x.reshape(3, 3))


def _pad(parts: Sequence[Array]) -> Array:
    """Parts (steps, 3) of different lengths in one array (n, steps, 3), with zeros behind."""
    padded = np.zeros((len(parts), max(len(part) for part in parts), 3))
    for row, part in zip(padded, parts, strict=True):
        row[: len(part)] = part
    return padded


def _turn_directions(before: Array, steps: Array) -> Array:
    """Fixed directions `before` (n, 3) in the sensor's frame after its rotations by vectors (n, steps, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", _products(_rotations(-steps)), before))


def _products(rotations: Array) -> Array:
    """The product of rotations (n, steps, 3, 3) in the order of time, pair by pair, shape (n, 3, 3)."""
    while rotations.shape[1] > 1:
        if rotations.shape[1] % 2:
            identity = np.broadcast_to(np.eye(3), (len(rotations), 1, 3, 3))
            rotations = np.concatenate([rotations, identity], axis=1)
        rotations = rotations[:, 1::2] @ rotations[:, ::2]
    return np.asarray(rotations[:, 0])


def _frames_to_end(steps: Array) -> Array:
    """From the frame in the middle of each step (n, steps, 3) to the frame after the last, (n, steps, 3, 3)."""
    rotations, half = _rotations(-steps), _rotations(-steps / 2)
    result, later = np.empty_like(rotations), np.broadcast_to(np.eye(3), (len(steps), 3, 3))
    for k in range(steps.shape[1] - 1, -1, -1):
        result[:, k] = later @ half[:, k]
        later = later @ rotations[:, k]
    return result


def _rotations(vectors: Array) -> Array:
    """Rotations by vectors (..., 3), rad, as matrices (..., 3, 3)."""
    return np.asarray(Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(*vectors.shape, 3))
