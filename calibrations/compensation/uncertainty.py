"""How uncertain the result of a compensation is by its parameters: where they were found, and over the whole range.

A parameter that multiplies how far an input is from its reference, such as a temperature coefficient, makes the result
the less certain the further the input goes. So there are two figures: over the sphere of directions in gravity, with
inputs within what the data of the calibration covered; and the greatest over the stated range of everything.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calibrations.chain import respond, sensed
from calibrations.compensation.forward import FORCES, Forward, steps_of
from calibrations.model import Estimate, Model, Term
from calibrations.table import Array, Table

SHIFT = 1e-3  # of a standard uncertainty: steps of derivatives
LEVELS = 9  # of an input over its range, one after the other
CLOSER = 6  # decades towards the lower end: what happens soon after the power comes on is not missed
REFERENCES = {"temperature_c": "reference_c", "supply_v": "reference_v"}  # constants of models

Span = tuple[float, float]
Place = Mapping[str, float]
Stds = Callable[[Place], Array]


@dataclass(frozen=True)
class Uncertainty:
    """Of the worst axis: rms and greatest with inputs `within`, as calibrated; `largest` of all, at `at`."""

    within: Mapping[str, Span]
    rms: float
    most: float
    largest: float
    at: Place


def uncertainty(
    model: Model, forward: Forward, table: Table, a: Array, beside: Mapping[str, Span], reach: float
) -> Uncertainty | None:
    """By the standard uncertainties of the parameters, taken as independent; None where there are none.

    Over the specific force `a` (n, 3) of the rows of `table`, and that as far as `reach` goes on an axis; `beside` has
    the stated range of each input beside the outputs. Source  GUM 5.1.2.
    """
    if not any(e.std and e.identified for term in model.terms for e in term.estimates):
        return None
    inputs = {name: span for name, span in beside.items() if name not in FORCES}
    within = {name: _found_in(name, span, model) for name, span in inputs.items()}
    far = reach * a / np.abs(a).max(axis=1, keepdims=True)
    near = np.concatenate([_stds(model, forward, table, a, at) for at in _corners(within)])
    at, largest = _largest(lambda place: _stds(model, forward, table, far, place), inputs)
    rms = float(np.sqrt(np.mean(near**2, axis=0)).max())
    return Uncertainty(within, rms, float(near.max()), max(largest, float(near.max())), at)


def _found_in(name: str, stated: Span, model: Model) -> Span:
    """Where an input was while the parameters were found, as far as that is within the stated range.

    By what the model file says that the data covered, or its own reference; the whole range where neither is known.
    """
    at = {key: value for term in model.terms for key, value in term.constants.items()}
    reference = at.get(REFERENCES.get(name, ""))
    low, high = model.covered.get(name, stated if reference is None else (reference, reference))
    return float(np.clip(low, *stated)), float(np.clip(high, *stated))


def _corners(spans: Mapping[str, Span]) -> list[Place]:
    """Lowest, middle and highest of every input with those of all others."""
    levels = [dict.fromkeys((low, (low + high) / 2, high)) for low, high in spans.values()]
    return [dict(zip(spans, values, strict=True)) for values in product(*levels)]


def _largest(stds: Stds, spans: Mapping[str, Span]) -> tuple[Place, float]:
    """Where the greatest is: at the worst corner, from where each input is tried over its range in turn."""

    def most(place: Place) -> float:
        return float(stds(place).max())

    best = max(_corners(spans), key=most)
    for name, (low, high) in spans.items():
        soon = low + (high - low) * np.geomspace(10.0**-CLOSER, 1, 3 * CLOSER)
        levels = [*np.linspace(low, high, LEVELS).tolist(), *soon.tolist()]
        best = max([best, *({**best, name: value} for value in levels)], key=most)
    return best, most(best)


def _stds(model: Model, forward: Forward, table: Table, a: Array, at: Place) -> Array:
    """Standard uncertainties (n, axes) of what is sensed: u^2 = sum of (J^-1 dG/dp u(p))^2, with J = dG/da."""
    here = replace(table, columns={**table.columns, **{name: np.full(table.n, value) for name, value in at.items()}})
    k = ["xyz".index(axis) for axis in forward.axes]

    def output(of: Model, force: Array) -> Array:
        steps = steps_of(of)
        return respond(sensed(force, here, steps), here, steps)[:, k]

    h = 1e-5
    J = np.stack([(output(model, a + h * e) - output(model, a - h * e)) / (2 * h) for e in np.eye(3)[k]], axis=2)
    inverse, variance = np.linalg.inv(J), np.zeros((table.n, len(k)))
    for up, down in _moved(model):
        moved = (output(up, a) - output(down, a)) / (2 * SHIFT)
        variance += np.einsum("nij,nj->ni", inverse, moved) ** 2
    return np.asarray(np.sqrt(variance))


def _moved(model: Model) -> Sequence[tuple[Model, Model]]:
    """The model with each known parameter moved a little, up and down."""
    return [
        (_with(model, i, j, SHIFT * e.std), _with(model, i, j, -SHIFT * e.std))
        for i, term in enumerate(model.terms)
        for j, e in enumerate(term.estimates)
        if e.std and e.identified
    ]


def _with(model: Model, i: int, j: int, by: float) -> Model:
    term: Term = model.terms[i]
    moved: Estimate = replace(term.estimates[j], value=term.estimates[j].value + by)
    estimates = (*term.estimates[:j], moved, *term.estimates[j + 1 :])
    return replace(model, terms=(*model.terms[:i], replace(term, estimates=estimates), *model.terms[i + 1 :]))
