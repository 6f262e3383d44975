"""A model: an ordered list of effects, with the values, uncertainties and provenance of their parameters.

A model is a frozen value. Fitting or adding an effect makes a new one; the old one stays.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any

from calibrations.effects import Effect
from calibrations.errors import UnknownParameter, nearest
from calibrations.frames import data_frame, html_table
from calibrations.result import ReportedResult
from calibrations.table import Table
from calibrations.text import columns, concise_in_prefix, minus, rounded, unit, value_text

if TYPE_CHECKING:
    from calibrations.model.correlations import Correlations

NOT_FITTED = 'the model has no value for "{}"; fit it to data first'


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

    @property
    def text(self) -> str:
        """Value, uncertainty and unit for people; the reason if the data do not identify it."""
        return concise_in_prefix(self.value, self.std, self.unit) if self.identified else f"not identified: {self.why}"

    def __repr__(self) -> str:
        return f"<{' '.join(filter(None, (self.name, self.axis)))}: {self.text}>"


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

    @property
    def known_constants(self) -> dict[str, float]:
        """Its constants. A term that has some of them, but not those that came later, is of an older model file."""
        return {**(self.effect.assumed_constants if self.constants else {}), **self.constants}

    @property
    def quantities(self) -> tuple[Estimate, ...]:
        """The estimates with a meaning of their own: without the coefficients of a free form."""
        coefficients = {p.name for p in self.effect.parameters if p.prior is not None}
        return tuple(e for e in self.estimates if e.name not in coefficients)

    @property
    def coefficients(self) -> dict[str, int]:
        """Number of coefficients of a free form, by axis; "" where all axes share them."""
        names = {e.name for e in self.quantities}
        return dict(Counter(e.axis for e in self.estimates if e.name not in names))


class Parameters(Mapping[str, Estimate]):
    """The estimates of a model by key, in order.

    A key is EFFECT.PARAMETER.AXIS. PARAMETER is missing where the effect has only one, AXIS where one value serves all
    axes: "bias.x", "z-axis-scale.slope.x", "axis-misalignment.z". Also accepted are the whole form, "bias.bias.x", and
    the beginning of a single key, such as "scale-factor" in the model `common-scale`.
    """

    def __init__(self, terms: tuple[Term, ...]) -> None:
        self._by_key: dict[str, Estimate] = {}
        self._whole: dict[str, str] = {}
        self._terms = terms
        for term in terms:
            for e in term.estimates:
                key = _key(term.name, e.name if len(term.effect.parameters) > 1 else "", e.axis)
                self._by_key[key] = e
                self._whole[_key(term.name, e.name, e.axis)] = key

    def __getitem__(self, key: str) -> Estimate:
        """The estimate of `key`. Raises UnknownParameter, with the keys that begin with it or the nearest one."""
        full_key = self._whole.get(key, key)
        if full_key in self._by_key:
            return self._by_key[full_key]
        matching = [full_name for full_name in self._by_key if full_name.startswith(f"{key}.")]
        if len(matching) == 1:
            return self._by_key[matching[0]]
        hint = f"; it has {', '.join(matching)}" if matching else nearest(key, self._by_key)
        raise UnknownParameter(f'the model has no parameter "{key}"{hint}' if self._by_key else NOT_FITTED.format(key))

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_key)

    def __len__(self) -> int:
        return len(self._by_key)

    def __repr__(self) -> str:
        return columns(
            ("parameter", "value"), [(row[0], row[1].text) for row in self._single_parameters()] + self._curves()
        )

    def _repr_html_(self) -> str:
        curves = [(key, count, "", "") for key, count in self._curves()]
        return html_table(
            ("parameter", "value", "standard uncertainty", "unit"), [*map(_cells, self._single_parameters()), *curves]
        )

    def _single_parameters(self) -> list[tuple[str, Estimate]]:
        """The parameters with a meaning of their own, which coefficients of free forms do not have."""
        curves = tuple(f"{term.name}." for term in self._terms if term.coefficients)
        return [(key, e) for key, e in self.items() if not key.startswith(curves)]

    def _curves(self) -> list[tuple[str, str]]:
        """Key and number of coefficients of each free form of an axis."""
        counts = [(term.name, axis, n) for term in self._terms for axis, n in term.coefficients.items()]
        return [(_key(name, "curve", axis), f"{n} coefficients") for name, axis, n in counts]

    def to_dataframe(self) -> Any:
        """A row for each parameter as a pandas.DataFrame. Raises CalibrationError where pandas is not installed."""
        return data_frame(self.records())

    def records(self) -> list[dict[str, Any]]:
        """Key, value, standard uncertainty, unit, and whether the data identify it; a row a parameter."""
        return [
            {"parameter": key, "value": e.value, "std": e.std, "unit": e.unit, "identified": e.identified}
            for key, e in self.items()
        ]


def _cells(item: tuple[str, Estimate]) -> tuple[str, str, str, str]:
    """Key, value, standard uncertainty and unit as text; the reason, where the data do not identify the value."""
    key, e = item
    if not e.identified:
        return key, e.text, "", ""
    if not e.std:
        return key, minus(f"{e.value:.6g}"), "", unit(e.unit)
    return key, value_text(e.value, e.std), rounded(e.std, 2), unit(e.unit)


def _key(*parts: str) -> str:
    return ".".join(part for part in parts if part)


@dataclass(frozen=True, repr=False)
class Model(ReportedResult):
    """An ordered list of effects. `unit` is that of the output, "" before the first fit.

    `covered`: lowest and highest value of each influence in the data that the values come from, as far as it is known.
    `correlations` of the parameters, None where they are not known.
    """

    name: str
    terms: tuple[Term, ...]
    unit: str = ""
    provenance: Mapping[str, str | float] = field(default_factory=dict)
    covered: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    correlations: Correlations | None = None

    @cached_property
    def params(self) -> Parameters:
        """The estimates by key: `params["bias.x"].value`."""
        return Parameters(self.terms)

    def __getitem__(self, key: str) -> Estimate:
        """The estimate of `key`, such as "bias.x". Raises UnknownParameter with the nearest key."""
        return self.params[key]

    def value(self, key: str, default: float = 0.0) -> float:
        """The value of `key`, or that of all axes where one serves them; `default` where the model has neither."""
        if key in self.params:
            return self.params[key].value
        shared = self.params.get(key.rpartition(".")[0])
        return shared.value if shared is not None and not shared.axis else default

    def estimates(self, effect: str) -> tuple[Estimate, ...]:
        """The estimates of one effect; () if the model does not have it, or has no values yet."""
        return next((term.estimates for term in self.terms if term.name == effect), ())

    @property
    def all_estimates(self) -> list[tuple[Term, Estimate]]:
        """Every estimate with its effect's term, in the order of the parameters of a fit."""
        return [(term, e) for term in self.terms for e in term.estimates]

    def report(self) -> str:
        """The parameters as a table for people; the effects, where the model has no values yet."""
        rows = [(key, e.text) for key, e in self.params.items()]
        head = f"{self.name}: {', '.join(self.effects)}"
        return f"{head}\n{columns(('parameter', 'value'), rows)}" if rows else f"{head}; not fitted yet"

    def _repr_html_(self) -> str:
        return f"<p>{escape(self.name)}: {escape(', '.join(self.effects))}</p>{self.params._repr_html_()}"

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
            terms = tuple(_separate_axes(term) if term.name == effect.name else term for term in self.terms)
        else:
            terms = (*self.terms, Term(effect))
        return replace(self, name=f"{self.name}+{effect.name}", terms=terms)

    def without(self, name: str) -> Model:
        """The model with one effect less."""
        terms = tuple(term for term in self.terms if term.name != name)
        first, *added = self.name.split("+")
        return replace(self, name="+".join([first, *(each for each in added if each != name)]), terms=terms)

    def for_table(self, table: Table) -> Model:
        """The model without the effects that this kind of table cannot have, with its constants set."""
        terms = tuple(_with_constants(t, table) for t in self.terms if t.effect.excluded(table) is None)
        return replace(self, terms=terms)


def _separate_axes(term: Term) -> Term:
    return replace(term, tied=False, estimates=())


def _with_constants(term: Term, table: Table) -> Term:
    known = term.known_constants
    missing = {name: make(table) for name, make in term.effect.constants.items() if name not in known}
    return replace(term, constants={**known, **missing})
