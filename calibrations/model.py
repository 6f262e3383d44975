"""A model: an ordered list of effects, with the values, uncertainties and provenance of their parameters.

A model is a frozen value. Fitting or adding an effect makes a new one; the old one stays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from calibrations.effect import Effect
from calibrations.table import Table


@dataclass(frozen=True)
class Estimate:
    """One parameter's value and standard uncertainty (GUM), in `unit`. `axis` is "" if it has none."""

    name: str
    axis: str
    value: float
    std: float | None
    unit: str
    identified: bool = True
    why: str | None = None  # why it is not identified


@dataclass(frozen=True)
class Term:
    """One effect in a model. `tied`: one value serves all axes."""

    effect: Effect
    tied: bool = False
    estimates: tuple[Estimate, ...] = ()
    constants: Mapping[str, float] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The effect's name."""
        return self.effect.name


@dataclass(frozen=True)
class Model:
    """An ordered list of effects. `unit` is that of the output, "" before the first fit.

    `covered`: lowest and highest value of each influence in the data that the values come from, as far as it is known.
    """

    name: str
    terms: tuple[Term, ...]
    unit: str = ""
    provenance: Mapping[str, str | float] = field(default_factory=dict)
    covered: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects, in order."""
        return tuple(term.name for term in self.terms)

    def holds(self, name: str) -> bool:
        """Whether the effect is in the model with a value of its own for every axis."""
        return any(term.name == name and not term.tied for term in self.terms)

    def with_effect(self, effect: Effect) -> Model:
        """The model with one effect more; a tied effect of that name is untied instead."""
        if any(term.name == effect.name for term in self.terms):
            terms = tuple(_untied(term) if term.name == effect.name else term for term in self.terms)
        else:
            terms = (*self.terms, Term(effect))
        return replace(self, name=f"{self.name}+{effect.name}", terms=terms)

    def without(self, name: str) -> Model:
        """The model with one effect less."""
        terms = tuple(term for term in self.terms if term.name != name)
        return replace(self, name=self.name.replace(f"+{name}", ""), terms=terms)

    def for_table(self, table: Table) -> Model:
        """The model without the effects that this kind of table cannot have, with its constants set."""
        terms = tuple(_with_constants(t, table) for t in self.terms if t.effect.excluded(table) is None)
        return replace(self, terms=terms)


def _untied(term: Term) -> Term:
    return replace(term, tied=False, estimates=())


def _with_constants(term: Term, table: Table) -> Term:
    missing = {name: make(table) for name, make in term.effect.constants.items() if name not in term.constants}
    return replace(term, constants={**term.constants, **missing})
