"""A physical effect: declared parameters, pure functions, and what a person should know about it.

An effect is a module in `calibrations/effects/` (or in a user's folder), named as the effect with underscores.
It has a docstring of the form

    temperature-bias: one line that says what happens.

        formula, with units

    Symptom   what the residual looks like.
    Excited by  what the data must contain.
    Confused with  what else looks like it, and what tells them apart.
    Source    where it is described.

a tuple PARAMETERS, and at least one of these functions, named by where in the signal chain it acts:

    pose(pose, table, p) -> Pose              the true stage angles and the true vertical
    force(a, table, p) -> (n, 3)              the specific force along the sensing axes, g; of a magnetometer the
                                              field as a share of its strength, of a gyroscope the rate, deg/s
    transduction(a, table, p) -> (n, 3)       what the effect adds to the output, in the output's unit
    output(v, table, p) -> (n, 3)             what becomes of the output

A noise process acts on no sample but on the spectrum of a still record; it has one of

    spectrum(at, p) -> (b,)                   two-sided density in the bands `at`, in the output's unit^2/Hz, in
                                              proportion to the square of its first parameter, its strength
    lines(p) -> ((Hz, amplitude), ...)        sinusoids, taken off the record before its spectrum

`p` maps a parameter's name to its value: shape (3,) if per axis, else a float. Optional are
NEEDS (columns), KINDS (of tables), AFTER (effects without which in a model it means nothing); CONSTANTS: name ->
function of the table, for reference values that are kept with the model and not fitted; STARTS: name -> function of
the table, for starts from the data, (axes,) or (starts, axes); SEARCHED, a function of the table: how many starts
that look different STARTS is the best of; CONTAINS, effects that it becomes where its shape vanishes; EXACT, where the
form follows from geometry alone and needs no other effect to refine it; ROUNDS, where the output becomes a staircase,
whose slope says nothing; LACKS, a function of the table: why its rows cannot show the effect whatever their number, or
None; and LEFT_OUT: why a compensation in the sensor's product cannot follow it (every other effect on force,
transduction or output is inverted there). KINDS are kinds of tables, and "fields" for positions of a magnetometer.

What `transduction` makes of the way from row to row, a product follows by

    follow(a, table, p, before) -> (n, 3), after    what is added to the output of one sample more, and what is
                                                    remembered then: like `before` MEMORY arrays (n, 3), 0 at first
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import logging
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, TypedDict

import numpy as np

from calibrations.errors import ModelError, UnknownName, nearest
from calibrations.expressions.guarded import fault, guarded
from calibrations.table import Array, Table

LOG = logging.getLogger(__name__)  # what is not called off is printed to standard error
HOOKS = ("pose", "force", "transduction", "output", "spectrum", "lines")
KINDS = ("poses", "positions", "motion")  # of tables, where an effect does not say
Values = Mapping[str, Array]  # parameter name -> shape (3,) if per axis, else a scalar


@dataclass(frozen=True)
class Parameter:
    """One declared parameter. `unit` may contain {out}, the unit of the output.

    `typical` is the magnitude that a sensor may show (in what is sensed where the unit holds {out}: g, the field's
    strength or deg/s; else in `unit`): the step of numerical derivatives follows from it, and an estimate no better
    than this tells nothing new. `measured` names an axis without which it does not exist, `where` one of the effect's
    CONSTANTS that is 0 where it does not (for one axis, with the axis behind it: `turned_x`), and `scale` one that
    `typical` is a multiple of, where only data can tell.
    """

    name: str
    unit: str
    typical: float
    per_axis: bool = True
    starts: tuple[float, ...] = (0.0,)
    low: float = -np.inf
    high: float = np.inf
    measured: str = ""
    where: str = ""
    scale: str = ""
    doc: str = ""

    def __post_init__(self) -> None:
        if not (isinstance(self.typical, (int, float)) and self.typical > 0):
            raise ModelError(f"{self.name}: typical is {self.typical!r}; it must be a number above 0")


class Sections(TypedDict):
    """The parts of an effect's docstring, each on one line but the formula."""

    summary: str
    formula: str
    symptom: str
    excited_by: str
    confused_with: str
    source: str


