"""A model's way from specific force to output, as a graph of each output; and what becomes of each of its effects.

inverted    the effect acts on force, transduction or output, and its function can be written down; one that follows a
            history does so by what it remembers from one sample to the next
of the rig  it acts on the pose alone: the stages' errors are not the sensor's, and drop out
noise       it has no value that could be taken off
left out    it says itself why a product cannot follow it, its function cannot be written down, or it was asked for
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calibrations.chain import Step
from calibrations.compensation.graph import Node, given, names
from calibrations.compensation.inputs import can_be_written
from calibrations.compensation.traced import NotTraced, RunTime, Traced, nodes_traced
from calibrations.compensation.written import added
from calibrations.effect import Effect
from calibrations.errors import ModelError
from calibrations.model import Model, Term
from calibrations.table import AXES, NUMBERS

INVERTED, OF_THE_RIG, NOISE, LEFT_OUT = "inverted", "of the rig", "noise", "left out"
NOTHING = "nothing: noise cannot be taken off"
KNOWN = ("temperature_c", "supply_v", "t_s")  # what a product may know beside the outputs
FORCES = ("ax", "ay", "az")


@dataclass(frozen=True)
class Fate:
    """What becomes of an effect: one of the four, and why where it is left out."""

    effect: str
    how: str
    why: str = ""


@dataclass(frozen=True)
class Forward:
    """Outputs of the measured `axes` as graphs of ax, ay, az (those along `axes` are sought) and of what is given.

    `memory`: what is remembered from one sample to the next, by name, as a graph of what it is after a sample.
    """

    model: Model
    axes: tuple[str, ...]
    outputs: tuple[Node, ...]
    fates: tuple[Fate, ...]
    memory: Mapping[str, Node] = field(default_factory=dict)

    @property
    def remembering(self) -> tuple[str, ...]:
        """The effects that follow a history."""
        inverted = {fate.effect for fate in self.fates if fate.how == INVERTED}
        return tuple(t.name for t in self.model.terms if t.effect.follow is not None and t.name in inverted)

    @property
    def left_out(self) -> tuple[str, ...]:
        return tuple(fate.effect for fate in self.fates if fate.how == LEFT_OUT)

    @property
    def sought(self) -> tuple[str, ...]:
        """Names of what is sought, as the graphs have them."""
        return tuple(f"a{axis}" for axis in self.axes)


def measured_axes(model: Model) -> tuple[str, ...]:
    """The axes that the model has values for; all three where one value serves all.

    Raises ModelError for a model without values.
    """
    named = {e.axis for term in model.terms for e in term.estimates}
    if empty := [term.name for term in model.terms if not term.estimates]:
        what = f"{empty[0]} has no value" if named else "has no values"
        raise ModelError(f"{model.name}: {what} yet; `rig fit DATA --model {model.name} --out FILE` gives it some")
    found = tuple(axis for axis in AXES if axis in named)
    return found or AXES


def steps_of(model: Model) -> list[Step]:
    """Effects with the values that the model has, as the signal chain takes them."""
    return [(term.effect, _values(term)) for term in model.terms]


def input_unit(model: Model) -> str:
    """Unit of what is sensed: g, the field's strength, or deg/s."""
    kinds = {kind for term in model.terms for kind in term.effect.kinds if len(term.effect.kinds) == 1}
    return {"fields": "field", "rates": "deg/s"}.get(next(iter(kinds), ""), "g") if len(kinds) == 1 else "g"


def at_run_time(effect: Effect) -> str:
    """What a compensation does about an effect, as far as its file tells."""
    if effect.left_out:
        return f"left out: {effect.left_out}"
    if effect.follow is not None:
        return f"inverted, sample after sample, with {effect.memory} numbers for each axis remembered between them"
    if effect.force or effect.transduction or effect.output:
        return "inverted"
    return "dropped: it is the rig's" if effect.pose else NOTHING


def forward_of(model: Model, without: Collection[str] = ()) -> Forward:
    """The graphs of a fitted model; the effects in `without` are left out."""
    axes, steps = measured_axes(model), steps_of(model)
    own = {name for effect, _ in steps for name in effect.needs if name not in NUMBERS and can_be_written(name)}
    table = RunTime(axes, {name: name for name in (*KNOWN, *sorted(own))})
    fates = [_fate(step, table, without) for step in steps]
    taken = [step for step, fate in zip(steps, fates, strict=True) if fate.how == INVERTED]
    whole, after = _outputs(taken, table)
    outputs = tuple(whole.nodes[0, : len(axes)])
    return Forward(model, axes, outputs, tuple(fates), _used(outputs, after))


def _values(term: Term) -> dict[str, Any]:
    """Constants and parameters by name, a parameter per axis of shape (3,); 0 where there is none."""
    if missing := [name for name in term.effect.constants if name not in term.constants]:
        raise ModelError(f"{term.name}: the constant {missing[0]} is missing; `rig fit` writes it into the model file")
    values: dict[str, Any] = {name: np.asarray(value) for name, value in term.constants.items()}
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
        return Fate(effect.name, LEFT_OUT, "that was asked for")
    if effect.left_out:
        return Fate(effect.name, LEFT_OUT, effect.left_out)
    if not (effect.force or effect.transduction or effect.output):
        return Fate(effect.name, OF_THE_RIG if effect.pose else NOISE)
    try:
        _outputs([step], table)
    except NotTraced as error:
        return Fate(effect.name, LEFT_OUT, str(error))
    except ModelError as error:  # of a user's own file, whose faults are told as theirs
        return Fate(effect.name, LEFT_OUT, str(error.__cause__ or error))
    return Fate(effect.name, INVERTED)


def _used(outputs: Sequence[Node], after: Mapping[str, Node]) -> dict[str, Node]:
    """Of what is remembered, that which the outputs follow, be it by way of what is remembered later."""
    found: dict[str, Node] = {}
    while new := {name for name in names([*outputs, *found.values()]) if name in after} - found.keys():
        found |= {name: after[name] for name in sorted(new)}
    return {name: found[name] for name in after if name in found}


def _outputs(steps: Sequence[Step], runtime: RunTime) -> tuple[Traced, dict[str, Node]]:
    """Outputs of all three axes, shape (1, 3), and what is remembered after the sample, by name.

    The signal chain of `calibrations.chain`, without its poses.
    """
    table: Any = runtime
    a: Any = Traced([[given(name) for name in FORCES]])
    for effect, p in steps:
        if effect.force is not None:
            a = effect.force(a, table, p)
    v: Any = nodes_traced(np.zeros((1, 3)))
    memory: dict[str, Node] = {}
    for effect, p in steps:
        if effect.follow is not None:
            known = [[f"m{len(memory) // 3 + k}{axis}" for axis in AXES] for k in range(effect.memory)]
            part, after = effect.follow(a, table, p, [Traced([[given(name) for name in row]]) for row in known])
            for row, each in zip(known, after, strict=True):
                memory |= dict(zip(row, nodes_traced(each).nodes[0], strict=True))
            v = v + part
        elif effect.transduction is not None:
            v = v + (added(effect, a, table, p) if effect.expression else effect.transduction(a, table, p))
    for effect, p in steps:
        if effect.output is not None:
            v = effect.output(v, table, p)
    return nodes_traced(v), memory
