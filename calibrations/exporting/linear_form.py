"""The equation of other programs, fitted to a model's outputs: estimate = A (x - C(t)).

x is the output and the estimate is in the same kind of unit, as the other program has them. C(t) is a polynomial of the
temperature t - t0, t limited to the calibrated range. Where the model has this form, the fit is exact; elsewhere it has
the smallest mean square of the error over the range of the data.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibrations.errors import ModelError
from calibrations.exporting.simulated import ExportedFile, Loss, SimulatedSensor
from calibrations.importing.units import parse_unit
from calibrations.table import Array

SENSOR = {"g": "accelerometer", "deg/s": "gyroscope", "field": "magnetometer"}
DIAGONAL, SYMMETRIC, FULL, OFFSETS = "diagonal", "symmetric", "full", "offsets"
NEGLIGIBLE = 1e-8  # of the largest input: a loss below this is not named
SI_FACTORS = {"m/s2": 1.0, "rad/s": 1.0, "deg/s": np.pi / 180, "gauss": 1.0, "uT": 1e-2, "mgauss": 1e-3}
CANNOT = {
    DIAGONAL: "the format has an offset and a scale for each axis",
    OFFSETS: "the format has an offset for each axis only",
    SYMMETRIC: "the format has an offset and a symmetric matrix",
    FULL: "the format has an offset and a matrix",
}
GAINS = ("scale-factor", "gyro-scale-factor")  # a format without a scale holds them up to its own gain of 1
ALWAYS = ("bias", "gyro-bias", "hard-iron", "field-strength")  # every form holds them


@dataclass(frozen=True, eq=False)
class Outputs:
    """Outputs `x` and inputs `a` in one unit, shape (n, 3) each; `per` units of the input in one of the model's."""

    simulated: SimulatedSensor
    x: Array
    a: Array
    factor: float  # units of x in one of the model's output
    per: float
    unit: str


@dataclass(frozen=True, eq=False)
class LinearForm:
    """`matrix` (3, 3) and `offsets` (orders, 3): coefficients of C(t), from the constant on, in the unit of x."""

    kind: str
    matrix: Array
    offsets: Array
    t0: float = 0.0

    @property
    def degree(self) -> int:
        return len(self.offsets) - 1

    def rounded(self) -> LinearForm:
        """The form with its numbers as 32 bit, in which autopilots store them."""
        matrix, offsets = (np.asarray(np.float32(part), dtype=float) for part in (self.matrix, self.offsets))
        return replace(self, matrix=matrix, offsets=offsets)

    def estimate(self, outputs: Outputs) -> Array:
        """The corrected outputs, shape (n, 3)."""
        return np.asarray((outputs.x - self.offset(outputs)) @ self.matrix.T)

    def offset(self, outputs: Outputs) -> Array:
        """C(t), shape (n, 3)."""
        return np.asarray(_powers(outputs, self.degree, self.t0) @ self.offsets)


def outputs_in(simulated: SimulatedSensor, unit: str, program: str) -> Outputs:
    """Outputs and inputs in `unit`: m/s^2, rad/s or gauss. Raises ModelError if the model's unit is of another kind.

    The input of a magnetometer is the field by the model's field-strength.
    """
    factor = unit_factor(simulated.model.unit, unit, simulated.gravity_m_s2)
    if factor is None:
        raise ModelError(
            f"{simulated.model.name}: its outputs are in {simulated.model.unit or 'an unknown unit'}, and {program} "
            f"corrects readings in {unit}. Calibrate from a log of {program} (`rig import LOG`)"
        )
    per = {"g": simulated.gravity_m_s2, "deg/s": np.pi / 180, "field": 0.0}[simulated.unit]
    if simulated.unit == "field":
        per = factor * simulated.model.value("field-strength.total", simulated.model.value("field-strength"))
        if not per:
            raise ModelError(f"{simulated.model.name}: has no field-strength; fit it with the model `magnetometer`")
    return Outputs(simulated, factor * simulated.v, per * simulated.a, factor, per, unit)


def unit_factor(unit: str, target: str, gravity_m_s2: float) -> float | None:
    """Units of `target` in one `unit`; None where they are not of one kind."""
    kinds = {"m/s^2": ("m/s2", "g", "mg"), "rad/s": ("rad/s", "deg/s"), "gauss": ("gauss", "mgauss", "uT")}
    unit_name = {"gauss": "gauss", "G": "gauss", "mgauss": "mgauss", "mG": "mgauss"}.get(unit) or parse_unit(unit)
    factors = {**SI_FACTORS, "g": gravity_m_s2, "mg": 1e-3 * gravity_m_s2}
    return factors[unit_name] if unit_name in kinds[target] else None