def _one(table: Table) -> float:  # noqa: ARG001
    """Nothing is searched for in the data."""
    return 1.0


def _nothing(table: Table) -> str | None:  # noqa: ARG001
    """Nothing is asked of the rows beforehand."""
    return None


@dataclass(frozen=True)
class Effect:
    """One physical effect, as read from its module, or from its `expression`, which is then kept in model files."""

    name: str
    parameters: tuple[Parameter, ...]
    summary: str
    formula: str
    symptom: str
    excited_by: str
    confused_with: str
    source: str
    needs: tuple[str, ...] = ()
    kinds: tuple[str, ...] = KINDS
    after: tuple[str, ...] = ()
    constants: Mapping[str, Callable[[Table], float]] = field(default_factory=dict)
    starts: Mapping[str, Callable[[Table], Array]] = field(default_factory=dict)
    searched: Callable[[Table], float] = _one
    contains: tuple[str, ...] = ()
    exact: bool = False
    rounds: bool = False
    lacks: Callable[[Table], str | None] = _nothing
    pose: Callable[..., Any] | None = None
    force: Callable[..., Array] | None = None
    transduction: Callable[..., Array] | None = None
    output: Callable[..., Array] | None = None
    spectrum: Callable[..., Array] | None = None
    lines: Callable[..., tuple[tuple[float, float], ...]] | None = None
    expression: str = ""
    left_out: str = ""
    follow: Callable[..., tuple[Array, Sequence[Array]]] | None = None
    memory: int = 0

    @property
    def acts_on(self) -> str:
        """Where in the signal chain it acts first."""
        return next(hook for hook in HOOKS if getattr(self, hook) is not None)

    def excluded(self, table: Table) -> str | None:
        """Why this effect cannot be asked of `table`, or None."""
        if table.content not in self.kinds:
            return f"is not defined for {table.content}"
        missing = [name for name in self.needs if name not in table]
        return f"needs the column {', '.join(missing)}" if missing else self.lacks(table)


@cache
def catalogue(folder: Path | None = None) -> Mapping[str, Effect]:
    """Every effect by name: the shipped ones, and those of a user's `folder`.

    Raises ModelError for a file that is not an effect, naming what it lacks, and for one with a shipped one's name.
    """
    shipped = Path(__file__).parent / "effects"
    effects = {e.name: e for e in _read_folder(shipped, "calibrations.effects")}
    if folder is not None:
        if not folder.is_dir():
            raise ModelError(f"{folder}: the folder of your own effects does not exist")
        if any(folder.glob("[!_]*.py")):
            LOG.warning("the Python files in %s are run: the bench file names this folder for effects", folder)
        own = {e.name: e for e in _read_folder(folder, None)}
        if taken := sorted(effects.keys() & own.keys()):
            raise ModelError(f"{folder}: {', '.join(taken)} is in the catalogue already; give your effect another name")
        effects |= own
    return effects


def find(name: str, effects: Mapping[str, Effect]) -> Effect:
    """The effect of that name. Raises UnknownName with the nearest."""
    if name not in effects:
        raise UnknownName(f'unknown effect "{name}"{nearest(name, effects)}')
    return effects[name]


def read_effect(path: Path) -> Effect:
    """A user's effect from its file. Raises ModelError for what is none, or has the name of a shipped one."""
    if not path.is_file():
        raise ModelError(f"{path}: there is no such file; an effect of your own is a Python file")
    effect = _guarded(_from_module(_load(path, None), path), path)
    if effect.name in catalogue():
        raise ModelError(f"{path}: {effect.name} is in the catalogue already; give the file another name")
    return effect


