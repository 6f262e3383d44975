"""A model from specific force to output as a graph for each output, and the treatment of each effect.

inverted    the effect acts on force, transduction or output and can be traced; an effect with a history stores its
            state between samples
of the rig  the effect acts on the pose alone: it belongs to the stages and is dropped
noise       the effect has no value to subtract
left out    the effect declares it, cannot be traced, or the user asked for it
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from keyword import iskeyword
from typing import Any

import numpy as np

from calibrations.compensation.graph import Node, variable, variable_names
from calibrations.compensation.tables import trace_free_form
from calibrations.compensation.trace import NodeArray, NotTraced, RunTime, as_traced, trace_expression
from calibrations.effects import Effect, Values
from calibrations.effects.logged import RATE
from calibrations.errors import ModelError
from calibrations.free_forms.effect import FreeForm
from calibrations.model import Model, Term
from calibrations.model.chain import Stage, Step, add_response, output_order, stage_contribution, stage_of
from calibrations.table import AXES, NUMBERS
from calibrations.tables import KINDS

# Names that an input may have in every output language: a user's column may have any name.

IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
RESERVED = re.compile(
    r"t\d+|table\d+|in|out|step|math|memory|a[xyz]|v[xyz]|m\d+[xyz]"  # of the sources themselves
    r"|auto|case|char|const|default|do|double|enum|extern|float|goto|inline|int|long|register|restrict|short|signed"
    r"|sizeof|static|struct|switch|typedef|union|unsigned|void|volatile"  # of C
    r"|abs|min|max|fabs|sqrt|exp|log|sin|cos|tanh"  # functions
)


def can_be_written(name: str) -> bool:
    """Whether an input of that name is possible in every language."""
    return bool(IDENTIFIER.fullmatch(name)) and not iskeyword(name) and not RESERVED.fullmatch(name)


INVERTED, OF_THE_RIG, NOISE, LEFT_OUT = "inverted", "of the rig", "noise", "left out"
NOTHING = "nothing: noise cannot be compensated"
FURTHER_INPUTS = ("temperature_c", "supply_v", "t_s", RATE)  # inputs that a product may have besides the outputs
FORCES = ("ax", "ay", "az")


@dataclass(frozen=True)
class Fate:
    """The treatment of an effect, and the reason for leaving it out."""

    effect: str
    how: str
    why: str = ""


@dataclass(frozen=True)
class Forward:
    """Outputs of the measured `axes` as graphs of ax, ay, az (`sought`: those along `axes`) and other inputs.

    `memory`: values stored between samples, by name, as graphs of their value after a sample.
    """

    model: Model
    axes: tuple[str, ...]
    outputs: tuple[Node, ...]
    fates: tuple[Fate, ...]
    memory: Mapping[str, Node] = field(default_factory=dict)

    @property
    def remembering(self) -> tuple[str, ...]:
        """The effects with a history."""
        inverted = {fate.effect for fate in self.fates if fate.how == INVERTED}
        return tuple(t.name for t in self.model.terms if t.effect.memory and t.name in inverted)

    @property
    def left_out(self) -> tuple[str, ...]:
        return tuple(fate.effect for fate in self.fates if fate.how == LEFT_OUT)

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of the sought quantities in the graphs."""
        return tuple(f"a{axis}" for axis in self.axes)


def measured_axes(model: Model) -> tuple[str, ...]:
    """The axes that the model has values for; all three where one value serves all.

    Raises ModelError for a model without values.
    """
    axes_named = {e.axis for e in model.params.values()}
    if without_values := [term.name for term in model.terms if not term.estimates]:
        reason = f"{without_values[0]} has no value" if axes_named else "has no values"
        raise ModelError(f"{model.name}: {reason} yet; `rig fit DATA --model {model.name} --out FILE` gives it some")
    axes = tuple(axis for axis in AXES if axis in axes_named)
    return axes or AXES


def steps_of(model: Model) -> list[Step]:
    """Effects with the model's values, as the signal chain takes them."""
    return [(term.effect, _values(term)) for term in model.terms]


def input_unit(model: Model) -> str:
    """Unit of the sensed quantity: g, the field's strength, or deg/s."""
    units_by_term = [{KINDS[kind].input_unit for kind in term.effect.kinds} for term in model.terms]
    units = {unit for units in units_by_term for unit in units if len(units) == 1}
    return units.pop() if len(units) == 1 else "g"


def known_at_run_time(effect: Effect) -> str:
    """The treatment of an effect in a compensation, from its declaration."""
    if effect.left_out:
        return f"left out: {effect.left_out}"
    if effect.memory:
        return f"inverted sample by sample; {effect.memory} numbers per axis are stored between samples"
    if effect.places & {"force", "transduction", "output"}:
        return "inverted"
    return "dropped: it belongs to the rig, not to the sensor" if "pose" in effect.places else NOTHING


def trace_model(model: Model, without: Collection[str] = ()) -> Forward:
    """The graphs of a fitted model; the effects in `without` are left out."""
    axes, steps = measured_axes(model), steps_of(model)
    own_columns = {name for effect, _ in steps for name in effect.needs if name not in NUMBERS and can_be_written(name)}
    table = RunTime(axes, {name: name for name in (*FURTHER_INPUTS, *sorted(own_columns))})
    fates = [_fate(step, table, without) for step in steps]
    inverted = [step for step, fate in zip(steps, fates, strict=True) if fate.how == INVERTED]
    traced, memories = _outputs(inverted, table)
    outputs = tuple(traced.nodes[0, : len(axes)])
    return Forward(model, axes, outputs, tuple(fates), _select_used_values(outputs, memories))