def fit_form(outputs: Outputs, kind: str, degree: int = 0, t0: float | None = None) -> LinearForm:
    """The form of `kind` with the least mean square of the error.

    `degree` of the polynomial; 0 is taken if the model does not follow the temperature. `t0`: default the middle.
    """
    low, high = outputs.simulated.spans.get("temperature_c", (0.0, 0.0))
    t0, degree = (low + high) / 2 if t0 is None else t0, degree if low < high else 0
    powers = _powers(outputs, degree, t0)
    if kind == OFFSETS:
        return LinearForm(kind, np.eye(3), _solve(powers, outputs.x - outputs.a), t0)
    if kind == DIAGONAL:
        rows = [_solve(np.column_stack([outputs.x[:, i], -powers]), outputs.a[:, i]) for i in range(3)]
        scales = np.array([row[0] for row in rows])
        return LinearForm(kind, np.diag(scales), np.column_stack([row[1:] / row[0] for row in rows]), t0)
    solution = _solve(np.column_stack([outputs.x, -powers]), outputs.a)
    matrix = solution[:3].T
    if kind == SYMMETRIC:
        matrix = (matrix + matrix.T) / 2
    offsets = _solve(powers, outputs.x - np.linalg.solve(matrix, outputs.a.T).T)
    return LinearForm(kind, matrix, offsets, t0)


def error_of(form: LinearForm, outputs: Outputs) -> tuple[float, float]:
    """Rms of the worst axis and largest error of the estimate, in the unit of the model's input."""
    return _size((form.estimate(outputs) - outputs.a) / outputs.per)


def losses(form: LinearForm, outputs: Outputs) -> Iterator[Loss]:
    """The losses of the form, largest first: the part of each effect that no values of the form describe."""
    simulated = outputs.simulated
    powers = _powers(outputs, form.degree, form.t0)
    result = []
    for name, part in simulated.parts.items():
        if name in ALWAYS or (name in GAINS and form.kind != OFFSETS):
            continue
        gain = outputs.a if name in GAINS else 0.0
        remaining = (outputs.factor * part - gain) @ form.matrix.T
        for i in range(3):
            form_columns = {OFFSETS: [], DIAGONAL: [outputs.a[:, i]]}.get(form.kind, [*outputs.a.T])
            basis = np.column_stack([*form_columns, powers])
            remaining[:, i] -= basis @ _solve(basis, remaining[:, i])
        rms, most = _size(remaining / outputs.per)
        if most > NEGLIGIBLE * np.abs(simulated.a).max():
            result.append(Loss(name, CANNOT[form.kind], rms, most, simulated.unit))
    yield from sorted(result, key=lambda loss: -(loss.rms or 0.0))
    yield from simulated.lost


def export_form(
    outputs: Outputs,
    form: LinearForm,
    text: str = "",
    notes: tuple[str, ...] = (),
    ignored: Sequence[Loss] = (),
    held_effects: Collection[str] = (),
) -> ExportedFile:
    """The part of a file on one sensor: errors and losses of its form. `held_effects`: those in its other parts."""
    unit = outputs.simulated.unit
    form_losses = (loss for loss in losses(form, outputs) if loss.effect not in held_effects)
    return ExportedFile(text, (*form_losses, *ignored), notes, ((SENSOR[unit], *error_of(form, outputs), unit),))


def _size(error: Array) -> tuple[float, float]:
    return float(np.sqrt(np.mean(error**2, axis=0)).max()), float(np.abs(error).max())


def _powers(outputs: Outputs, degree: int, t0: float) -> Array:
    """1, d, d^2 ... of d = t - t0, shape (n, degree + 1)."""
    t = outputs.simulated.temperature_c
    d = np.zeros(len(outputs.x)) if t is None else t - t0
    return np.column_stack([d**k for k in range(degree + 1)])


def _solve(basis: Array, values: Array) -> Array:
    """Least squares with columns of like size."""
    sizes = np.maximum(np.abs(basis).max(axis=0), 1e-300)
    solution = np.linalg.lstsq(basis / sizes, values, rcond=None)[0]
    return np.asarray((solution.T / sizes).T)