def _read_folder(folder: Path, package: str | None) -> Iterable[Effect]:
    for path in sorted(folder.glob("[!_]*.py")):
        effect = _from_module(_load(path, package), path)
        yield effect if package is not None else _guarded(effect, path)


def _guarded(effect: Effect, path: Path) -> Effect:
    """A user's effect, whose faults are told as such."""
    named = (*HOOKS, "follow")
    hooks: dict[str, Any] = {hook: guarded(f, path) for hook in named if (f := getattr(effect, hook)) is not None}
    return replace(effect, **hooks)


def _load(path: Path, package: str | None) -> ModuleType:
    if package is not None:
        return importlib.import_module(f"{package}.{path.stem}")
    spec = importlib.util.spec_from_file_location(f"user_effects_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise ModelError(f"{path}: cannot be read as Python")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise fault(path, error) from error
    return module


def _from_module(module: ModuleType, path: Path) -> Effect:
    hooks = {hook: getattr(module, hook) for hook in HOOKS if hasattr(module, hook)}
    if not hooks:
        raise ModelError(f"{path}: is not an effect: it defines none of the functions {', '.join(HOOKS)}")
    parameters = getattr(module, "PARAMETERS", ())
    if not isinstance(parameters, tuple) or not parameters or not all(isinstance(p, Parameter) for p in parameters):
        raise ModelError(f"{path}: is not an effect: PARAMETERS must be a tuple, as in (Parameter(...),)")
    return Effect(
        name=path.stem.replace("_", "-"),
        parameters=tuple(parameters),
        needs=_words(module, "NEEDS", (), path),
        kinds=_words(module, "KINDS", KINDS, path),
        after=_words(module, "AFTER", (), path),
        constants=dict(getattr(module, "CONSTANTS", {})),
        starts=dict(getattr(module, "STARTS", {})),
        searched=getattr(module, "SEARCHED", _one),
        contains=_words(module, "CONTAINS", (), path),
        exact=bool(getattr(module, "EXACT", False)),
        rounds=bool(getattr(module, "ROUNDS", False)),
        lacks=getattr(module, "LACKS", _nothing),
        left_out=str(getattr(module, "LEFT_OUT", "")),
        follow=getattr(module, "follow", None),
        memory=int(getattr(module, "MEMORY", 0)),
        pose=hooks.get("pose"),
        force=hooks.get("force"),
        transduction=hooks.get("transduction"),
        output=hooks.get("output"),
        spectrum=hooks.get("spectrum"),
        lines=hooks.get("lines"),
        **_sections(module.__doc__ or "", path),
    )


def _words(module: ModuleType, name: str, default: tuple[str, ...], path: Path) -> tuple[str, ...]:
    words = getattr(module, name, default)
    if not isinstance(words, tuple) or not all(isinstance(word, str) for word in words):
        raise ModelError(f'{path}: {name} must be a tuple of names, as in ("temperature_c",)')
    return words


def _sections(doc: str, path: Path) -> Sections:
    """The parts of an effect's docstring. Raises ModelError if one is missing."""
    doc = inspect.cleandoc(doc)
    head, _, rest = doc.partition("\n\n")
    titles = ("Symptom", "Excited by", "Confused with", "Source")
    marks = "|".join(titles)
    pieces = re.split(rf"^({marks})[ ]+", rest, flags=re.MULTILINE)
    found = dict(zip(pieces[1::2], pieces[2::2], strict=True))
    summary = head.partition(":")[2]
    if not summary or "Symptom" not in found:
        raise ModelError(f'{path}: its docstring must begin with "name: what happens." and have a line "Symptom ..."')
    symptom, excited_by, confused_with, source = (_one_line(found.get(title, "")) for title in titles)
    return Sections(
        summary=_one_line(summary),
        formula=inspect.cleandoc(pieces[0]).strip(),
        symptom=symptom,
        excited_by=excited_by,
        confused_with=confused_with,
        source=source,
    )


def _one_line(text: str) -> str:
    return " ".join(text.split())
