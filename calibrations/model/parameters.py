"""The parameters of a model as one vector: the parameter of each entry, and the named values of a vector."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from calibrations.effects import Parameter, Values
from calibrations.geometry.orientation import one_orientation
from calibrations.geometry.rate_table import rate_scales
from calibrations.geometry.sphere import sphere_radius
from calibrations.model import Model, Term
from calibrations.model.chain import Step
from calibrations.table import AXES, Array, Table


@dataclass(frozen=True)
class Slot:
    """One entry of the vector. `axis` is "" for a parameter that has none."""

    term: int
    parameter: Parameter
    axis: str


@dataclass(frozen=True)
class Layout:
    """The index of each parameter of `model` in the vector, for the axes of a table."""

    model: Model
    axes: tuple[str, ...]
    slots: tuple[Slot, ...]
    unit: str
    nominal: float  # output per g, field or deg/s, to give parameters in the output's unit a size
    from_data: Mapping[tuple[int, str, str], tuple[float, ...]]  # starts that effects take from the table

    @staticmethod
    def of(model: Model, table: Table) -> Layout:
        """The layout for `table`."""
        slots = tuple(slot for i, term in enumerate(model.terms) for slot in _slots(i, term, table))
        return Layout(model, table.axes, slots, table.unit, _nominal(table), _starts_from_data(model, table))

    @cached_property
    def typical(self) -> Array:
        """Typical magnitude of each entry, in its own unit, shape (p,)."""
        sizes = np.array([self._size(s.parameter) * s.parameter.typical * self._scale(s) for s in self.slots])
        return np.where(self.free, sizes, self.prior)

    @cached_property
    def prior(self) -> Array:
        """Standard deviation of each entry's Gaussian prior, shape (p,); inf where it has none."""
        return np.array([s.parameter.prior[s.axis] if s.parameter.prior else np.inf for s in self.slots])

    @property
    def free(self) -> NDArray[np.bool_]:
        """Mask of the entries without a prior, shape (p,)."""
        return ~np.isfinite(self.prior)

    @cached_property
    def prior_rows(self) -> Array:
        """The priors as whitened rows of a jacobian, shape (entries with a prior, p)."""
        return np.asarray(np.diag(1 / self.prior)[~self.free])

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest value of each entry."""
        return (
            np.array([s.parameter.low for s in self.slots]),
            np.array([s.parameter.high for s in self.slots]),
        )

    def _scale(self, slot: Slot) -> float:
        return self.model.terms[slot.term].constants.get(slot.parameter.scale, 1.0)

    def _size(self, parameter: Parameter) -> float:
        return self.nominal if "{out}" in parameter.unit else 1.0

    def starts(self) -> list[Array]:
        """Vectors to start from: the model's values, and every combination of declared starts where it has none."""
        values = self._known_values()
        choices = [(values[k],) if k in values else self._declared_values(s) for k, s in enumerate(self.slots)]
        return self._shared_choices(choices)

    def _declared_values(self, slot: Slot) -> tuple[float, ...]:
        key = (slot.term, slot.parameter.name, slot.axis)
        if key in self.from_data:
            return self.from_data[key]
        return tuple(value * self._size(slot.parameter) for value in slot.parameter.starts)

    def _shared_choices(self, choices: Sequence[tuple[float, ...]]) -> list[Array]:
        """One choice for all axes of a parameter, not one for each."""
        groups: dict[tuple[int, str], list[int]] = {}
        for k, s in enumerate(self.slots):
            groups.setdefault((s.term, s.parameter.name), []).append(k)
        vectors = []
        lengths = [range(max(len(choices[k]) for k in members)) for members in groups.values()]
        for picks in product(*lengths):
            vector = np.empty(len(self.slots))
            for pick, members in zip(picks, groups.values(), strict=True):
                for k in members:
                    vector[k] = choices[k][min(pick, len(choices[k]) - 1)]
            vectors.append(np.clip(vector, *self.bounds))
        return vectors

    def _known_values(self) -> dict[int, float]:
        values = {(i, e.name, e.axis): e.value for i, term in enumerate(self.model.terms) for e in term.estimates}
        keys = [(s.term, s.parameter.name, s.axis) for s in self.slots]
        return {k: values[key] for k, key in enumerate(keys) if key in values}

    def known(self) -> Array | None:
        """The model's own values, or None where one is missing."""
        assumed = {k: slot.parameter.assumed for k, slot in enumerate(self.slots)}
        values = {k: value for k, value in assumed.items() if value is not None} | self._known_values()
        return np.array([values[k] for k in range(len(self.slots))]) if len(values) == len(self.slots) else None

    def steps(self, theta: Array) -> list[Step]:
        """Effects with their named values, in the order of the signal chain."""
        return [(term.effect, self.values(i, theta)) for i, term in enumerate(self.model.terms)]

    def values(self, i: int, theta: Array) -> Values:
        """The named values of one of the model's terms."""
        term = self.model.terms[i]
        values = Values.of(term.constants)
        values |= {p.name: np.zeros(3 if p.per_axis else ()) for p in term.effect.parameters}
        for k in self._entries[i]:
            self._enter(values, k, theta[k])
        return values

    def values_with(self, values: Values, k: int, value: float) -> Values:
        """The named values of a term with another one for its entry `k`."""
        name = self.slots[k].parameter.name
        changed = Values({**values, name: values[name].copy()})
        self._enter(changed, k, value)
        return changed

    def _enter(self, values: Values, k: int, value: float) -> None:
        parameter, axis = self.slots[k].parameter, self.slots[k].axis
        if not parameter.per_axis:
            values[parameter.name] = np.asarray(value)
        elif axis:
            values[parameter.name][AXES.index(axis)] = value
        else:
            values[parameter.name] = np.full(3, value)

    @cached_property
    def _entries(self) -> list[list[int]]:
        """The entries of each term."""
        return [[k for k, slot in enumerate(self.slots) if slot.term == i] for i in range(len(self.model.terms))]

    def of_effect(self, name: str) -> NDArray[np.bool_]:
        """Mask of the entries that belong to one effect, shape (p,)."""
        return np.array([self.model.terms[s.term].name == name for s in self.slots], dtype=bool)


