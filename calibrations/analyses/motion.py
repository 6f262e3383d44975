"""Linear and physical model against the displacement sensor's acceleration, as in the paper's Fig. 12.

Output filter and sampling skew are removed from the sensor's output, which is then low-passed to the paper's band (a
second-order Butterworth at 20 Hz, corrected for its delay and attenuation at the motion's frequency). Each model
converts it to acceleration: the inverse of the output filter, then the inverse of the model. The inverse of a low-pass
increases the noise with frequency; the band limits this. The reference passes the same low-pass, so that both have the
same band.

Both models are fitted to a sweep of the same sensor:

linear     the manufacturer's, Ang (1)-(3): bias and scale factor of each axis from +1 g and -1 g
physical   the shipped physical model, fitted jointly. It has hysteresis if the sweep has both directions, because
           its loop would otherwise change the squares and products. A motion is between the branches of the
           hysteresis, where its contribution is 0.

Source  Ang I, (1)-(3); V, Fig. 12.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calibrations.effects.catalogue import catalogue
from calibrations.errors import DataError, ModelError
from calibrations.fitting.fit import fit
from calibrations.geometry.orientation import UPRIGHT_DEG
from calibrations.means.noise import rms
from calibrations.model import Estimate, Model
from calibrations.model.chain import force, respond, sensed
from calibrations.model.file import read_model
from calibrations.model.parameters import Layout
from calibrations.motion.reference import (
    Bias,
    Reference,
    filter_bias,
    reference_acceleration,
    reference_biases,
)
from calibrations.motion.spectrum import (
    NOMINAL_CORNER_HZ,
    PAPER_CORNER_HZ,
    Record,
    Response,
    apply_response,
    butterworth,
    corner_hz,
    correct_at,
    delay,
    find_records,
    first_order,
    periodogram,
    skew_s,
)
from calibrations.table import Array, Table, std_column
from calibrations.tables import KINDS


def acceleration(table: Table, model: Model) -> Array:
    """Acceleration along x, m/s^2, shape (n,), by the inverse of a model from instantaneous outputs, without gravity.

    Axes that were not measured have the specific force of the attitude. Raises ModelError for a model without values.
    """
    still = replace(table, kind="poses")  # each sample by itself
    model = model.for_table(still)
    layout = Layout.of(model, still)
    theta = layout.known()
    if theta is None:
        raise ModelError(f"the model {model.name} has no values yet; fit it to a sweep of the same sensor first")
    steps = layout.steps(theta)
    poses = [step for step in steps if "pose" in step[0].places]
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


def measured_acceleration(part: Table, record: Record, model: Model, band: Response) -> Array:
    """Acceleration in mm/s^2 by the sensor under a model, in the band."""
    columns = dict(part.columns)
    for k, axis in enumerate(part.axes):
        response = inverse_response(part, model, k, band)
        columns[part.output_name(axis)] = apply_response(part.outputs[:, k], record.rate_hz, response)
    return 1e3 * acceleration(Table(part.kind, columns, part.constants, part.source), model)


def inverse_response(table: Table, model: Model, axis: int, band: Response) -> Response:
    """Invert the response in the band, from samples to the transducer's output: removes the output filter and the skew.

    A corner and a delay that the model holds take the place of the nominal ones.
    """
    name = table.axes[axis]
    corner = corner_hz(table) + model.value(f"output-filter.{name}")
    delay_s = model.value(f"sampling-delay.{name}") - skew_s(table, axis)
    low_pass, undelayed = first_order(corner), delay(-delay_s)
    return lambda f: np.asarray(band(f) * undelayed(f) / low_pass(f))


BAND = "the band of both, Butterworth at 20 Hz"
EDGE_S = 5 / PAPER_CORNER_HZ  # left out at each end of a record
JACKKNIFE_BLOCKS = 20  # left out in turn, for uncertainties


@dataclass(frozen=True)
class Quantity:
    """A value with its standard uncertainty."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True)
