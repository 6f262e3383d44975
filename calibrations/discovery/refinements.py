"""Causes among the effects of a final model, and refinements of the form of a larger cause.

The form of a mechanism differs from that of the catalogue, and the difference looks like further effects. The test of
an effect therefore includes another form of every larger one: a smooth function at the same place, with a Gaussian
prior of a tenth of the larger effect's size. An effect that such a form can replace stays in the model as a refinement.

Source  Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425: the misfit of a model as a random function.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from calibrations.criteria import FORM_PART, REFINEMENT, SIGNIFICANT
from calibrations.discovery.findings import Step
from calibrations.discovery.search import cost, first_order_cost
from calibrations.discovery.significance import chance, of_search
from calibrations.fitting.fit import Fit
from calibrations.fitting.residual_forms import OF_FORCE, OF_TABLE, ResidualForms, form_columns, forms_at
from calibrations.free_forms.acting_places import FORM_OF
from calibrations.free_forms.bases import Basis, Spline, StraightLine, spline
from calibrations.free_forms.form import Factor, Form
from calibrations.free_forms.place_names import place_of_effect
from calibrations.free_forms.rivals import MOSTLY
from calibrations.free_forms.selection import ENTER
from calibrations.table import Array

BASE = ("bias", "scale-factor")
DRIVERS: Mapping[str, tuple[str, Factor]] = {**OF_FORCE, **OF_TABLE, "output": ("output", "")}
LINEAR = ("cross-response", "z-response", "scale-over-cross", "scale-over-z")  # whose linear parts are geometry
SLOW = (("temperature-bias", "time-bias"), ("temperature-scale", "time-scale"))  # places that go the same way
LEAD_S, LEADS = 15.0, 4.0  # by which the sensor may be ahead of its thermometer, and how often that
INTERVALS = 8
FORCES = Spline(-1.1, 1.1, INTERVALS)


def causes(steps: tuple[Step[Fit], ...], trials: int) -> tuple[str, ...]:
    """The effects of a search that are causes, in the order of its steps.

    steps  one or more
    tried  how many effects the search chose among
    """
    tied = {term.name for term in steps[0].before.model.terms if term.tied}
    end = steps[-1].after
    costs = {
        s.name: (first_order_cost(end, s.name, shared=True) if s.name in tied else cost(end, s.name))[0] for s in steps
    }
    approximate = [s.name for s in steps if not s.effect.exact]
    greatest = max((costs[name] for name in approximate), default=0.0)
    material = [name for name, growth in costs.items() if name not in approximate or growth >= REFINEMENT * greatest]
    if len(material) < 2:
        return tuple(material)
    material = _one_of_slow_pair(end, material)
    named: list[str] = []
    for name in sorted(material, key=lambda n: -costs[n]):
        forms = [_whiten_forms(end, larger) for larger in named]
        if (
            not forms
            or name in BASE
            or not (
                of_search(chance(*_cost_of_removal(end, name, np.hstack(forms))), trials) >= SIGNIFICANT
                or _follows(end, name, [larger for larger in named if _is_smaller(costs[name], costs[larger])])
            )
        ):
            named.append(name)
    return tuple(name for name in material if name in named)


def _one_of_slow_pair(end: Fit, names: list[str]) -> list[str]:
    """The effects without that of temperature, or of time, if a free form of the other one replaces it.

    If temperature and time change alike, each formula corrects the other one. The likelier place is the cause.
    """
    at = {place_of_effect(name): name for name in names}
    for pair in SLOW:
        if not all(place in at for place in pair):
            continue
        of_pair = [
            ResidualForms.of(end.in_white_noise(), forms_at(place, end), tested_effect=at[rival])
            for place, rival in (pair, pair[::-1])
        ]
        likelier = min(of_pair, key=lambda forms: forms.selected.deviance)
        if _takes_up(likelier):
            names = [name for name in names if name != likelier.tested_effect]
    return names


def _takes_up(forms: ResidualForms) -> bool:
    """Whether the forms explain most of the signal of the effect that is fitted apart."""
    alone = forms.gain_of_tested_effect(forms.without_forms)
    return forms.gain_of_tested_effect(forms.selected) < max(ENTER, (1 - MOSTLY) * alone)


def _is_smaller(growth: float, larger: float) -> bool:
    return growth < FORM_OF**2 * larger


def _follows(end: Fit, name: str, larger: list[str]) -> bool:
    """Whether free forms of fitted size, at the places of much larger effects, explain most of the effect."""
    places = dict.fromkeys(place_of_effect(larger_name) for larger_name in larger)
    forms = {key: form for place in places if place in DRIVERS for key, form in forms_at(place, end).items()}
    if not forms:
        return False
    return _takes_up(ResidualForms.of(end.in_white_noise(), forms, tested_effect=name))


def _cost_of_removal(end: Fit, name: str, forms: Array) -> tuple[float, int]:
    """Growth of the whitened sum of squares without an effect, to first order, and the number of its parameters.

    `forms`: columns that may replace it, whitened, (rows, m), for coefficients of prior N(0, 1).
    """
    white, mask = end.whitened[:, 1:], end.problem.layout.of_effect(name)
    size = np.linalg.norm(white, axis=0)
    white = white / np.where(size > 0, size, 1.0)
    signal = white[:, mask] @ (end.theta[mask] * size[mask])
    other_columns, m = white[:, ~mask], forms.shape[1]
    rows = np.block([[other_columns, forms], [np.zeros((m, other_columns.shape[1])), np.eye(m)]])
    target = np.append(signal, np.zeros(m))
    lost_signal = target - rows @ np.linalg.lstsq(rows, target, rcond=1e-9)[0]
    return float(lost_signal @ lost_signal), int(mask.sum())


def _whiten_forms(end: Fit, name: str) -> Array:
    """Other forms of an effect, whitened, (rows, m): columns for coefficients of prior N(0, 1)."""
    white = end.whitened[:, 1:]
    base = white[:, np.any([end.problem.layout.of_effect(base_name) for base_name in BASE], axis=0)]
    mask = end.problem.layout.of_effect(name)
    size_of_effect = np.linalg.norm(_project_off(white[:, mask] @ end.theta[mask], base))
    blocks = [np.zeros((len(white), 0))]
    for form, part in _forms(end, name):
        columns = _project_off(end.noise.whiten(form_columns(end, form)), base)
        size = np.linalg.norm(columns)
        blocks.append(columns * (part * size_of_effect / size if size > 0 else 0.0))
    return np.hstack(blocks)


def _project_off(rows: Array, base: Array) -> Array:
    return rows - base @ np.linalg.lstsq(base, rows, rcond=1e-9)[0]


def _forms(end: Fit, name: str) -> Iterator[tuple[Form, float]]:
    """The other forms of an effect, and the size of each as a share of the effect's size."""
    place, table = place_of_effect(name), end.problem.samples
    if place not in DRIVERS:
        return
    driver, factor = DRIVERS[place]
    if driver not in ("temperature", "time", "output"):
        yield Form(place, "curve", driver, (FORCES,), factor), FORM_PART
        if place in LINEAR:
            yield Form(place, "line", driver, (StraightLine(-1.0, 1.0),), factor), 1.0
        return
    if driver == "output":
        bases: tuple[Basis, ...] = tuple(spline(v, INTERVALS) for v in table.outputs.T)
    else:
        x = table.column("temperature_c") if driver == "temperature" else table.time_s
        bases = (spline(x, INTERVALS),)
    yield Form(place, "curve", driver, bases, factor), FORM_PART
    if driver == "temperature" and "t_s" in table:
        line = StraightLine(float(x.min()), float(x.max()))
        for lead in (-LEAD_S, LEAD_S):
            yield Form(place, "lead", driver, (line,), factor, lead_s=lead), LEADS
