"""A physical effect: a class with parameters, a docstring for people, and the places where it acts.

    class TemperatureBias(Effect):
        \"\"\"temperature-bias: the zero-g output follows the temperature.

            V += slope (T - T0)                   the formula, with units

        Symptom   the form of the residual.
        Excited by  the changes that the data must contain.
        Confused with  effects with the same symptom, and how to separate them.
        Source    where it is described.
        \"\"\"

        needs = ("temperature_c",)
        slope = Parameter("{out}/K", typical=0.005, doc="output per kelvin")
        reference_c = Constant(lambda table: float(np.mean(table.column("temperature_c"))))

        def transduction(self, a: Array, table: Table, p: Values) -> Array:
            warmer = table.column("temperature_c") - p.reference_c
            return warmer[:, None] * p.slope

The file `temperature_bias.py` holds the class `TemperatureBias`, and the effect is named `temperature-bias`. A member
that no effect has, a wrong type or a wrong signature raises ModelError where the class is defined.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from calibrations.errors import ModelError, nearest
from calibrations.geometry.orientation import Pose
from calibrations.table import Array, Table
from calibrations.tables import KINDS, Kind

if TYPE_CHECKING:
    from calibrations.spectrum import Bands

HOOKS = ("pose", "force", "transduction", "output", "spectrum", "lines")  # places, in the order of the signal chain
ACCELEROMETER_KINDS = tuple(name for name, kind in KINDS.items() if kind.fitted and kind.input_unit == "g")
NOTHING = np.zeros((1, 3))


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect. `unit` may contain {out}, the unit of the output.

    `typical` is the magnitude that a sensor may show (in what is sensed where the unit holds {out}: g, the field's
    strength or deg/s; else in `unit`): the step of numerical derivatives follows from it, and an estimate with a larger
    uncertainty is not identified. An estimate lies between `low` and `high`, and is at most `most` of the table. A fit
    starts from `starts`, or from `guess`: a function of the table that gives (axes,) or (starts, axes). `measured`
    names an axis without which the parameter does not exist, `where` a constant of the effect that is 0 where it does
    not (for one axis, with the axis behind it: `turned_x`), and `scale` a constant that `typical` is a multiple of,
    where only data can tell. `prior` holds the standard deviation of a Gaussian prior of mean 0 by axis ("" for one
    value of all axes); an axis without one does not have the parameter.
    `assumed` is the value in model files that do not give one, as they were written before there was the parameter.
    An effect's class sets `name`.
    """

    unit: str
    typical: float
    per_axis: bool = True
    starts: tuple[float, ...] = (0.0,)
    low: float = -np.inf
    high: float = np.inf
    most: Callable[[Table], float] | None = None
    guess: Callable[[Any], Array] | None = None  # of a table; of a noise effect: of a channel
    measured: str = ""
    where: str = ""
    scale: str = ""
    prior: Mapping[str, float] | None = None
    assumed: float | None = None
    doc: str = ""
    name: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.unit, str):
            raise ModelError(f'the unit of a parameter is {self.unit!r}; write it as text, such as "{{out}}/K"')
        if not (isinstance(self.typical, (int, float)) and self.typical > 0):
            raise ModelError(f"{self.name or 'a parameter'}: typical is {self.typical!r}; it must be a number above 0")


@dataclass(frozen=True)
class Constant:
    """A reference value, such as the mean temperature: computed from the first table, then kept with the model.

    `assumed` is the value in model files that give other constants of the effect and not this one, as they were written
    before it existed. `doc` says in a report what it is, where its name with the unit does not.
    """

    of: Callable[[Table], float]
    assumed: float | None = None
    doc: str = ""


class Values(dict[str, Array]):
    """Values of an effect's parameters and constants: `p.slope` or `p["slope"]`, of shape (3,) if per axis, else ()."""

    def __getattr__(self, name: str) -> Array:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f'the effect has no parameter "{name}"{nearest(name, self)}') from None

    @staticmethod
    def of(values: Mapping[str, Any]) -> Values:
        """The values as arrays."""
        return Values({name: np.asarray(value) for name, value in values.items()})


