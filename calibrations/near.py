"""The signal chain about one set of values: where one effect changes, only what comes behind it is worked out anew.

Derivatives of a model are made of many such changes. The differences come out as by `chain.forward`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from calibrations.chain import Step, added, converted, sensed, static_force
from calibrations.effect import Values
from calibrations.table import Array, Table


@dataclass(frozen=True)
class Near:
    """The chain with the values of `steps`."""

    table: Table
    steps: Sequence[Step]

    @cached_property
    def _static(self) -> Array:
        return static_force(self.table, self.steps)

    @cached_property
    def _sensed(self) -> Array:
        return sensed(self._static, self.table, self.steps)

    @cached_property
    def _added(self) -> list[Array]:
        return added(self._sensed, self.table, self.steps)

    def output(self, term: int, values: Values) -> Array:
        """Output of the measured axes with other `values` of one effect, up to a constant, shape (n, axes).

        Where an effect only adds to the output, that is what it adds: beside the sum of all, digits would be lost.
        """
        effect = self.steps[term][0]
        steps = [*self.steps[:term], (effect, values), *self.steps[term + 1 :]]
        if effect.pose or effect.force:
            static = static_force(self.table, steps) if effect.pose else self._static
            parts = added(sensed(static, self.table, steps), self.table, steps)
        elif not any(other.output for other, _ in steps):
            parts = added(self._sensed, self.table, [steps[term]])
        else:
            parts = [*self._added[:term], *added(self._sensed, self.table, [steps[term]]), *self._added[term + 1 :]]
        return converted(parts, self.table.n, self.table, steps)[:, : len(self.table.axes)]
