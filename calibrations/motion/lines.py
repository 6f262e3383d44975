"""The lines of a motion, as templates of what they make of the output, and the noise beside them.

The white noise of a line is the density of the output beside it, freed of all that follows the motion: a noise model
without parameters (Pintelon and Schoukens, System Identification: A Frequency Domain Approach, 2012).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibrations.motion.output import corner_hz
from calibrations.motion.records import records
from calibrations.motion.reference import Reference, strength
from calibrations.motion.spectrum import first_order, periodogram
from calibrations.table import Array, Table

BESIDE_HZ = 8.0  # of a line, on each side: where its noise is taken from
OWN_LINES = 3  # of a record's spectrum, on each side of a line: the motion's own
OUTLYING = 6.0  # times the median: not of this noise; what lies below has 0.934 of the mean (exponential distribution)


@dataclass(frozen=True)
class Line:
    """What one line makes of the output, amplitude 1, and its derivative; shape (samples,) each."""

    name: str
    at_hz: float
    in_phase: Array
    in_quadrature: Array


def lines_of(samples: Table, made: Sequence[Reference], expected: Array, length_s: float) -> tuple[Line, ...]:
    """The lines that a stretch of this length resolves, strongest first, and what they leave of the motion."""
    found: list[Line] = []
    left = expected.copy()
    for f in _frequencies(made, length_s):
        in_phase, in_quadrature = np.zeros(samples.n), np.zeros(samples.n)
        for record in records(samples):
            turn = 2 * np.pi * f * samples.time_s[record.rows]
            waves = np.column_stack([np.cos(turn), np.sin(turn), np.ones(len(turn))])
            c, s, _ = np.linalg.lstsq(waves, left[record.rows], rcond=None)[0]
            left[record.rows] -= waves[:, :2] @ (c, s)
            c, s = np.array([c, s]) / np.hypot(c, s)
            in_phase[record.rows] = waves[:, :2] @ (c, s)
            in_quadrature[record.rows] = waves[:, :2] @ (s, -c)
        found.append(Line(f"at {f:.4g} Hz", f, in_phase, in_quadrature))
    return (*found, _rest(samples, left, bool(found)))


def _frequencies(made: Sequence[Reference], length_s: float) -> list[float]:
    lines = [line for each in made for line in each.lines]
    chosen: list[float] = []
    for line in sorted(lines, key=strength, reverse=True):
        if all(abs(line.frequency_hz - f) * length_s > 0.9 for f in (0.0, *chosen)):
            chosen.append(line.frequency_hz)
    return chosen


def _rest(samples: Table, left: Array, beside: bool) -> Line:
    """Motion that is no line: its own form, and its derivative; noise as at the middle of its spectrum."""
    slope, middle = np.zeros(samples.n), []
    for record in records(samples):
        slope[record.rows] = np.gradient(left[record.rows])
        f, power = periodogram(left[record.rows], record.rate_hz)
        middle.append(float(np.sum(f * power) / max(float(np.sum(power)), np.finfo(float).tiny)))
    return Line("with the rest of the motion" if beside else "with the motion", float(np.mean(middle)), left, -slope)


def noise_density(samples: Table, lines: Sequence[Line], axis: int) -> Array:
    """One-sided density of one axis beside 0 Hz and beside each line, shape (1 + lines,)."""
    low_pass = first_order(corner_hz(samples))
    pieces = [_spectrum(samples, lines, axis, record.rows, record.rate_hz) for record in records(samples)]
    f = np.concatenate([piece[0] for piece in pieces])
    density = np.concatenate([piece[1] for piece in pieces]) / np.abs(low_pass(f)) ** 2

    def beside(at_hz: float) -> float:
        near = density[np.abs(f - at_hz) < BESIDE_HZ]
        inlying = near[near < OUTLYING * np.median(near)]
        return float(np.mean(inlying) / 0.934 * np.abs(low_pass(np.array([at_hz]))[0]) ** 2)

    return np.array([beside(at_hz) for at_hz in (0.0, *(line.at_hz for line in lines))])


def _spectrum(samples: Table, lines: Sequence[Line], axis: int, rows: slice, rate_hz: float) -> tuple[Array, Array]:
    """(frequency, density) of what does not follow the motion, without the lines' own neighbourhood and drift."""
    v = samples.outputs[rows, axis]
    columns = [np.ones(len(v)), np.linspace(-1, 1, len(v))]
    columns += [t[rows] for line in lines for t in (line.in_phase, line.in_quadrature)]
    follows = np.column_stack([c for c in columns if np.any(c)])
    size = np.linalg.norm(follows, axis=0)
    f, density = periodogram(v - follows / size @ np.linalg.lstsq(follows / size, v, rcond=None)[0], rate_hz)
    own = np.zeros(len(f), dtype=bool)
    for at_hz in (0.0, *(line.at_hz for line in lines)):
        own |= np.abs(f - at_hz) < OWN_LINES * f[1]
    own[-1] = True  # half the sampling rate has another distribution
    return f[~own], density[~own]