class MotionResult:
    """Acceleration along the motion, mm/s^2, shape (n,): reference and both models; and the results of both."""

    t_s: Array
    reference: Array
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
        """Error of the physical model over the error by the sensor's noise alone."""
        return self.rmse_physical.value / self.noise_limit.value

    @property
    def results(self) -> Mapping[str, Quantity]:
        """The results by their names in a run."""
        return {
            "rmse-linear-x": self.rmse_linear,
            "rmse-physical-x": self.rmse_physical,
            "improvement-x": self.improvement,
            "noise-limit-x": self.noise_limit,
            "amplitude": self.amplitude,
            "frequency": self.frequency,
        }


def evaluate_motion(table: Table, linear: Model, physical: Model, still: Table | None = None) -> MotionResult:
    """Both models, with their values, on the longest record of a table of motion.

    The noise limit comes from the `still` record of the same sensor, or else from the physical model's residual outside
    of the motion's lines. Raises ModelError for a model without values, DataError where nothing moves.
    """
    record = max(find_records(table), key=lambda r: r.end - r.first)
    part = table.rows(np.arange(record.first, record.end))
    times_s = record.times_s(table.time_s)
    reference = reference_acceleration(times_s, part.column("displacement_m"), record.rate_hz)
    if not reference.moves:
        raise DataError(f"{table.source}: the displacement shows no motion above its noise")
    band = correct_at(butterworth(record.rate_hz), reference.at_hz)
    true = 1e3 * apply_response(reference.acceleration_m_s2, record.rate_hz, band)
    errors = {
        name: measured_acceleration(part, record, m, band) - true
        for name, m in (("linear", linear), ("physical", physical))
    }
    if np.dot(errors["physical"] + true, true - true.mean()) < 0:
        raise DataError(
            f'{table.source}: the column "displacement_m" falls where the sensor\'s acceleration along x rises; '
            "change its sign: positive is towards +x of the sensor"
        )
    edge = int(np.ceil(EDGE_S * record.rate_hz))
    inner = slice(edge, len(true) - edge)
    blocks = [np.array_split(errors[name][inner], JACKKNIFE_BLOCKS) for name in ("linear", "physical")]
    low, high = _jackknife(blocks[:1], _rmse), _jackknife(blocks[1:], _rmse)
    amplitude, std = reference.amplitude
    return MotionResult(
        t_s=times_s[inner],
        reference=true[inner],
        linear=(true + errors["linear"])[inner],
        physical=(true + errors["physical"])[inner],
        rmse_linear=Quantity(*low, "mm/s^2"),
        rmse_physical=Quantity(*high, "mm/s^2"),
        improvement=Quantity(*_jackknife(blocks, lambda pair: 1 - _rmse(pair[1:]) / _rmse(pair[:1])), "1"),
        noise_limit=_noise_limit(part, record, physical, band, reference, still),
        amplitude=Quantity(1e3 * amplitude, 1e3 * std, "mm/s^2"),
        frequency=Quantity(reference.at_hz, reference.lines[0].frequency_std_hz if reference.lines else 0.0, "Hz"),
        biases=(*reference_biases(reference), filter_bias(BAND, band, reference.at_hz, record.rate_hz, EDGE_S)),
    )


def _rmse(groups: list[list[Array]]) -> float:
    return float(rms(np.concatenate(groups[0])))


def _jackknife(groups: list[list[Array]], statistic: Callable[[list[list[Array]]], float]) -> tuple[float, float]:
    """A statistic of groups of blocks, and its standard uncertainty from leaving each block out (Efron)."""
    count = len(groups[0])
    estimates = np.array([statistic([blocks[:k] + blocks[k + 1 :] for blocks in groups]) for k in range(count)])
    return statistic(groups), float(np.sqrt((count - 1) * np.var(estimates)))