def _starts_from_data(model: Model, table: Table) -> dict[tuple[int, str, str], tuple[float, ...]]:
    """Starts that effects take from the table, by term, parameter and axis; the mean of all axes for none."""
    starts: dict[tuple[int, str, str], tuple[float, ...]] = {}
    for i, term in enumerate(model.terms):
        for p in term.effect.parameters:
            if p.guess is None:
                continue
            values = np.atleast_2d(p.guess(table))  # (starts, axes)
            starts |= {(i, p.name, axis): tuple(map(float, v)) for axis, v in zip(table.axes, values.T, strict=True)}
            starts[i, p.name, ""] = tuple(map(float, values.mean(axis=1)))
    return starts


@lru_cache(maxsize=8)
def _nominal(table: Table) -> float:
    """Output per unit of the sensed quantity, by the range of outputs; 1 if all outputs are equal."""
    if table.type.turning:
        return float(np.max(np.abs(rate_scales(table)))) or 1.0
    if table.type.field:
        return sphere_radius(table)
    spread = 0.0 if one_orientation(table) else float(np.median(np.ptp(table.outputs, axis=0))) / 2
    return abs(table.number("output_per_g", spread or 1.0))


def _exists(constant: str, term: Term) -> bool:
    """Whether a parameter exists: not if the constant `where` is 0."""
    return bool(term.constants.get(constant, 1.0))


def _slots(i: int, term: Term, table: Table) -> list[Slot]:
    slots = []
    for declared in term.effect.parameters:
        p = replace(declared, high=min(declared.high, declared.most(table))) if declared.most else declared
        if (p.measured and p.measured not in table.axes) or not _exists(p.where, term):
            continue
        axes = table.axes if p.per_axis and not term.tied else ("",)
        if p.prior is not None:
            axes = tuple(axis for axis in axes if axis in p.prior)
        slots += [Slot(i, p, axis) for axis in axes if _exists(f"{p.where}_{axis}", term)]
    return slots
