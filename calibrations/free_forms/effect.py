"""Free forms of one place as an effect of a model, named `free:PLACE`.

The forms are kept with the model, so that the effect is the same function on every table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from calibrations.effects import Effect, Parameter, Values
from calibrations.errors import ModelError, nearest
from calibrations.free_forms.form import ANGLES, TILT, TURNED, Form
from calibrations.free_forms.place_names import EFFECTS_AT, GEOMETRY_PLACE, KINDS_OF_FORMS, PLACES, PREFIX
from calibrations.geometry.orientation import Pose, reported_force
from calibrations.table import AXES, Array, Table


def place_of(name: str) -> str:
    """The place of `free:PLACE`. Raises ModelError with the nearest place."""
    place = name.removeprefix(PREFIX)
    if place == GEOMETRY_PLACE:
        raise ModelError(f"geometry has no free form: add {', '.join(EFFECTS_AT[GEOMETRY_PLACE][:2])} in its stead")
    if place not in PLACES and not place.startswith("column:"):
        raise ModelError(
            f'no free form acts at "{place}"{nearest(place, PLACES)} A logged column is written {PREFIX}column:NAME. '
            f"The places are {', '.join(PLACES)}"
        )
    return place


def place_to_leave_out(name: str) -> str:
    """The place, if a search can leave it out. Raises ModelError with the nearest place."""
    return name if name == GEOMETRY_PLACE else place_of(name)


def check_forms(forms: tuple[Form, ...], place: str) -> tuple[Form, ...]:
    """The forms, if they are those of one place, with sizes. Raises ModelError."""
    if not forms:
        raise ModelError("the list of forms is empty; `rig add` and `rig discover` write it")
    for form in forms:
        subject = f"the form {form.name}"
        if form.place != place:
            raise ModelError(f"{subject} acts at {form.place}, and the effect at {place}; each place has one effect")
        if place == TILT and form.name not in TURNED:
            raise ModelError(f"{subject} turns the base about no axis; its forms are {', '.join(TURNED)}")
        if not form.sizes or min(form.sizes) < 0 or max(form.sizes) == 0:
            raise ModelError(f"{subject} has no size; the size is the standard deviation of its coefficients")
        counts = {"bases": len(form.bases), "kept": len(form.kept) or 1}
        if member := next((key for key, n in counts.items() if n not in (1, len(form.sizes))), None):
            raise ModelError(
                f"{subject}: {member} has {counts[member]} entries for {len(form.sizes)} axes; give 1, or 1 an axis"
            )
        if any(
            not (size > 0) <= form.count(k) <= form.basis(k).count * (size > 0) for k, size in enumerate(form.sizes)
        ):
            raise ModelError(
                f"{subject}: `kept` must be 1 or more and not above the columns of the basis; 0 for an axis of size 0"
            )
    return forms


def read_forms(name: str, document: list[dict[str, Any]]) -> Effect:
    """The effect `free:PLACE` of a model file. Raises ModelError, and ValidationError of pydantic with the key."""
    place = place_of(name)
    return free_form(check_forms(TypeAdapter(tuple[Form, ...]).validate_python(document), place))


def dump_forms(effect: Effect) -> list[dict[str, Any]]:
    """The forms of an effect as a model file keeps them; none of an effect of another kind."""
    if not isinstance(effect, FreeForm):
        return []
    document: list[dict[str, Any]] = TypeAdapter(list[Form]).dump_python(list(effect.forms), mode="json")
    return document


@lru_cache(maxsize=128)
def free_form(forms: tuple[Form, ...]) -> Effect:
    """The effect of these forms, which act at one place and have sizes."""
    if forms[0].angle:
        return _OnAngle(forms)
    return _AtOutput(forms) if forms[0].driver == "output" else _OnResponse(forms)


class FreeForm(Effect):
    """free-form: a smooth function of unknown form acts at one place of the signal chain.

        V += f_i(x)          x: what drives the place; f: a penalised spline, of a size that the data show

    Symptom   the residual is a smooth curve over what drives the place.
    Excited by  data in which x changes.
    Confused with  catalogue effects that act at the same place; their forms are drawn through the curve.
    Source    Wood (2017), 5.8; Patterson and Thompson (1971).
    """

    kinds = KINDS_OF_FORMS

    def __init__(self, forms: tuple[Form, ...]) -> None:
        """Parameters are the coefficients of each form's columns, with the form's size as their prior."""
        self.forms = forms
        self.name = f"{PREFIX}{forms[0].place}"
        self.summary = f"{PLACES.get(forms[0].place, 'output over the logged column')}, of unknown form"
        self.needs = tuple(dict.fromkeys(column for form in forms for column in form.needs()))
        self.left_out = _explain_exclusion(forms)
        self.of_force = any(form.of_force for form in forms)
        self.scales = any(form.scales for form in forms)
        self.parameters = tuple(p for form in forms for p in _parameters(form))

        self._last: tuple[Table, Array, list[Array]] | None = None
        self._of_table: tuple[Table, dict[tuple[int, int], Array]] | None = None
        self._names: dict[int, list[tuple[str, bool]]] = {}  # by axis, whether all axes share each

    def _coefficients(self, p: Values, k: int) -> Array:
        """Coefficients of all forms for axis k."""
        if k not in self._names:
            self._names[k] = [(name, form.shared) for form in self.forms for name in parameter_names(form, k)]
        return np.array([float(p[name] if shared else p[name][k]) for name, shared in self._names[k]])

    def _columns(self, table: Table, force: Array, k: int) -> Array:
        """Columns of all forms for axis k, shape (n, count)."""
        return np.hstack([self._columns_of(i, table, force, k) for i in range(len(self.forms))])

    def _columns_of(self, i: int, table: Table, force: Array, k: int) -> Array:
        """Columns of one form for axis k, shape (n, count). Those that follow from the last table alone are kept."""
        form = self.forms[i]
        if not form.of_table:
            return form.columns(table, force, np.zeros(len(force)), k)
        if self._of_table is None or self._of_table[0] is not table:
            self._of_table = (table, {})
        cached = self._of_table[1]
        if (i, k) not in cached:
            cached[i, k] = form.columns(table, force, np.zeros(len(force)), k)
        return cached[i, k]

    def _summed(self, table: Table, force: Array, response: Array, k: int, coefficients: Array) -> Array:
        """The sum of all columns for axis k with these coefficients, shape (n,)."""
        total, start = np.zeros(len(force)), 0
        for i, form in enumerate(self.forms):
            form_coefficients = coefficients[start : start + form.count(k)]
            start += len(form_coefficients)
            if form.of_table:
                total += self._columns_of(i, table, force, k) @ form_coefficients
            else:
                total += form.sum_columns(table, force, response, k, form_coefficients)
        return total

    def _cache_columns(self, table: Table, force: Array) -> list[Array]:
        """Columns of each axis. Those of the last force stay in memory, since a jacobian needs them often."""
        if self._last is None or not self._has_columns(table, force):
            self._last = (table, force, [self._columns(table, force, k) for k in range(len(table.axes))])
        return self._last[2]

    def _has_columns(self, table: Table, force: Array) -> bool:
        return self._last is not None and self._last[0] is table and self._last[1] is force

    def _named(self, columns_by_axis: Sequence[Array]) -> dict[str, Array]:
        """Columns (n, count) of each axis by the name of their parameter, (n, 3)."""
        by_name = {p.name: np.zeros((len(columns_by_axis[0]), 3)) for p in self.parameters}
        for k, columns in enumerate(columns_by_axis):
            names = [name for form in self.forms for name in parameter_names(form, k)]
            for name, column in zip(names, columns.T, strict=True):
                by_name[name][:, k] = column
        return by_name


class _OnResponse(FreeForm):
    """Adds to the output of each axis, (n, 3)."""

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        contribution, no_response = np.zeros(a.shape), np.zeros(len(a))
        has_columns = self._has_columns(table, a)
        for k in range(len(table.axes)):
            coefficients = self._coefficients(p, k)
            if has_columns:
                contribution[:, k] = self._cache_columns(table, a)[k] @ coefficients
            else:
                contribution[:, k] = self._summed(table, a, no_response, k, coefficients)
        return contribution

    def columns(self, a: Array, table: Table) -> dict[str, Array]:
        return self._named(self._cache_columns(table, a))


class _AtOutput(FreeForm):
    """Adds to the output, over the output."""

    converts = True

    def output(self, v: Array, table: Table, p: Values) -> Array:
        output = v.copy()
        for k in range(len(table.axes)):
            output[:, k] += self._summed(table, v, v[:, k], k, self._coefficients(p, k))
        return output

    def columns(self, a: Array, table: Table) -> dict[str, Array]:
        axes = range(len(table.axes))
        return self._named([np.hstack([form.columns(table, a, a[:, k], k) for form in self.forms]) for k in axes])


class _OnAngle(FreeForm):
    """Adds to a stage angle; coefficients are in rad."""

    def pose(self, pose: Pose, table: Table, p: Values) -> Pose:
        columns, coefficients, start = self._cache_columns(table, reported_force(table))[0], self._coefficients(p, 0), 0
        for form in self.forms:
            used = slice(start, start + form.count(0))
            pose, start = _turn(pose, form.angle, columns[:, used] @ coefficients[used]), used.stop
        return pose


def _turn(pose: Pose, angle: str, error: Array) -> Pose:
    """The pose with an error of one of its angles, rad, shape (n,)."""
    if angle == "tilt":
        x, y, z = np.broadcast_to(np.reshape(pose.up, (3, -1)), (3, len(error)))
        cosine, sine = np.cos(error), np.sin(error)
        return replace(pose, up=np.stack([x, y * cosine - z * sine, y * sine + z * cosine]))
    return replace(pose, **{angle: getattr(pose, angle) + error})


def coefficients_of(form: Form, p: Values, k: int) -> Array:
    """Coefficients of one form for axis k, shape (count,)."""
    values = [p[_name(form, j)] for j in range(form.count(k))]
    return np.array([float(v if form.shared else v[k]) for v in values])


def parameter_names(form: Form, k: int) -> list[str]:
    """The name of the coefficient of each column of axis k."""
    return [_name(form, j) for j in range(form.count(k))]


def _name(form: Form, j: int) -> str:
    return f"{form.name.replace('-', '_')}_{j + 1:02d}"


def _parameters(form: Form) -> list[Parameter]:
    """A parameter for each column that an axis uses."""
    unit = "rad" if form.angle else "{out}"
    if not form.sizes:
        raise ModelError(f"the free form {form.place}/{form.name} has no sizes yet; a search of `rig add` finds them")
    axes = ("",) if form.shared else AXES[: len(form.sizes)]
    most = max(form.count(k) for k in range(len(form.sizes)))
    return [
        Parameter(
            unit,
            typical=max(form.sizes),
            per_axis=not form.shared,
            prior={axis: form.sizes[k] for k, axis in enumerate(axes) if j < form.count(k)},
            name=_name(form, j),
            doc=f"coefficient {j + 1} of the {form.name} over {form.driver}",
        )
        for j in range(most)
    ]


def _explain_exclusion(forms: tuple[Form, ...]) -> str:
    """Why the sensor's product cannot undo the effect; "" where it can."""
    if forms[0].angle:
        return "it is an error of the stage"
    if forms[0].driver in ANGLES:
        return "it follows the angle of the stage, which a product does not have"
    if forms[0].driver == "time":
        return "the drift of one record does not predict the next"
    if any(form.driver == "variance" for form in forms):
        return "it follows the standard deviation of the samples of a mean"
    if any(form.driver == "temperature" and form.bases[0].kind == "play" for form in forms):
        return "it remembers earlier temperatures; add temperature-hysteresis in its stead"
    if any(form.bases[0].kind == "steps" for form in forms):
        return "it jumps where bits of the converter change, and a jump has no inverse"
    if any(form.factor == "side" or form.bases[0].kind in ("play", "preisach") for form in forms):
        return "it follows the way of the stage to each pose"
    return ""
