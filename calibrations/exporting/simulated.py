"""Outputs of a calibrated model over the range of its data, to which the format of another program is fitted."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from calibrations.compensation.document import error_text
from calibrations.compensation.forward import FORCES, INVERTED, LEFT_OUT, trace_model
from calibrations.compensation.graph import evaluate_nodes, variable_names
from calibrations.compensation.inverse import Compensation, Range, invert_model
from calibrations.effects.logged import RATE
from calibrations.errors import ModelError
from calibrations.model import Model
from calibrations.table import AXES, STANDARD_GRAVITY, Array

DIRECTIONS = 300  # of the input, spread evenly over the sphere
LEVELS = {"temperature_c": 13}  # of an input over its range
OTHER_LEVELS = 3
REACH = {"g": 1.0, "field": 1.0, "deg/s": 300.0}  # default size of the input: gravity, the field, a turn by hand
HISTORY = "its inverse needs earlier samples"


@dataclass(frozen=True)
class Loss:
    """The error that an effect causes because a format cannot hold it, of the worst axis; None where unknown."""

    effect: str
    why: str
    rms: float | None
    most: float | None
    unit: str

    @property
    def text(self) -> str:
        """The loss in words."""
        if self.rms is None or self.most is None:
            return f"Not in the file: {self.effect}: {self.why}; error unknown."
        rms, most = error_text(self.rms, self.unit), error_text(self.most, self.unit)
        return f"Not in the file: {self.effect}: {self.why}; error {rms} rms, {most} at most."


@dataclass(frozen=True)
class ExportedFile:
    """The text of a file. `error`: rms and largest error of its outputs against the whole model, in `unit`."""

    text: str
    losses: tuple[Loss, ...] = ()
    notes: tuple[str, ...] = ()
    errors: tuple[tuple[str, float, float, str], ...] = ()  # sensor, rms, largest, unit

    @staticmethod
    def of_parts(text: str, parts: Sequence[ExportedFile], notes: Sequence[str] = ()) -> ExportedFile:
        """A file that holds several sensors."""
        return ExportedFile(
            text,
            tuple(loss for part in parts for loss in part.losses),
            (*notes, *(note for part in parts for note in part.notes)),
            tuple(error for part in parts for error in part.errors),
        )


@dataclass(frozen=True, eq=False)
class SimulatedSensor:
    """Outputs `v` in the model's unit for inputs `a` in `unit`, shape (n, 3) each.

    `parts`: what the outputs change by if an effect is removed, (n, 3), by effect. `lost`: effects that no file of
    numbers can hold, with the error.
    """

    model: Model
    unit: str
    a: Array
    v: Array
    spans: Mapping[str, tuple[float, float]]
    temperature_c: Array | None
    parts: Mapping[str, Array] = field(default_factory=dict)
    lost: tuple[Loss, ...] = ()

    @property
    def gravity_m_s2(self) -> float:
        """Local gravity of the calibration."""
        return gravity_of(self.model)


def gravity_of(model: Model) -> float:
    """Local gravity of a model's calibration, m/s^2; standard gravity where the model file does not give it."""
    gravity = model.provenance.get("gravity_m_s2")
    return float(gravity) if isinstance(gravity, (int, float)) else STANDARD_GRAVITY


def simulate(
    model: Model, reach: float | None = None, spans: Mapping[str, tuple[float, float]] | None = None
) -> SimulatedSensor:
    """The outputs of a model of three axes for inputs of size `reach` from all directions, at all levels of the others.

    `spans`: ranges of other inputs, such as temperature_c; default: those that the data of the calibration covered.
    Raises ModelError for a model without values, with fewer axes, without an inverse, or with an unknown range.
    """
    remembering = tuple(term.name for term in model.terms if term.effect.memory)
    forward = trace_model(model, remembering)
    if forward.axes != AXES:
        raise ModelError(
            f"{model.name}: has the axes {', '.join(forward.axes)}; these formats hold three axes. Use `rig compensate`"
        )
    compensation = invert_model(model, Range.for_model(model), remembering)
    reach = reach or REACH[compensation.unit]
    inputs = [name for name in variable_names(forward.outputs) if name not in FORCES]
    ranges = {name: _span(model, name, spans or {}) for name in inputs}
    a, other_inputs = _grid(reach, ranges)
    input_values = {**dict(zip(FORCES, a.T, strict=True)), **other_inputs}
    outputs = _outputs(model, remembering, input_values, len(a))
    inverted = [f.effect for f in forward.fates if f.how == INVERTED]
    parts = {name: outputs - _outputs(model, (*remembering, name), input_values, len(a)) for name in inverted}
    lost = tuple(_losses(compensation, remembering))
    return SimulatedSensor(model, compensation.unit, a, outputs, ranges, other_inputs.get("temperature_c"), parts, lost)


def _losses(compensation: Compensation, remembering: Collection[str]) -> Iterator[Loss]:
    """The effects that the inverse leaves out, with the error of each."""
    for fate in compensation.forward.fates:
        if fate.how == LEFT_OUT:
            size = compensation.costs.left_out.get(fate.effect)
            reason = HISTORY if fate.effect in remembering else fate.why
            rms, most = (size.rms, size.most) if size else (None, None)
            yield Loss(fate.effect, reason, rms, most, compensation.unit)


def _span(model: Model, name: str, spans: Mapping[str, tuple[float, float]]) -> tuple[float, float]:
    if name == RATE:
        return 0.0, 0.0
    if name in spans:
        return spans[name]
    if name in model.covered:
        return model.covered[name]
    raise ModelError(
        f"{model.name}: follows {name}, and the model file does not give the range of its calibration; "
        f"give --input {name}=LOW:HIGH"
    )


def _grid(reach: float, ranges: Mapping[str, tuple[float, float]]) -> tuple[Array, dict[str, Array]]:
    """Every direction at every combination of levels: inputs (n, 3), and the others by name, (n,)."""
    k = np.arange(DIRECTIONS)
    z, turn = 1 - (2 * k + 1) / DIRECTIONS, k * np.pi * (3 - np.sqrt(5))  # Fibonacci's lattice on the sphere
    flat = np.sqrt(1 - z**2)
    sphere = reach * np.column_stack([flat * np.cos(turn), flat * np.sin(turn), z])
    sphere = np.vstack([sphere, reach * np.eye(3), -reach * np.eye(3)])
    levels = [_levels(name, span) for name, span in ranges.items()]
    corners = np.array(list(product(*levels)), dtype=float)  # one row without columns if there is no other input
    a = np.tile(sphere, (len(corners), 1))
    other_values = np.repeat(corners, len(sphere), axis=0)
    return a, dict(zip(ranges, other_values.T, strict=True))


def _levels(name: str, span: tuple[float, float]) -> Sequence[float]:
    count = LEVELS.get(name, OTHER_LEVELS)
    return [span[0]] if span[0] == span[1] else np.linspace(*span, count).tolist()


def _outputs(model: Model, left_out: Sequence[str], inputs: Mapping[str, Array], n: int) -> Array:
    forward = trace_model(model, left_out)
    return np.column_stack([np.broadcast_to(v, n) for v in evaluate_nodes(forward.outputs, inputs)])
