"""What candidate effects and patterns could add to a residual, made once for all sensors that share a design.

Derivatives of the residual cost more than all that is done with them, and at the same poses they are nearly the same
for every sensor: an effect on pose or force goes with the range of the output, one of transduction does not depend on
the sensor. So they are made for the first sensor of a design and scaled for the others; who came first hardly makes a
difference. An effect that needs columns beside the angles (time, temperature), or constants of the table, is shared
only by sensors for which these are the same, and one on the output by none. Only poses are a design: of positions and
rates the outputs themselves tell how a sensor stood, and nothing is shared.

An effect whose start is searched for in the data itself (`Effect.searched`) is left out: it would have to be refitted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from calibrations.effect import Effect
from calibrations.fit import Fit
from calibrations.problem import Problem
from calibrations.search.candidates import askable
from calibrations.search.patterns import patterns
from calibrations.search.screen import Screen, Search
from calibrations.search.structure import without_slow
from calibrations.table import Array, Table

ANGLES = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")
Key = tuple[str | bytes, ...]
MOST = 300

V = TypeVar("V")


@dataclass(frozen=True)
class Group:
    """Columns (channels, n, k) that belong together: one effect at one of its starts, or one pattern.

    `scaled`: they go with the range of the output, and are given per unit of it.
    """

    effect: str  # "" for a pattern
    start: int
    columns: Array
    scaled: bool = False

    def of(self, table: Table) -> Array:
        """The columns for a sensor that was measured on the same design."""
        return self.columns * _ranges(table, len(self.columns)) if self.scaled else self.columns


@dataclass(frozen=True)
class Groups:
    """All that is searched together on one design. `trials`: to how many independent tests the search amounts."""

    all: tuple[Group, ...]
    trials: float


class Shared:
    """The columns of the designs met lately, of `effects` beside one model."""

    def __init__(self, effects: Mapping[str, Effect]) -> None:
        self.effects = effects
        self._asked: dict[Key, tuple[Effect, ...]] = {}
        self._groups: dict[Key, tuple[Group, ...]] = {}
        self._trials: dict[Key, float] = {}

    def of(self, found: Fit) -> Groups:
        """Those for a fitted table."""
        table = found.table
        design = _key(table, ())
        can: Key = (*table.columns, *design)
        asked = _once(self._asked, can, lambda: _asked(found, self.effects))
        groups = [group for effect in asked for group in self._effect(found, effect)]
        shapes: tuple[Group, ...] = _once(self._groups, design, lambda: tuple(_patterns(found)))
        groups += shapes
        search: Key = (*(effect.name for effect in asked), *design)
        return Groups(tuple(groups), _once(self._trials, search, lambda: _trials(found, groups)))

    def _effect(self, found: Fit, effect: Effect) -> tuple[Group, ...]:
        if effect.output is not None:
            return tuple(_derivatives(found, effect))
        constants = np.array([float(constant(found.table)) for constant in effect.constants.values()])
        key = (effect.name, constants.tobytes(), *_key(found.table, effect.needs))
        return _once(self._groups, key, lambda: tuple(_derivatives(found, effect)))


def _once(made: dict[Key, V], key: Key, make: Callable[[], V]) -> V:
    """What was made for a key, or is now; where there are MOST of them all are forgotten, so that memory stays flat."""
    value = made.get(key)
    if value is None:
        value = make()
        if len(made) >= MOST:
            made.clear()
        made[key] = value
    return value


def _asked(found: Fit, effects: Mapping[str, Effect]) -> tuple[Effect, ...]:
    return tuple(effect for effect in askable(found, effects) if effect.searched(found.table) <= 1)


def _key(table: Table, needs: tuple[str, ...]) -> Key:
    """What columns at rows in order of time are a function of."""
    design = ANGLES if table.kind == "poses" else table.columns
    names = [name for name in dict.fromkeys((*design, *needs)) if name in table]
    return tuple(part for name in names for part in (name, table.column(name).tobytes()))


def _ranges(table: Table, channels: int) -> Array:
    """The range of each channel's output, (channels, 1, 1); 1 where the residual is none of an output."""
    ranges = np.asarray(np.ptp(table.outputs, axis=0))
    return (ranges if len(ranges) == channels else np.ones(channels))[:, None, None]


def _derivatives(found: Fit, effect: Effect) -> Iterator[Group]:
    """Of the residual with respect to the effect's parameters, from each of its starts."""
    problem = Problem.of(found.model.with_effect(effect), found.table)
    mine = problem.layout.of_effect(effect.name)
    scaled = effect.pose is not None or effect.force is not None
    for start, theta in enumerate(problem.layout.starts()):
        columns = problem.jacobian(theta, mine)
        if np.any(columns):
            yield Group(effect.name, start, columns / _ranges(found.table, len(columns)) if scaled else columns, scaled)


def _patterns(found: Fit) -> Iterator[Group]:
    """Of poses those that angles and the order of rows can show: they are the same for all sensors of a design."""
    table = found.table
    if table.kind == "poses":
        chosen = [name for name in (*ANGLES, *table.output_names) if name in table]
        table = Table.from_columns(table.kind, {name: table.column(name) for name in chosen})
    return (Group("", k, each.columns) for k, each in enumerate(patterns(table, found.channels)))


def _trials(found: Fit, groups: list[Group]) -> float:
    """To how many independent tests the search amounts under white noise, whatever else the first sensor has."""
    screen = Screen(without_slow(found))
    return Search(screen, [screen.basis(group.of(found.table)) for group in groups]).trials
