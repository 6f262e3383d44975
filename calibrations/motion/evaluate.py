"""Both models beside the displacement sensor, as in the paper's Fig. 12.

The sensor's output is freed of the output filter and of the sampling's skew and brought into the paper's band (a
second-order Butterworth low-pass at 20 Hz, freed of its delay and attenuation at the motion's frequency); each model
makes acceleration of it. The reference goes through the same low-pass, so that both sides have the same band.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibrations.chain import force, respond, sensed
from calibrations.errors import DataError, ModelError
from calibrations.model import Model
from calibrations.motion.output import corner_hz, skew_s
from calibrations.motion.records import Record, records
from calibrations.motion.reference import Bias, Reference, bias_of, biases, paper_reference, reference
from calibrations.motion.spectrum import (
    PAPER_CORNER_HZ,
    Response,
    butterworth,
    corrected,
    delayed,
    first_order,
    periodogram,
    through,
)
from calibrations.noise import rms
from calibrations.parameters import Layout
from calibrations.table import Array, Table

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
    if not found.lines:
        raise DataError(f"{table.source}: the displacement holds no motion that stands out of its noise")
    line = found.lines[0]
    band = corrected(butterworth(record.rate_hz), line.frequency_hz)
    true = 1e3 * through(found.acceleration_m_s2, record.rate_hz, band)
    paper = 1e3 * paper_reference(part.column("displacement_m"), record.rate_hz, line.frequency_hz)
    errors = {name: _measured(part, record, m, band) - true for name, m in (("linear", linear), ("physical", physical))}
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
        frequency=Quantity(line.frequency_hz, line.frequency_std_hz, "Hz"),
        biases=(*biases(found), _band_bias(band, line.frequency_hz, record)),
    )


def acceleration(table: Table, model: Model) -> Array:
    """Acceleration along x, m/s^2, shape (n,), that instantaneous outputs mean under a model: gravity taken off.

    Axes that were not measured feel what the attitude gives them. Raises ModelError for a model without values.
    """
    still = replace(table, kind="poses")  # each sample by itself
    model = model.for_table(still)
    layout = Layout.of(model, still)
    theta = layout.known()
    if theta is None:
        raise ModelError(f"the model {model.name} has no values yet; fit it to a sweep of the same sensor first")
    steps = layout.steps(theta)
    poses = [step for step in steps if step[0].pose is not None]
    gravity = force(still, poses)
    a, axes = gravity.copy(), len(table.axes)
    for _ in range(20):
        error = table.outputs - respond(sensed(a, still, steps), still, steps)[:, :axes]
        slope = _slope(lambda b: respond(sensed(b, still, steps), still, steps)[:, :axes], a, axes)
        change = np.linalg.solve(slope, error[:, :, None])[:, :, 0]
        a[:, :axes] += change
        if not np.max(np.abs(change)) > 1e-12:
            break
    return np.asarray((a - gravity)[:, 0] * table.gravity_m_s2)


def _slope(output: Callable[[Array], Array], a: Array, axes: int, h: float = 1e-4) -> Array:
    """d output / d a over the measured axes, shape (n, axes, axes)."""
    return np.stack([(output(a + h * e) - output(a - h * e)) / (2 * h) for e in np.eye(3)[:axes]], axis=2)


def _measured(part: Table, record: Record, model: Model, band: Response) -> Array:
    """Acceleration in mm/s^2 by the sensor under a model, in the band."""
    columns = dict(part.columns)
    for k, axis in enumerate(part.axes):
        response = _freed(part, model, k, band)
        columns[f"v{axis}_v"] = through(part.outputs[:, k], record.rate_hz, response)
    return 1e3 * acceleration(Table(part.kind, columns, part.constants, part.source), model)


def _freed(table: Table, model: Model, axis: int, band: Response) -> Response:
    """From samples to the transducer's output in the band: the output filter and the skew undone.

    A corner and a delay that the model holds take the place of the nominal ones.
    """
    values = {
        term.name: {e.axis: e.value for e in term.estimates} for term in model.terms if term.effect.kinds == ("motion",)
    }
    name = table.axes[axis]
    corner = corner_hz(table) + values.get("output-filter", {}).get(name, 0.0)
    late = values.get("sampling-delay", {}).get(name, 0.0) - skew_s(table, axis)
    low_pass, undelayed = first_order(corner), delayed(-late)
    return lambda f: np.asarray(band(f) * undelayed(f) / low_pass(f))


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
        x = x - _follows(x, part.time_s, found)
    f, density = periodogram(x, where.rate_hz)
    above = f > 1.5 / len(part.time_s) * record.rate_hz  # slower than the record is its mean
    size = np.abs(_freed(part, model, 0, band)(f)) * 1e3 * part.gravity_m_s2 / _per_g(model)
    power = density[above] * size[above] ** 2 * f[1]
    limit = float(np.sqrt(power.sum()))
    # a line of a spectrum is known to its own size; Hann's window makes neighbours alike: 1.5 lines in one
    return Quantity(limit, float(np.sqrt(1.5 * np.sum(power**2))) / (2 * limit), "mm/s^2")


def _per_g(model: Model) -> float:
    """Output of x per g."""
    values = {e.axis: e.value for term in model.terms if term.name == "scale-factor" for e in term.estimates}
    return abs(values.get("x", values.get("", 1.0)))


def _follows(x: Array, t_s: Array, found: Reference) -> Array:
    """What of an output follows the motion's lines, whatever its size and phase."""
    turns = [2 * np.pi * line.frequency_hz * t_s for line in found.lines]
    columns = np.column_stack([np.ones(len(x)), *(wave(turn) for turn in turns for wave in (np.cos, np.sin))])
    return np.asarray(columns @ np.linalg.lstsq(columns, x, rcond=None)[0])


def _band_bias(band: Response, at_hz: float, record: Record) -> Bias:
    """What the band does to both sides alike."""
    return bias_of("the band of both, Butterworth at 20 Hz", band, at_hz, record.rate_hz, EDGE_S)