class Effect:
    """One physical effect. A subclass declares its members; an instance has no state of its own.

    needs      columns without which it cannot be computed
    kinds      of tables for which it is defined; "fields" are positions of a magnetometer
    after      effects without which it has no meaning in a model
    contains   effects that it becomes where its shape vanishes
    exact      its form follows from geometry alone: no other effect refines it
    rounds     its output is a staircase, whose slope has no information
    converts   it belongs to the output stage or the converter, and acts on the output after what belongs to the sensor
    left_out   why a compensation in the sensor's product cannot undo it; "" where it can
    incidental  no experiment is planned for it: there is no remark if a table cannot show it
    of_force   it adds what the sensor makes of the force, which changes of the sensitivity multiply
    scales     it is a change of the sensitivity: it multiplies what the sensor makes of the force. With `of_force` it
               follows other forces, and drifts of the sensitivity multiply it; without, it is such a drift
    memory     how many arrays (n, 3) `follow` keeps from one sample to the next; where it is 0, `transduction` follows
               the force of its own row alone, and derivatives rely on that
    """

    name: str
    parameters: tuple[Parameter, ...] = ()
    constants: Mapping[str, Callable[[Table], float]] = {}
    assumed_constants: Mapping[str, float] = {}  # their values in model files that do not give them
    constant_docs: Mapping[str, str] = {}  # what they are, in words
    places: frozenset[str] = frozenset()  # those of HOOKS where it acts
    expression: str = ""  # where one line of arithmetic defines it; kept in model files

    summary: str = ""  # the parts of the docstring
    formula: str = ""
    symptom: str = ""
    excited_by: str = ""
    confused_with: str = ""
    source: str = ""

    needs: tuple[str, ...] = ()
    kinds: tuple[str, ...] = ACCELEROMETER_KINDS
    after: tuple[str, ...] = ()
    contains: tuple[str, ...] = ()
    exact: bool = False
    rounds: bool = False
    converts: bool = False
    left_out: str = ""
    incidental: bool = False
    of_force: bool = False
    scales: bool = False
    memory: int = 0

    def __init_subclass__(cls) -> None:
        members = {member: value for member, value in vars(cls).items() if not member.startswith("_")}
        for member, value in members.items():
            _check_member(cls, member, value)
        cls.name = re.sub(r"(?<!^)(?=[A-Z])", "-", cls.__name__).lower()
        cls.parameters = (
            *cls.parameters,
            *(replace(v, name=m) for m, v in members.items() if isinstance(v, Parameter)),
        )
        constants = {m: v for m, v in members.items() if isinstance(v, Constant)}
        cls.constants = {**cls.constants, **{m: v.of for m, v in constants.items()}}
        assumed = {m: v.assumed for m, v in constants.items() if v.assumed is not None}
        cls.assumed_constants = {**cls.assumed_constants, **assumed}
        cls.constant_docs = {**cls.constant_docs, **{m: v.doc for m, v in constants.items() if v.doc}}
        cls.places = frozenset(hook for hook in HOOKS if getattr(cls, hook) is not getattr(Effect, hook))
        if "Symptom" in (cls.__doc__ or ""):
            for part, text in _sections(cls.__doc__ or "").items():
                setattr(cls, part, text)
        _check_whole(cls)

    @property
    def acts_on(self) -> str:
        """The first place in the signal chain where it acts."""
        return next(hook for hook in HOOKS if hook in self.places)

    @property
    def first_kind(self) -> Kind:
        """The first kind of data that the effect is defined for."""
        return KINDS[self.kinds[0]]

    @property
    def is_noise(self) -> bool:
        """Whether it acts on no sample but on the spectrum of a still record."""
        return not self.first_kind.fitted

    def excluded(self, table: Table) -> str | None:
        """Why this effect cannot be tested on `table`, or None."""
        if table.content not in self.kinds:
            return f"is not defined for {table.content}"
        missing = [name for name in self.needs if name not in table]
        return f"needs the column {', '.join(missing)}" if missing else self.lacks(table)

    # what a subclass may define: first the places where it acts

    def pose(self, pose: Pose, table: Table, p: Values) -> Pose:
        """The true stage angles and the true vertical."""
        return pose

    def force(self, a: Array, table: Table, p: Values) -> Array:
        """The specific force along the sensing axes, g, shape (n, 3).

        Of a magnetometer the field as a share of its strength, of a gyroscope the rate in deg/s.
        """
        return a

    def transduction(self, a: Array, table: Table, p: Values) -> Array:
        """The contribution of the effect to the output, in the output's unit, shape (n, 3)."""
        return NOTHING

    def output(self, v: Array, table: Table, p: Values) -> Array:
        """The output after the effect, shape (n, 3)."""
        return v

    def spectrum(self, at: Bands, p: Values) -> Array:
        """Two-sided density in the bands `at`, in the output's unit^2/Hz, shape (b,).

        It is proportional to the square of the first parameter, the strength.
        """
        raise NotImplementedError

    def lines(self, p: Values) -> tuple[tuple[float, float], ...]:
        """Sinusoids, (Hz, amplitude) each, removed from the record before its spectrum."""
        return ()

    # then how it is used

    def follow(self, a: Array, table: Table, p: Values, before: Sequence[Array]) -> tuple[Array, Sequence[Array]]:
        """`transduction` of one sample more, for an effect with a history: (the added output, the memory after it).

        `before` and after: `memory` arrays (n, 3), 0 at first.
        """
        raise NotImplementedError

    def columns(self, a: Array, table: Table) -> Mapping[str, Array] | None:
        """By name, the part of the output for one unit of each parameter, shape (n, 3), if `transduction` is linear.

        Derivatives are then exact and fast. None if an effect does not state it. For an effect at the output, `a` is
        the output before it.
        """
        return None

    def lacks(self, table: Table) -> str | None:
        """Why the rows of `table` cannot show the effect, even if there were more of them; else None."""
        return None

    def searched(self, table: Table) -> float:
        """The number of different starts from which `guess` chooses the best."""
        return 1.0