def _noise_limit(
    part: Table, record: Record, model: Model, band: Response, reference: Reference, still: Table | None
) -> Quantity:
    """Rms of the sensor's noise alone in the band, mm/s^2."""
    source = part if still is None else still
    source_record = record if still is None else max(find_records(still), key=lambda r: r.end - r.first)
    x = source.column(part.output_name("x"))[source_record.rows]
    if still is None:
        x = x - _motion_part(x, record, reference)
    f, density = periodogram(x, source_record.rate_hz)
    in_band = f > 1.5 * record.rate_hz / part.n  # slower than the record is its mean
    size = np.abs(inverse_response(part, model, 0, band)(f)) * 1e3 * part.gravity_m_s2 / _per_g(model)
    power = density[in_band] * size[in_band] ** 2 * f[1]
    limit = max(float(np.sqrt(power.sum())), np.finfo(float).tiny)  # a converter may see no noise at all
    # a line of a spectrum is known to its own size; Hann's window makes neighbours alike: 1.5 lines in one
    return Quantity(limit, float(np.sqrt(1.5 * np.sum(power**2))) / (2 * limit), "mm/s^2")


def _per_g(model: Model) -> float:
    """Output of x per g."""
    return abs(model.value("scale-factor.x", 1.0))


def _motion_part(x: Array, record: Record, reference: Reference) -> Array:
    """The part of an output that follows the motion, with any size and delay."""
    filtered = apply_response(reference.acceleration_m_s2, record.rate_hz, first_order(NOMINAL_CORNER_HZ))
    columns = [np.ones(len(x)), filtered, np.gradient(filtered)]
    t = np.arange(len(x)) / record.rate_hz
    columns += [wave(2 * np.pi * line.frequency_hz * t) for line in reference.lines for wave in (np.cos, np.sin)]
    scaled = np.column_stack(columns) / np.linalg.norm(columns, axis=1)
    return np.asarray(scaled @ np.linalg.lstsq(scaled, x, rcond=1e-9)[0])


def linear_from_turns(sweep: Table) -> Model:
    """Ang (1)-(3). Raises DataError if an axis was not measured at both +1 g and -1 g."""
    sweep = _plane_axes(sweep)
    ends = {axis: [_mean(sweep, axis, beta_deg) for beta_deg in UPRIGHT_DEG[axis]] for axis in sweep.axes}
    unit = sweep.unit
    values = {
        "bias": [Estimate("bias", axis, (up + down) / 2, None, unit) for axis, (up, down) in ends.items()],
        "scale-factor": [
            Estimate("scale", axis, (up - down) / 2, None, f"{unit}/g") for axis, (up, down) in ends.items()
        ],
    }
    model = read_model("linear")
    terms = tuple(replace(term, estimates=tuple(values[term.name])) for term in model.terms)
    return replace(model, terms=terms, unit=sweep.unit)


def fit_physical(sweep: Table) -> Model:
    """The physical model of this sweep. Raises TooFewRows, DataError."""
    sweep = _plane_axes(sweep)
    is_two_way = "direction" in sweep and np.ptp(sweep.column("direction")) > 0
    model = read_model("physical")
    return fit(
        replace(model.with_effect(catalogue()["hysteresis"]), name=model.name) if is_two_way else model, sweep
    ).model


def _plane_axes(sweep: Table) -> Table:
    """The sweep with the axes that a table of motion has: those in the plane of the table of beta."""
    kept_names = {*KINDS["motion"].outputs, *KINDS["motion"].digital}
    dropped = {name for name in sweep.output_names if name not in kept_names}
    dropped |= {std_column(name) for name in dropped}
    return replace(sweep, columns={name: values for name, values in sweep.columns.items() if name not in dropped})


def _mean(sweep: Table, axis: str, beta_deg: float) -> float:
    """Mean output of an axis at alpha = 90 deg and this beta."""
    is_at_pose: Array = (sweep.column("alpha_deg") == 90) & (np.mod(sweep.column("beta_deg"), 360) == beta_deg)
    if not is_at_pose.any():
        raise DataError(f"{sweep.source}: no pose at alpha = 90, beta = {beta_deg:g} deg, which axis {axis} needs")
    return float(sweep.output(axis)[is_at_pose].mean())
