"""Both models beside the displacement sensor, as in the paper's Fig. 12.

The sensor's output is freed of the output filter and of the sampling's skew and brought into the paper's band (a
second-order Butterworth low-pass at 20 Hz, freed of its delay and attenuation at the motion's frequency); each model
makes acceleration of it. The reference goes through the same low-pass, so that both sides have the same band.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calibrations.errors import DataError
from calibrations.model import Model
from calibrations.motion.output import NOMINAL_CORNER_HZ
from calibrations.motion.records import Record, records
from calibrations.motion.reference import Bias, Reference, bias_of, biases, paper_reference, reference
from calibrations.motion.sensor import measured, undone
from calibrations.motion.spectrum import (
    PAPER_CORNER_HZ,
    Response,
    butterworth,
    corrected,
    first_order,
    periodogram,
    through,
)
from calibrations.noise import rms
from calibrations.table import Array, Table

BAND = "the band of both, Butterworth at 20 Hz"
EDGE_S = 5 / PAPER_CORNER_HZ  # left out at each end of a record
BLOCKS = 20  # left out in turn, for uncertainties


@dataclass(frozen=True)
class Quantity:
    """A value with its standard uncertainty."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class MotionResult:
    """Acceleration along the motion, mm/s^2, shape (n,): reference and both models; and what follows from them.

    `by_the_paper` is the reference as the paper makes it, in the same band.
    """

    t_s: Array
    reference: Array
    by_the_paper: Array
    linear: Array
    physical: Array
    rmse_linear: Quantity
    rmse_physical: Quantity
    improvement: Quantity
    noise_limit: Quantity
    amplitude: Quantity
    frequency: Quantity
    biases: tuple[Bias, ...]

    @cached_property
    def excess(self) -> float:
        """The physical model's error over what the sensor's noise allows."""
        return self.rmse_physical.value / self.noise_limit.value

    @property
    def results(self) -> Mapping[str, Quantity]:
        """By the names under which a run gives them."""
        return {
            "rmse-linear-x": self.rmse_linear,
            "rmse-physical-x": self.rmse_physical,
            "improvement-x": self.improvement,
            "noise-limit-x": self.noise_limit,
            "amplitude": self.amplitude,
            "frequency": self.frequency,
        }


def evaluate(table: Table, linear: Model, physical: Model, still: Table | None = None) -> MotionResult:
    """Both models, with the values that they have, on the longest record of a table of motion.

    The noise limit is that of the `still` record of the same sensor, else of what the physical model leaves beside the
    motion's lines. Raises ModelError for a model without values, DataError where nothing moves.
    """
    record = max(records(table), key=lambda r: r.end - r.first)
    part = table.rows(np.arange(record.first, record.end))
    times_s = record.times_s(table.time_s)
    found = reference(times_s, part.column("displacement_m"), record.rate_hz)
    if not found.moves:
        raise DataError(f"{table.source}: the displacement holds no motion that stands out of its noise")
    band = corrected(butterworth(record.rate_hz), found.at_hz)
    true = 1e3 * through(found.acceleration_m_s2, record.rate_hz, band)
    paper = 1e3 * paper_reference(part.column("displacement_m"), record.rate_hz, found.at_hz)
    errors = {name: measured(part, record, m, band) - true for name, m in (("linear", linear), ("physical", physical))}
    if np.dot(errors["physical"] + true, true - true.mean()) < 0:
        raise DataError(
            f'{table.source}: the column "displacement_m" falls where the sensor\'s acceleration along x rises; '
            "change its sign: it grows towards the sensor's +x"
        )
    edge = int(np.ceil(EDGE_S * record.rate_hz))
    inner = slice(edge, len(true) - edge)
    blocks = [np.array_split(errors[name][inner], BLOCKS) for name in ("linear", "physical")]
    low, high = _jackknife(blocks[:1], _rmse), _jackknife(blocks[1:], _rmse)
    amplitude, std = found.amplitude
    return MotionResult(
        t_s=times_s[inner],
        reference=true[inner],
        by_the_paper=paper[inner],
        linear=(true + errors["linear"])[inner],
        physical=(true + errors["physical"])[inner],
        rmse_linear=Quantity(*low, "mm/s^2"),
        rmse_physical=Quantity(*high, "mm/s^2"),
        improvement=Quantity(*_jackknife(blocks, lambda pair: 1 - _rmse(pair[1:]) / _rmse(pair[:1])), "1"),
        noise_limit=_noise_limit(part, record, physical, band, found, still),
        amplitude=Quantity(1e3 * amplitude, 1e3 * std, "mm/s^2"),
        frequency=Quantity(found.at_hz, found.lines[0].frequency_std_hz if found.lines else 0.0, "Hz"),
        biases=(*biases(found), bias_of(BAND, band, found.at_hz, record.rate_hz, EDGE_S)),
    )


def _rmse(groups: list[list[Array]]) -> float:
    return float(rms(np.concatenate(groups[0])))


def _jackknife(groups: list[list[Array]], of: Callable[[list[list[Array]]], float]) -> tuple[float, float]:
    """A statistic of groups of blocks, and its standard uncertainty from leaving each block out (Efron)."""
    count = len(groups[0])
    left = np.array([of([blocks[:k] + blocks[k + 1 :] for blocks in groups]) for k in range(count)])
    return of(groups), float(np.sqrt((count - 1) * np.var(left)))


def _noise_limit(
    part: Table, record: Record, model: Model, band: Response, found: Reference, still: Table | None
) -> Quantity:
    """Rms that the sensor's noise alone leaves in the band, mm/s^2."""
    source = part if still is None else still
    where = record if still is None else max(records(still), key=lambda r: r.end - r.first)
    x = source.column("vx_v")[where.rows]
    if still is None:
        x = x - _follows(x, record, found)
    f, density = periodogram(x, where.rate_hz)
    above = f > 1.5 * record.rate_hz / part.n  # slower than the record is its mean
    size = np.abs(undone(part, model, 0, band)(f)) * 1e3 * part.gravity_m_s2 / _per_g(model)
    power = density[above] * size[above] ** 2 * f[1]
    limit = max(float(np.sqrt(power.sum())), np.finfo(float).tiny)  # a converter may see no noise at all
    # a line of a spectrum is known to its own size; Hann's window makes neighbours alike: 1.5 lines in one
    return Quantity(limit, float(np.sqrt(1.5 * np.sum(power**2))) / (2 * limit), "mm/s^2")


def _per_g(model: Model) -> float:
    """Output of x per g."""
    values = {e.axis: e.value for term in model.terms if term.name == "scale-factor" for e in term.estimates}
    return abs(values.get("x", values.get("", 1.0)))


def _follows(x: Array, record: Record, found: Reference) -> Array:
    """What of an output follows the motion, whatever its size and delay."""
    seen = through(found.acceleration_m_s2, record.rate_hz, first_order(NOMINAL_CORNER_HZ))
    columns = [np.ones(len(x)), seen, np.gradient(seen)]
    t = np.arange(len(x)) / record.rate_hz
    columns += [wave(2 * np.pi * line.frequency_hz * t) for line in found.lines for wave in (np.cos, np.sin)]
    each = np.column_stack(columns) / np.linalg.norm(columns, axis=1)
    return np.asarray(each @ np.linalg.lstsq(each, x, rcond=1e-9)[0])