def _values(term: Term) -> Values:
    """Constants and parameters by name, a parameter per axis of shape (3,); 0 without a value."""
    constants = term.known_constants
    if missing := [name for name in term.effect.constants if name not in constants]:
        raise ModelError(f"{term.name}: the constant {missing[0]} is missing; `rig fit` writes it into the model file")
    values = Values.of(constants)
    values |= {p.name: np.zeros(3 if p.per_axis else ()) for p in term.effect.parameters}
    for e in term.estimates:
        if not e.axis:
            values[e.name] = np.full_like(values[e.name], e.value)
        else:
            values[e.name][AXES.index(e.axis)] = e.value
    return values


def _fate(step: Step, table: RunTime, without: Collection[str]) -> Fate:
    effect, _ = step
    if effect.name in without:
        return Fate(effect.name, LEFT_OUT, "the user asked for it")
    if effect.left_out:
        return Fate(effect.name, LEFT_OUT, effect.left_out)
    if not effect.places & {"force", "transduction", "output"}:
        return Fate(effect.name, OF_THE_RIG if "pose" in effect.places else NOISE)
    try:
        _outputs([step], table)
    except NotTraced as error:
        return Fate(effect.name, LEFT_OUT, str(error))
    except ModelError as error:  # an error in a user's own file
        return Fate(effect.name, LEFT_OUT, str(error.__cause__ or error))
    return Fate(effect.name, INVERTED)


def _select_used_values(outputs: Sequence[Node], memories: Mapping[str, Node]) -> dict[str, Node]:
    """The stored values that the outputs use, directly or through other stored values."""
    stored: dict[str, Node] = {}
    while new := {name for name in variable_names([*outputs, *stored.values()]) if name in memories} - stored.keys():
        stored |= {name: memories[name] for name in sorted(new)}
    return {name: stored[name] for name in memories if name in stored}


def _outputs(steps: Sequence[Step], runtime: RunTime) -> tuple[NodeArray, dict[str, Node]]:
    """Outputs of all three axes, shape (1, 3), and the values stored after the sample, by name.

    The signal chain of `calibrations.model.chain`, without its poses.
    """
    table: Any = runtime
    a: Any = NodeArray([[variable(name) for name in FORCES]])
    for effect, p in steps:
        a = effect.force(a, table, p)
    v, of_force, memory = _response_to_force(a, steps, table)
    force = add_response(a, of_force, steps) if any(effect.of_force and not effect.scales for effect, _ in steps) else a
    v = _scale(a, force, v, steps, table)
    for effect, p in output_order(steps):
        if isinstance(effect, FreeForm) and "output" in effect.places:
            v = v + trace_free_form(effect, a, v, table, p)
        else:
            v = effect.output(v, table, p)
    return as_traced(v), memory


def _response_to_force(a: Any, steps: Sequence[Step], table: Any) -> tuple[Any, Any, dict[str, Node]]:
    """Outputs of the effects that do not scale, the part that acts like a force, and the stored values by name."""
    v: Any = as_traced(np.zeros((1, 3)))
    of_force: Any = as_traced(np.zeros((1, 3)))
    memory: dict[str, Node] = {}
    for effect, p in steps:
        before_v = v
        if effect.memory:
            part, stored = _follow(a, (effect, p), table, len(memory) // 3)
            memory |= stored
            v = v + part
        elif "transduction" in effect.places and not effect.scales:
            v = v + _response(effect, a, table, p)
        if effect.of_force:
            of_force = of_force + (v - before_v)
    return v, of_force, memory


def _follow(a: Any, step: Step, table: Any, first_slot: int) -> tuple[Any, dict[str, Node]]:
    """Output of an effect with a history, and its stored values by name. Their numbers begin at `first_slot`."""
    effect, p = step
    slots = [[f"m{first_slot + k}{axis}" for axis in AXES] for k in range(effect.memory)]
    slots_before: Any = [NodeArray([[variable(name) for name in row]]) for row in slots]
    part, slots_after = effect.follow(a, table, p, slots_before)
    stored: dict[str, Node] = {}
    for row, values in zip(slots, slots_after, strict=True):
        stored |= dict(zip(row, as_traced(values).nodes[0], strict=True))
    return part, stored


def _scale(a: Any, force: Any, v: Any, steps: Sequence[Step], table: Any) -> Any:
    """The outputs `v` with the effects that scale the response, stage by stage."""
    for stage in (Stage.SCALE, Stage.DRIFT):
        response = force
        for effect, p in steps:
            if stage_of(effect) == stage:
                part = stage_contribution(stage, partial(_response, effect, table=table, p=p), a, response)
                v = v + part
                force = add_response(force, part, steps) if effect.of_force else force
    return v


def _response(effect: Effect, a: Any, table: Any, p: Values) -> NodeArray:
    """Contribution of an effect to the outputs, shape (1, 3)."""
    if effect.expression:
        return trace_expression(effect, a, table, p)
    if isinstance(effect, FreeForm):
        return trace_free_form(effect, a, NodeArray(as_traced(np.zeros((1, 3))).nodes), table, p)
    return as_traced(effect.transduction(a, table, p))
