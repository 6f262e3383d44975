"""A record of motion as rows for a fit: the lines of the motion as templates of the output, and the noise near them.

Ten thousand samples behind an output filter are not independent, and most of their band has only noise. So a record
is cut into some thirty stretches of a whole number of periods. Each stretch is reduced to its mean and to its parts
in phase and in quadrature with each line of the motion, as in a lock-in amplifier. Each of these parts is a channel,
and their rows are independent.

    weights . samples = rows            the model's prediction is reduced by the same weights as the measurement

The white noise of a line is the density of the output near it, without the part that follows the motion: a noise model
without parameters (Pintelon and Schoukens, System Identification: A Frequency Domain Approach, 2012).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from scipy.sparse import csr_array

from calibrations.criteria import FEWEST_MOTION_STRETCHES, LEAST_LINE, LEAST_LINE_WEIGHT
from calibrations.errors import TooFewRows
from calibrations.motion.reference import Reference, line_prominence, reference_acceleration
from calibrations.motion.spectrum import Record, corner_hz, find_records, first_order, periodogram, sample_output
from calibrations.table import Array, Table

NOISE_BAND_HZ = 8.0  # of a line, on each side: where its noise is taken from
OWN_LINES = 3  # of a record's spectrum, on each side of a line: the motion's own
INLYING_MEAN = 0.934  # of an exponential distribution below LEAST_LINE medians


@dataclass(frozen=True)
class ResidualLine:
    """The output by one line of amplitude 1, and its derivative; shape (samples,) each."""

    name: str
    at_hz: float
    in_phase: Array
    in_quadrature: Array


def residual_lines(
    samples: Table, references: Sequence[Reference], expected: Array, length_s: float
) -> tuple[ResidualLine, ...]:
    """The lines that a stretch of this length resolves, strongest first, and the residual motion."""
    lines: list[ResidualLine] = []
    residual = expected.copy()
    for f in _frequencies(references, length_s):
        in_phase, in_quadrature = np.zeros(samples.n), np.zeros(samples.n)
        for record in find_records(samples):
            turn = 2 * np.pi * f * samples.time_s[record.rows]
            waves = np.column_stack([np.cos(turn), np.sin(turn), np.ones(len(turn))])
            c, s, _ = np.linalg.lstsq(waves, residual[record.rows], rcond=None)[0]
            residual[record.rows] -= waves[:, :2] @ (c, s)
            c, s = np.array([c, s]) / np.hypot(c, s)
            in_phase[record.rows] = waves[:, :2] @ (c, s)
            in_quadrature[record.rows] = waves[:, :2] @ (s, -c)
        lines.append(ResidualLine(f"at {f:.4g} Hz", f, in_phase, in_quadrature))
    return (*lines, _broadband(samples, residual, bool(lines)))


def _frequencies(references: Sequence[Reference], length_s: float) -> list[float]:
    lines = [line for reference in references for line in reference.lines]
    frequencies: list[float] = []
    for line in sorted(lines, key=line_prominence, reverse=True):
        if all(abs(line.frequency_hz - f) * length_s > 0.9 for f in (0.0, *frequencies)):
            frequencies.append(line.frequency_hz)
    return frequencies


def _broadband(samples: Table, residual: Array, has_lines: bool) -> ResidualLine:
    """Motion without a line: its own form, and its derivative; the noise is that at the middle of its spectrum."""
    slope, middle = np.zeros(samples.n), []
    for record in find_records(samples):
        slope[record.rows] = np.gradient(residual[record.rows])
        f, power = periodogram(residual[record.rows], record.rate_hz)
        middle.append(float(np.sum(f * power) / max(float(np.sum(power)), np.finfo(float).tiny)))
    return ResidualLine(
        "with the rest of the motion" if has_lines else "with the motion", float(np.mean(middle)), residual, -slope
    )


def noise_density(samples: Table, lines: Sequence[ResidualLine], axis: int) -> Array:
    """One-sided density of one axis near 0 Hz and near each line, shape (1 + lines,)."""
    low_pass = first_order(corner_hz(samples))
    pieces = [_spectrum(samples, lines, axis, record.rows, record.rate_hz) for record in find_records(samples)]
    f = np.concatenate([piece[0] for piece in pieces])
    density = np.concatenate([piece[1] for piece in pieces]) / np.abs(low_pass(f)) ** 2

    def density_near(at_hz: float) -> float:
        neighbours = density[np.abs(f - at_hz) < NOISE_BAND_HZ]
        inlying = neighbours[neighbours < LEAST_LINE * np.median(neighbours)]
        return float(np.mean(inlying) / INLYING_MEAN * np.abs(low_pass(np.array([at_hz]))[0]) ** 2)

    return np.array([density_near(at_hz) for at_hz in (0.0, *(line.at_hz for line in lines))])


def _spectrum(
    samples: Table, lines: Sequence[ResidualLine], axis: int, rows: slice, rate_hz: float
) -> tuple[Array, Array]:
    """(frequency, density) of the output without what follows the motion, the regions of the lines, and drift."""
    v = samples.outputs[rows, axis]
    columns = [np.ones(len(v)), np.linspace(-1, 1, len(v))]
    columns += [t[rows] for line in lines for t in (line.in_phase, line.in_quadrature)]
    follows = np.column_stack([c for c in columns if np.any(c)])
    size = np.linalg.norm(follows, axis=0)
    f, density = periodogram(v - follows / size @ np.linalg.lstsq(follows / size, v, rcond=None)[0], rate_hz)
    excluded = np.zeros(len(f), dtype=bool)
    for at_hz in (0.0, *(line.at_hz for line in lines)):
        excluded |= np.abs(f - at_hz) < OWN_LINES * f[1]
    excluded[-1] = True  # half the sampling rate has another distribution
    return f[~excluded], density[~excluded]


STRETCHES = 30  # of all records together; slow noise wants 20
EDGE_S = 0.25  # left out at each end of a record: filters settle
SAMPLES_A_PERIOD = 10  # of the fastest line, after averaging
SLOWEST_RATE_HZ = 100.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretches(Table):
    """A table of motion with a row for each stretch: its means. What it holds of the motion is in `parts`.

    `samples` are block means of the record's rows, with the reference `acceleration_m_s2`. `weights` has shape
    (parts * rows, samples), `white` (channels, rows): the standard deviation of each part by white noise. Channels are
    named by axis and part, such as "x in phase at 10 Hz".
    """

    samples: Table
    lines: tuple[ResidualLine, ...]
    weights: csr_array
    channels: tuple[str, ...]
    white: Array
    raw_digest: str

    @property
    def digest(self) -> str:
        """The value of the record itself."""
        return self.raw_digest

    def parts(self, v: Array) -> Array:
        """Samples of each axis, shape (samples, axes), reduced to parts, shape (channels, rows)."""
        return np.asarray((self.weights @ v).T.reshape(len(self.channels), self.n))


@lru_cache(maxsize=8)
def make_stretches(table: Table) -> Stretches:
    """The record's rows for a fit. Raises DataError, TooFewRows."""
    if isinstance(table, Stretches):
        return table
    records = find_records(table)
    references = [
        reference_acceleration(r.times_s(table.time_s), table.column("displacement_m")[r.rows], r.rate_hz)
        for r in records
    ]
    samples = _average_blocks(table, records, references)
    expected = _expected_force(samples)
    slope = _slope(samples, expected)
    length_s = _length_s(records, references)
    cuts = list(_cuts(samples, length_s))
    if len(cuts) < FEWEST_MOTION_STRETCHES:
        raise TooFewRows(f"{table.source}: the record has only {len(cuts)} stretches of motion; record it longer")
    lines = _visible_lines(samples, residual_lines(samples, references, expected, length_s), cuts, slope * expected)
    return _rows(table, samples, lines, cuts, slope)


