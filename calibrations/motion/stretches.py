"""A record of motion as rows that a model can be fitted to: what each stretch of it holds of the motion.

Ten thousand samples behind an output filter are far from independent, and most of their band holds noise alone. So a
record is cut into some thirty stretches, each a whole number of periods, and each stretch is reduced to its mean and to
its parts in phase and in quadrature with each line of the motion, as a lock-in amplifier does. These parts are a
channel each, and their rows are independent.

    weights . samples = rows            the model's prediction is reduced by the same weights as the measurement
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from scipy.sparse import csr_array

from calibrations.errors import TooFewRows
from calibrations.motion.lines import Line, lines_of, noise_density
from calibrations.motion.output import sampled
from calibrations.motion.records import Record, records
from calibrations.motion.reference import Reference, reference, strength
from calibrations.table import Array, Table

STRETCHES = 30  # of all records together; slow noise wants 20
FEWEST = 6
EDGE_S = 0.25  # left out at each end of a record: filters settle
SAMPLES_A_PERIOD = 10  # of the fastest line, after averaging
SLOWEST_RATE_HZ = 100.0
FAINT = 1.0  # times the noise of a row: weaker in every stretch, a line tells nothing


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretches(Table):
    """A table of motion with a row for each stretch: its means. What it holds of the motion is in `parts`.

    `samples` are block means of the record's rows, with the reference `acceleration_m_s2`. `weights` has shape
    (parts * rows, samples), `white` (channels, rows): the standard deviation of each part by white noise. Channels are
    named by axis and part, such as "x in phase at 10 Hz".
    """

    samples: Table
    lines: tuple[Line, ...]
    weights: csr_array
    channels: tuple[str, ...]
    white: Array
    raw_digest: str

    @property
    def digest(self) -> str:
        """That of the record itself."""
        return self.raw_digest

    def parts(self, v: Array) -> Array:
        """Samples of each axis, shape (samples, axes), reduced to parts, shape (channels, rows)."""
        return np.asarray((self.weights @ v).T.reshape(len(self.channels), self.n))


@lru_cache(maxsize=8)
def stretches(table: Table) -> Stretches:
    """The record's rows for a fit. Raises DataError, TooFewRows."""
    if isinstance(table, Stretches):
        return table
    found = records(table)
    made = [reference(r.times_s(table.time_s), table.column("displacement_m")[r.rows], r.rate_hz) for r in found]
    samples = _averaged(table, found, made)
    expected = _expected(samples)
    slope = _slope(samples, expected)
    length_s = _length_s(found, made)
    cuts = list(_cuts(samples, length_s))
    if len(cuts) < FEWEST:
        raise TooFewRows(f"{table.source}: the record holds only {len(cuts)} stretches of motion; record it longer")
    lines = _shown(samples, lines_of(samples, made, expected, length_s), cuts, slope * expected)
    return _rows(table, samples, lines, cuts, slope)


def _shown(samples: Table, lines: tuple[Line, ...], cuts: list[tuple[int, int]], expected: Array) -> tuple[Line, ...]:
    """The lines that stand out of a row's noise in one stretch at least; the strongest in any case."""
    there = np.abs((_weights(lines, cuts, samples.n) @ expected).reshape(-1, len(cuts)))
    white = _white(samples, lines, cuts)[: len(there)]
    seen = np.any(there > FAINT * white, axis=1)
    return tuple(line for k, line in enumerate(lines) if k == 0 or seen[2 * k + 1])


def _rows(table: Table, samples: Table, lines: Sequence[Line], cuts: list[tuple[int, int]], slope: float) -> Stretches:
    means = {name: np.array([values[a:b].mean() for a, b in cuts]) for name, values in samples.columns.items()}
    parts = ["mean", *(f"{how} {line.name}" for line in lines for how in ("in phase", "in quadrature"))]
    return Stretches(
        kind="motion",
        columns=MappingProxyType({name: values for name, values in means.items() if name in table}),
        constants={**table.constants, "output_per_g": slope},
        source=table.source,
        samples=samples,
        lines=tuple(lines),
        weights=_weights(lines, cuts, samples.n),
        channels=tuple(f"{axis} {part}" for axis in table.axes for part in parts),
        white=_white(samples, lines, cuts),
        raw_digest=table.digest,
    )


