"""Models as YAML: the shipped ones by name, and files that keep values, uncertainties and provenance."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from calibrations.effects import Effect
from calibrations.effects.catalogue import catalogue, find
from calibrations.errors import ModelError, UnknownName, nearest
from calibrations.files import load_yaml
from calibrations.model import Estimate, Model, Term
from calibrations.model.model import Parameters
from calibrations.table import NUMBERS

if TYPE_CHECKING:
    from calibrations.model.correlations import Correlations

SHIPPED = Path(__file__).parents[1] / "models"
SCHEMA = "rig.model/1"
COMMON_BEFORE = {  # parameters that earlier versions wrote with one value for all axes
    "hysteresis.reach", "quantisation.step", "quantisation.offset", "quantisation.noise",
}  # fmt: skip
MOST = 1e12  # of a value in any unit: a fit that starts farther away resolves no change of the outputs


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", populate_by_name=True)


class _Parameter(_Strict):
    name: str
    axis: Literal["x", "y", "z"] | None = None
    value: float = Field(ge=-MOST, le=MOST, allow_inf_nan=False)
    std: float | None = Field(default=None, ge=0, allow_inf_nan=False)
    unit: str = ""
    identified: bool = True
    why: str | None = None


class _Effect(_Strict):
    effect: str
    expression: str | None = None
    forms: list[dict[str, Any]] | None = None  # of a free form, read by `calibrations.free_forms`
    columns: list[str] = []
    tied: bool = False
    constants: dict[str, FiniteFloat] = {}
    parameters: list[_Parameter] = []


class _Correlations(_Strict):
    parameters: list[str]
    lower: list[str]  # a row a parameter: its coefficients with those above it, with blanks between them


class _File(_Strict):
    schema_: Literal["rig.model/1"] = Field(alias="schema")
    name: str
    unit: str = ""
    effects: list[_Effect] = Field(min_length=1)
    provenance: dict[str, str | float] = {}
    covered: dict[str, tuple[float, float]] = {}
    correlations: _Correlations | None = None


def shipped_names() -> tuple[str, ...]:
    """Names of the models that come with the program."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.yaml")))


