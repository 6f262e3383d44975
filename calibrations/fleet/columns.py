"""What candidate effects and patterns could add to a residual, made once for all sensors that share a design.

Derivatives of the residual cost more than all that is done with them, and at the same poses they are nearly the same
for every sensor: an effect on pose or force goes with the range of the output, the others do not depend on the sensor
to first order. So they are made for the first sensor of a design and scaled for the others. An effect that needs
columns beside the angles (time, temperature), or constants of the table, is shared only by sensors for which these are
the same.

An effect whose start is searched for in the data itself (`Effect.searched`) is left out: it would have to be refitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from calibrations.effect import Effect
from calibrations.fit import Fit
from calibrations.problem import Problem
from calibrations.search.candidates import askable
from calibrations.search.patterns import patterns
from calibrations.search.screen import Screen, Search
from calibrations.table import Array, Table

ANGLES = ("alpha_deg", "beta_deg", "direction", "mount_deg", "flip")
Key = tuple[str | bytes, ...]


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


@dataclass
class Shared:
    """The columns of the designs met so far, of `effects` beside one model."""

    effects: Mapping[str, Effect]
    _made: dict[Key, tuple[Group, ...]] = field(default_factory=dict)
    _can: dict[Key, list[Effect]] = field(default_factory=dict)
    _trials: dict[Key, float] = field(default_factory=dict)

    def of(self, found: Fit) -> Groups:
        """Those for a fitted table."""
        design = _key(found.table, ())
        asked = self._asked(found)
        groups = [group for effect in asked for group in self._effect(found, effect)]
        if (key := ("", *design)) not in self._made:
            self._made[key] = tuple(_patterns(found))
        groups += self._made[key]
        if (key := (*(effect.name for effect in asked), *design)) not in self._trials:
            self._trials[key] = _trials(found, groups)
        return Groups(tuple(groups), self._trials[key])

    def _asked(self, found: Fit) -> list[Effect]:
        key = (*found.table.columns, *_key(found.table, ()))
        if key not in self._can:
            self._can[key] = [e for e in askable(found, self.effects) if e.searched(found.table) <= 1]
        return self._can[key]

    def _effect(self, found: Fit, effect: Effect) -> tuple[Group, ...]:
        constants = [float(constant(found.table)) for constant in effect.constants.values()]
        key = (effect.name, np.array(constants).tobytes(), *_key(found.table, effect.needs))
        if key not in self._made:
            self._made[key] = tuple(_derivatives(found, effect))
        return self._made[key]


def _key(table: Table, needs: tuple[str, ...]) -> Key:
    """What columns at rows in order of time are a function of."""
    names = [name for name in dict.fromkeys((*ANGLES, *needs)) if name in table]
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
    """Those that angles and the order of rows can show: they are the same for all sensors of a design."""
    table = found.table
    chosen = [name for name in (*ANGLES, *table.output_names) if name in table]
    alone = Table.from_columns(table.kind, {name: table.column(name) for name in chosen})
    return (Group("", k, each.columns) for k, each in enumerate(patterns(alone, found.channels)))


def _trials(found: Fit, groups: list[Group]) -> float:
    screen = Screen(found)
    return Search(screen, [screen.basis(group.of(found.table)) for group in groups]).trials
