"""A calibrated model turned round: a program from outputs to specific force, with what is proved and what it costs."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from calibrations.compensation.bound import Bound, bound
from calibrations.compensation.cost import Cost, costs
from calibrations.compensation.forward import FORCES, INVERTED, NOTHING, Forward, at_run_time, forward_of, input_unit
from calibrations.compensation.graph import names
from calibrations.compensation.program import Program, program
from calibrations.errors import ModelError
from calibrations.model import Model

REACH = {"g": 1.5, "field": 1.5, "deg/s": 300.0}  # of what is sensed, to either side, where nothing else is said
BESIDE = {"temperature_c": (-20.0, 85.0), "supply_v": (4.75, 5.25), "t_s": (0.0, 1e7)}  # C, V, s
WITHIN = {"double": 1e-12, "float": 1e-7}  # of the reach: what is left when the steps end


@dataclass(frozen=True)
class Range:
    """For which values the bound is proved: `reach` to either side of 0 on every axis, and what is given beside."""

    reach: float
    beside: Mapping[str, tuple[float, float]] = field(default_factory=lambda: dict(BESIDE))

    @staticmethod
    def for_model(model: Model, reach: float | None = None, **beside: tuple[float, float]) -> Range:
        """What is usual for the model's kind of sensor, but where `reach` or a range by an input's name is given."""
        at = {name: value for term in model.terms for name, value in term.constants.items()}
        supply = {"supply_v": (0.95 * at["reference_v"], 1.05 * at["reference_v"])} if "reference_v" in at else {}
        return Range(reach or REACH[input_unit(model)], BESIDE | supply | beside)

    def of(self, inputs: Collection[str]) -> dict[str, tuple[float, float]]:
        """The range of each input beside the outputs; another axis' force goes as far as the sensor's own.

        Raises ModelError for one whose range nobody said.
        """
        known = dict.fromkeys(FORCES, (-self.reach, self.reach)) | dict(self.beside)
        for name in inputs:
            if name not in known:
                raise ModelError(f"the model follows {name}, whose range is not known; give --input {name}=LOW:HIGH")
        return {name: known[name] for name in inputs}


@dataclass(frozen=True)
class Compensation:
    """Everything that the writers need. `costs` are in the unit of what is sensed."""

    model: Model
    forward: Forward
    range: Range
    bound: Bound
    program: Program
    precision: str
    unit: str
    costs: Cost

    @property
    def beside(self) -> dict[str, tuple[float, float]]:
        """The inputs beside the outputs, and their ranges."""
        return self.range.of(self.program.inputs[len(self.forward.axes) :])


def invert(
    model: Model, within: Range | None = None, without: Collection[str] = (), precision: str = "double"
) -> Compensation:
    """The compensation of a fitted model for the range `within`, the effects in `without` left out.

    Raises ModelError for a model without values, and for one that cannot be shown to be invertible over the range,
    naming the effect that stands in the way.
    """
    unknown = [name for name in without if name not in model.effects]
    if unknown:
        raise ModelError(f"{model.name}: has no effect {unknown[0]} to leave out; it has {', '.join(model.effects)}")
    if all(at_run_time(term.effect) == NOTHING for term in model.terms):
        raise ModelError(
            f"{model.name}: is a model of noise alone, which has no inverse to write: give one of a sensor"
        )
    unit = input_unit(model)
    within = within or Range.for_model(model)
    forward = forward_of(model, without)
    found = _bound(forward, within, precision)
    if found is None:
        raise ModelError(_why_not(model, within, without, precision, unit))
    made = program(forward, found)
    return Compensation(
        model,
        forward,
        within,
        found,
        made,
        precision,
        unit,
        costs(model, forward, made, within.reach, unit, within.beside),
    )


def _bound(forward: Forward, within: Range, precision: str) -> Bound | None:
    others = within.of([name for name in names(forward.outputs) if name not in {*forward.sought, *forward.memory}])
    want = WITHIN[precision] * within.reach
    return bound(forward.outputs, forward.sought, within.reach, others, want, tuple(forward.memory))


def _why_not(model: Model, within: Range, without: Collection[str], precision: str, unit: str) -> str:
    """Which single effect stands in the way of an inverse, where it is one."""
    inverted = [fate.effect for fate in forward_of(model, without).fates if fate.how == INVERTED]
    guilty = [n for n in inverted if _bound(forward_of(model, [*without, n]), within, precision) is not None]
    said = (
        f"{model.name}: the way back is not contractive within +-{within.reach:g} {unit}: no number of steps can be "
        "proved to be enough"
    )
    if guilty:
        return f"{said}. Without {guilty[-1]} it is: --leave-out {guilty[-1]} leaves it out, and says what that costs"
    return f"{said}; take a smaller --range, or leave out what bends the output most with --leave-out EFFECT"