def _averaged(table: Table, found: Sequence[Record], made: Sequence[Reference]) -> Table:
    """Block means of all columns and of the reference, as many as the fastest line allows.

    Measurement and reference are averaged alike, so that the averaging has no share in what is compared.
    """
    fastest = max((line.frequency_hz for each in made for line in each.lines), default=0.0)
    rate_hz = max(SAMPLES_A_PERIOD * fastest, SLOWEST_RATE_HZ)
    pieces: dict[str, list[Array]] = {name: [] for name in (*table.columns, "acceleration_m_s2", "record")}
    for number, (record, each) in enumerate(zip(found, made, strict=True)):
        block = max(1, int(record.rate_hz / rate_hz))
        n = (record.end - record.first) // block
        even = {**table.columns, "t_s": np.append(np.zeros(record.first), record.times_s(table.time_s))}
        for name, values in even.items():
            pieces[name].append(values[record.first : record.first + n * block].reshape(n, block).mean(axis=1))
        pieces["acceleration_m_s2"].append(each.acceleration_m_s2[: n * block].reshape(n, block).mean(axis=1))
        pieces["record"].append(np.full(n, float(number)))
    columns = {name: np.concatenate(values) for name, values in pieces.items()}
    return Table("motion", MappingProxyType(columns), table.constants, table.source)


def _expected(samples: Table) -> Array:
    """The motion's specific force behind x's nominal output filter, g, shape (samples,)."""
    a = samples.column("acceleration_m_s2") / samples.gravity_m_s2
    return sampled(a[:, None], samples)[:, 0]


def _slope(samples: Table, expected: Array) -> float:
    """Output of x per g of the motion, beside each record's mean."""
    v, h = samples.outputs[:, 0].copy(), expected.copy()
    for record in records(samples):
        v[record.rows] -= v[record.rows].mean()
        h[record.rows] -= h[record.rows].mean()
    return float(h @ v / max(float(h @ h), np.finfo(float).tiny)) or 1.0


def _length_s(found: Sequence[Record], made: Sequence[Reference]) -> float:
    """Length of a stretch: whole periods of the strongest line."""
    wanted = sum((r.end - r.first) / r.rate_hz - 2 * EDGE_S for r in found) / STRETCHES
    lines = [line for each in made for line in each.lines]
    if not lines:
        return wanted
    at_hz = max(lines, key=strength).frequency_hz
    return max(1, round(wanted * at_hz)) / at_hz


def _cuts(samples: Table, length_s: float) -> Iterator[tuple[int, int]]:
    """First row and end of each stretch."""
    for record in records(samples):
        edge = EDGE_S * record.rate_hz
        count = int((record.end - record.first - 2 * edge) / (length_s * record.rate_hz) + 1e-6)
        at = record.first + np.round(edge + np.arange(count + 1) * length_s * record.rate_hz).astype(int)
        yield from zip(at[:-1].tolist(), at[1:].tolist(), strict=True)


def _weights(lines: Sequence[Line], cuts: list[tuple[int, int]], n: int) -> csr_array:
    """Rows part by part: the mean, and the amplitude along each template freed of those before it."""
    templates = np.column_stack([np.ones(n), *(t for line in lines for t in (line.in_phase, line.in_quadrature))])
    values, columns = [], []
    for a, b in cuts:
        Q, R = np.linalg.qr(templates[a:b])
        size = np.sqrt(np.append(1.0, np.full(Q.shape[1] - 1, 2.0)) / (b - a))
        values.append(Q * np.where(np.diag(R) < 0, -1.0, 1.0) * size)
        columns.append(np.arange(a, b))
    data = [value[:, k] for k in range(templates.shape[1]) for value in values]
    starts = np.concatenate([[0], np.cumsum([len(each) for each in data])])
    where = np.concatenate(columns * templates.shape[1])
    return csr_array((np.concatenate(data), where, starts), shape=(len(data), n))


def _white(samples: Table, lines: Sequence[Line], cuts: list[tuple[int, int]]) -> Array:
    """Standard deviation of each part by white noise, shape (channels, rows): the density beside its line."""
    rate_hz = records(samples)[0].rate_hz
    lengths = np.array([b - a for a, b in cuts])
    density = np.array([noise_density(samples, lines, axis) for axis in range(len(samples.axes))])
    share = np.append(1.0, np.full(2 * len(lines), 2.0))[None, :, None] / lengths
    variance = np.repeat(density, [1, *[2] * len(lines)], axis=1)[:, :, None] * rate_hz / 2 * share
    return np.asarray(np.sqrt(variance).reshape(-1, len(cuts)))