def _visible_lines(
    samples: Table, lines: tuple[ResidualLine, ...], cuts: list[tuple[int, int]], expected: Array
) -> tuple[ResidualLine, ...]:
    """The lines above a row's noise in at least one stretch; the strongest line always."""
    amplitudes = np.abs((_weights(lines, cuts, samples.n) @ expected).reshape(-1, len(cuts)))
    white = _white(samples, lines, cuts)[: len(amplitudes)]
    visible = np.any(amplitudes > LEAST_LINE_WEIGHT * white, axis=1)
    return tuple(line for k, line in enumerate(lines) if k == 0 or visible[2 * k + 1])


def _rows(
    table: Table, samples: Table, lines: Sequence[ResidualLine], cuts: list[tuple[int, int]], slope: float
) -> Stretches:
    means = {name: np.array([values[a:b].mean() for a, b in cuts]) for name, values in samples.columns.items()}
    parts = ["mean", *(f"{phase} {line.name}" for line in lines for phase in ("in phase", "in quadrature"))]
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


def _average_blocks(table: Table, records: Sequence[Record], references: Sequence[Reference]) -> Table:
    """Block means of all columns and of the reference, as many as the fastest line allows.

    Measurement and reference are averaged alike, so that the averaging does not change the comparison.
    """
    fastest = max((line.frequency_hz for reference in references for line in reference.lines), default=0.0)
    rate_hz = max(SAMPLES_A_PERIOD * fastest, SLOWEST_RATE_HZ)
    pieces: dict[str, list[Array]] = {name: [] for name in (*table.columns, "acceleration_m_s2", "record")}
    for number, (record, reference) in enumerate(zip(records, references, strict=True)):
        block = max(1, int(record.rate_hz / rate_hz))
        n = (record.end - record.first) // block
        even = {**table.columns, "t_s": np.append(np.zeros(record.first), record.times_s(table.time_s))}
        for name, values in even.items():
            pieces[name].append(values[record.first : record.first + n * block].reshape(n, block).mean(axis=1))
        pieces["acceleration_m_s2"].append(reference.acceleration_m_s2[: n * block].reshape(n, block).mean(axis=1))
        pieces["record"].append(np.full(n, float(number)))
    columns = {name: np.concatenate(values) for name, values in pieces.items()}
    return Table("motion", MappingProxyType(columns), table.constants, table.source)