METHODS = (*HOOKS, "follow", "columns", "lacks", "searched")
TUPLES = ("needs", "kinds", "after", "contains")
TYPES: Mapping[str, type] = {
    "exact": bool, "rounds": bool, "converts": bool, "left_out": str, "incidental": bool, "of_force": bool,
    "scales": bool, "memory": int,
}  # fmt: skip
MEMBERS = (*METHODS, *TUPLES, *TYPES)


def _check_member(cls: type[Effect], member: str, value: object) -> None:
    """Raise ModelError for a member that no effect has, or that has another type or signature."""
    if isinstance(value, (Parameter, Constant)):
        if hasattr(Effect, member) or member in Effect.__annotations__ or hasattr(Values, member):
            _refuse(cls, f'"{member}" has a meaning of its own in an effect; choose another name for the parameter')
        if isinstance(value, Constant) and not callable(value.of):
            _refuse(cls, f"the constant {member} needs a function of the table, as in Constant(mean_temperature)")
    elif member in METHODS:
        parameters = inspect.signature(getattr(Effect, member)).parameters
        if not inspect.isfunction(value) or list(inspect.signature(value).parameters) != list(parameters):
            _refuse(cls, f"{member} must be a method: def {member}({', '.join(parameters)})")
    elif member in TUPLES:
        if not isinstance(value, tuple) or not all(isinstance(word, str) for word in value):
            _refuse(cls, f'{member} must be a tuple of names, as in ("temperature_c",)')
    elif member in TYPES:
        if type(value) is not TYPES[member]:
            _refuse(cls, f"{member} is {value!r}; it must be of type {TYPES[member].__name__}")
    else:
        _refuse(cls, f'an effect has no member "{member}"{nearest(member, MEMBERS)} Begin the name of a helper with _')


def _check_whole(cls: type[Effect]) -> None:
    for kind in cls.kinds:
        if kind not in KINDS:
            _refuse(cls, f'there is no kind of table "{kind}"{nearest(kind, KINDS)}')
    for p in cls.parameters:
        if p.where and p.where not in cls.constants and not any(f"{p.where}_{axis}" in cls.constants for axis in "xyz"):
            _refuse(cls, f'{p.name}: the effect has no constant "{p.where}"{nearest(p.where, cls.constants)}')
    if (cls.memory > 0) != (cls.follow is not Effect.follow):
        _refuse(cls, "memory and follow belong together: memory is the number of arrays that follow stores")


def _refuse(cls: type[Effect], message: str) -> NoReturn:
    raise ModelError(f"{cls.__name__}: {message}")


SECTIONS = {"symptom": "Symptom", "excited_by": "Excited by", "confused_with": "Confused with", "source": "Source"}


def _sections(doc: str) -> dict[str, str]:
    """The parts of an effect's docstring, each on one line but the formula; "" for a part that is not there."""
    head, _, body = inspect.cleandoc(doc).partition("\n\n")
    pieces = re.split(rf"^({'|'.join(SECTIONS.values())})[ ]+", body, flags=re.MULTILINE)
    titled = dict(zip(pieces[1::2], pieces[2::2], strict=True))
    parts = {part: " ".join(titled.get(title, "").split()) for part, title in SECTIONS.items()}
    summary = " ".join(head.partition(":")[2].split())
    return {"summary": summary, "formula": inspect.cleandoc(pieces[0]).strip(), **parts}