def read_model(name_or_path: str | Path, effects: Mapping[str, Effect] | None = None) -> Model:
    """A shipped model by name, or a model file. Raises UnknownName or ModelError naming file and key."""
    path = SHIPPED / f"{name_or_path}.yaml"
    if str(name_or_path) not in shipped_names():
        path = Path(name_or_path)
        if path.suffix not in (".yaml", ".yml") and not path.exists():
            raise UnknownName(
                f'no shipped model and no file is called "{name_or_path}"{nearest(str(name_or_path), shipped_names())}'
            )
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ModelError(f"{path}: the model file cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise ModelError(f"{path}: is not text (byte {error.start}); is it really a model file?") from None
    return parse_model(text, str(path), effects)


def parse_model(text: str, source: str, effects: Mapping[str, Effect] | None = None) -> Model:
    """The model in YAML `text`. Raises ModelError or UnknownName."""
    try:
        document = load_yaml(text)
    except ValueError as error:
        raise ModelError(f"{source}: is not YAML: {error}; correct this place, with spaces and no tabs") from None
    if not isinstance(document, dict):
        raise ModelError(f"{source}: is not a model: a model file is a mapping that begins with `schema: {SCHEMA}`")
    try:
        content = _File.model_validate(document)
    except ValidationError as error:
        # a misspelt key is also a missing one: name the key that is in the file
        first = min(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
        key = ".".join(str(part) for part in first["loc"])
        raise ModelError(f"{source}, key {key}: {_fault(first)}") from None
    effects_by_name = catalogue() if effects is None else effects
    terms = tuple(_term(entry, source, effects_by_name, content.unit) for entry in content.effects)
    names = [term.name for term in terms]
    if len(set(names)) < len(names):
        duplicate = next(name for name in names if names.count(name) > 1)
        raise ModelError(f'{source}: the effect "{duplicate}" occurs twice in the model')
    correlations = _correlations(content.correlations, Parameters(terms), f"{source}, key correlations")
    return Model(content.name, terms, content.unit, content.provenance, content.covered, correlations)


def _correlations(content: _Correlations | None, params: Parameters, source: str) -> Correlations | None:
    if content is None:
        return None
    from calibrations.model.correlations import Correlations, check_correlations  # few models have them

    try:
        rows = tuple(tuple(map(float, row.split())) for row in content.lower)
    except ValueError as error:
        raise ModelError(f"{source}: a row has numbers with blanks between them: {error}") from None
    of_axes = {name: [key for key in params if key.startswith(f"{name}.")] for name in COMMON_BEFORE}
    of_axes = {name: keys for name, keys in of_axes.items() if keys}
    return check_correlations(Correlations(tuple(content.parameters), rows), [*params, *of_axes], source).split(of_axes)


def _fault(error: Any) -> str:
    if error["type"] == "missing":
        return "is missing; `rig models` lists models, and `rig fit --out FILE` writes a complete file"
    if error["type"] != "extra_forbidden":
        return f"{error['msg']}, is {error['input']!r}"
    if error["loc"][0] == "correlations":
        return f"no such key{nearest(str(error['loc'][-1]), _Correlations.model_fields)}"
    places: Mapping[int, type[BaseModel]] = {1: _File, 3: _Effect}  # such as effects, 0, parameters, 1, axis
    place = places.get(len(error["loc"]), _Parameter)
    return f"no such key{nearest(str(error['loc'][-1]), [field.strip('_') for field in place.model_fields])}"


def _term(entry: _Effect, source: str, effects_by_name: Mapping[str, Effect], unit: str) -> Term:
    """`unit` is that of the model's outputs, "" where the file gives none."""
    effect = _effect(entry, source, effects_by_name)
    entry = _with_value_for_each_axis(entry, effect)
    _check_parameters(entry, effect, f"{source}: {entry.effect}")
    units = {p.name: _unit(p, effect, unit, f"{source}: {entry.effect}") for p in entry.parameters}
    for name in entry.constants:
        if name not in effect.constants:
            raise ModelError(f'{source}: {entry.effect} has no constant "{name}"{nearest(name, effect.constants)}')
    estimates = tuple(
        Estimate(p.name, p.axis or "", p.value, p.std, units[p.name], p.identified, p.why) for p in entry.parameters
    )
    return Term(effect, entry.tied, estimates, entry.constants)


def _effect(entry: _Effect, source: str, effects_by_name: Mapping[str, Effect]) -> Effect:
    if entry.forms is not None or entry.effect.startswith("free:"):
        return _free(entry, source)
    return (
        _expression_effect(entry, source, effects_by_name)
        if entry.expression is not None
        else _catalogue_effect(entry, source, effects_by_name)
    )


def _free(entry: _Effect, source: str) -> Effect:
    """The free forms of a place. Their data are in the file; without sizes the first fit finds them."""
    from calibrations.free_forms.effect import read_forms  # few models have one
    from calibrations.free_forms.requested import resolve_effect

    try:
        if entry.forms is None:
            return resolve_effect(entry.effect, {})
        return read_forms(entry.effect, entry.forms or [])
    except ValidationError as error:
        first = error.errors()[0]
        raise ModelError(
            f"{source}: {entry.effect}, key forms.{'.'.join(map(str, first['loc']))}: {first['msg']}"
        ) from None
    except ModelError as error:
        raise ModelError(f"{source}: {entry.effect}: {error}") from None


def _catalogue_effect(entry: _Effect, source: str, effects_by_name: Mapping[str, Effect]) -> Effect:
    if entry.columns:
        raise ModelError(f"{source}: {entry.effect} has columns but no expression that uses them")
    try:
        return find(entry.effect, effects_by_name)
    except UnknownName as error:
        raise UnknownName(
            f"{source}: {error}; your own effects are found with --bench (its key folders.effects)"
        ) from None


def _expression_effect(entry: _Effect, source: str, effects_by_name: Mapping[str, Effect]) -> Effect:
    """The effect of an expression. The file has all of it, and no code of the file is executed."""
    if entry.effect in effects_by_name:
        raise ModelError(f"{source}: {entry.effect} is already the name of an effect; give the expression another name")
    from calibrations.effects.expression_effect import own_effect  # few models have one

    try:
        return own_effect(entry.effect, entry.expression or "", tuple(entry.columns))
    except ModelError as error:
        raise type(error)(f"{source}: {entry.effect}: {error}") from None


def _with_value_for_each_axis(entry: _Effect, effect: Effect) -> _Effect:
    """The entry with a value for each axis of parameters that an earlier version wrote with one for all axes.

    An effect that has no other parameters is tied: one value serves all axes.
    """
    axes = sorted({p.axis for p in entry.parameters if p.axis is not None})
    common = [p for p in entry.parameters if p.axis is None and f"{effect.name}.{p.name}" in COMMON_BEFORE]
    if entry.tied or not common:
        return entry
    if not axes and all(f"{effect.name}.{p.name}" in COMMON_BEFORE for p in effect.parameters):
        return entry.model_copy(update={"tied": True})
    parameters = [
        copy
        for p in entry.parameters
        for copy in ([p.model_copy(update={"axis": axis}) for axis in axes] if axes and p in common else [p])
    ]
    return entry.model_copy(update={"parameters": parameters})


def _check_parameters(entry: _Effect, effect: Effect, label: str) -> None:
    declared = {p.name: p.per_axis and not entry.tied for p in effect.parameters}
    for p in entry.parameters:
        if p.name not in declared:
            raise ModelError(f'{label} has no parameter "{p.name}"{nearest(p.name, declared)}')
        if declared[p.name] and p.axis is None:
            raise ModelError(f'{label}: "{p.name}" has one value for each axis; it needs `axis: x`, y or z')
        if not declared[p.name] and p.axis is not None:
            raise ModelError(f'{label}: "{p.name}" is one value for all axes; remove the key axis, which is {p.axis}')
        if (entry.effect, p.name) == ("scale-factor", "scale") and abs(p.value) < 1 / MOST:
            raise ModelError(
                f"{label}: the scale is {p.value:g}, so the sensor would have no response; give another value"
            )
    keys = [(p.name, p.axis) for p in entry.parameters]
    if duplicate := next((key for key in keys if keys.count(key) > 1), None):
        raise ModelError(f"{label}: {' '.join(filter(None, duplicate))} is given twice")


def _unit(parameter_entry: _Parameter, effect: Effect, unit: str, label: str) -> str:
    """The unit of a parameter: the declared one, for outputs in `unit`. Raises ModelError where the file gives another.

    A file that gives a parameter's unit in terms of the output's must give the output's unit too.
    """
    declared = next(p.unit for p in effect.parameters if p.name == parameter_entry.name)
    has_unit, expected = bool(unit) or "{out}" not in declared, declared.replace("{out}", unit)
    if not parameter_entry.unit:
        return expected if has_unit else ""
    if has_unit and parameter_entry.unit == expected:
        return expected
    parameter = " ".join(filter(None, (f'the unit of "{parameter_entry.name}"', parameter_entry.axis)))
    if not has_unit:
        raise ModelError(
            f"{label}: {parameter} is {parameter_entry.unit}; also give the unit of the outputs, such as `unit: V`"
        )
    condition = f" in a model with `unit: {unit}`" if "{out}" in declared else ""
    raise ModelError(
        f"{label}: {parameter} is {parameter_entry.unit}, and must be {expected}{condition}; "
        "values are not converted: correct the unit, or convert value and std by hand"
    )


def dump_model(model: Model) -> str:
    """The model as YAML text; `parse_model` gives it back, to the last bit."""
    content = {
        "schema": SCHEMA,
        "name": model.name,
        "unit": model.unit,
        "effects": [_dump_term(term) for term in model.terms],
        "provenance": dict(model.provenance),
    }
    if model.covered:
        content["covered"] = {name: list(span) for name, span in model.covered.items()}
    if model.correlations is not None and (correlations := model.correlations.only(model.params)) is not None:
        rows = [" ".join(f"{r:.9g}" for r in row) for row in correlations.lower]
        content["correlations"] = {"parameters": list(correlations.names), "lower": rows}
    return yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=100)


def _dump_term(term: Term) -> dict[str, Any]:
    entry: dict[str, Any] = {"effect": term.name}
    if term.effect.expression:
        entry["expression"] = term.effect.expression
        if columns := [name for name in term.effect.needs if name not in NUMBERS]:
            entry["columns"] = columns
    if term.coefficients:
        from calibrations.free_forms.effect import dump_forms

        entry["forms"] = dump_forms(term.effect)
    if term.tied:
        entry["tied"] = True
    if term.constants:
        entry["constants"] = {name: float(value) for name, value in term.constants.items()}
    if term.estimates:
        entry["parameters"] = [_dump_estimate(e) for e in term.estimates]
    return entry


def _dump_estimate(e: Estimate) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": e.name, "axis": e.axis or None, "value": e.value, "std": e.std, "unit": e.unit}
    return entry if e.identified else entry | {"identified": False, "why": e.why}