def _expected_force(samples: Table) -> Array:
    """The motion's specific force behind x's nominal output filter, g, shape (samples,)."""
    a = samples.column("acceleration_m_s2") / samples.gravity_m_s2
    return sample_output(a[:, None], samples)[:, 0]


def _slope(samples: Table, expected: Array) -> float:
    """Output of x per g of the motion, without each record's mean."""
    v, h = samples.outputs[:, 0].copy(), expected.copy()
    for record in find_records(samples):
        v[record.rows] -= v[record.rows].mean()
        h[record.rows] -= h[record.rows].mean()
    return float(h @ v / max(float(h @ h), np.finfo(float).tiny)) or 1.0


def _length_s(records: Sequence[Record], references: Sequence[Reference]) -> float:
    """Length of a stretch: whole periods of the strongest line."""
    target_s = sum((r.end - r.first) / r.rate_hz - 2 * EDGE_S for r in records) / STRETCHES
    lines = [line for reference in references for line in reference.lines]
    if not lines:
        return target_s
    at_hz = max(lines, key=line_prominence).frequency_hz
    return max(1, round(target_s * at_hz)) / at_hz


def _cuts(samples: Table, length_s: float) -> Iterator[tuple[int, int]]:
    """First row and end of each stretch."""
    for record in find_records(samples):
        edge = EDGE_S * record.rate_hz
        count = int((record.end - record.first - 2 * edge) / (length_s * record.rate_hz) + 1e-6)
        edges = record.first + np.round(edge + np.arange(count + 1) * length_s * record.rate_hz).astype(int)
        yield from zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)


def _weights(lines: Sequence[ResidualLine], cuts: list[tuple[int, int]], n: int) -> csr_array:
    """Rows part by part: the mean, and the amplitude along each template, orthogonal to the earlier ones."""
    templates = np.column_stack([np.ones(n), *(t for line in lines for t in (line.in_phase, line.in_quadrature))])
    values, columns = [], []
    for a, b in cuts:
        Q, R = np.linalg.qr(templates[a:b])
        size = np.sqrt(np.append(1.0, np.full(Q.shape[1] - 1, 2.0)) / (b - a))
        values.append(Q * np.where(np.diag(R) < 0, -1.0, 1.0) * size)
        columns.append(np.arange(a, b))
    data = [value[:, k] for k in range(templates.shape[1]) for value in values]
    starts = np.concatenate([[0], np.cumsum([len(products) for products in data])])
    columns_of_data = np.concatenate(columns * templates.shape[1])
    return csr_array((np.concatenate(data), columns_of_data, starts), shape=(len(data), n))


def _white(samples: Table, lines: Sequence[ResidualLine], cuts: list[tuple[int, int]]) -> Array:
    """Standard deviation of each part by white noise, shape (channels, rows): the density near its line."""
    rate_hz = find_records(samples)[0].rate_hz
    lengths = np.array([b - a for a, b in cuts])
    density = np.array([noise_density(samples, lines, axis) for axis in range(len(samples.axes))])
    share = np.append(1.0, np.full(2 * len(lines), 2.0))[None, :, None] / lengths
    variance = np.repeat(density, [1, *[2] * len(lines)], axis=1)[:, :, None] * rate_hz / 2 * share
    return np.asarray(np.sqrt(variance).reshape(-1, len(cuts)))
