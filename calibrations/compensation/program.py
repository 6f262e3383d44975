"""The inverse as lines of code: before the loop, in the loop, after the loop; and the count of operations.

Lines that do not depend on the sought values are computed once, before the loop. Values stored for the next sample are
computed after it. Every line has a unique name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from calibrations.compensation.bound import Bound
from calibrations.compensation.forward import Forward
from calibrations.compensation.graph import OPERATIONS, Node, Table, number, sort_nodes, variable
from calibrations.table import Array


@dataclass(frozen=True)
class ProgramLine:
    """`name` = operation of `inner`: names of earlier lines, inputs or tables, or numbers."""

    name: str
    operation: str
    inner: tuple[str | float, ...]


@dataclass(frozen=True)
class Program:
    """Start `sought` at 0; run `before` once, then `loop` `steps` times, each time setting `sought` to `next`.

    Then run `after` once: `remembered` gives the stored values of the next sample.
    """

    inputs: tuple[str, ...]
    unknowns: tuple[str, ...]
    before: tuple[ProgramLine, ...]
    loop: tuple[ProgramLine, ...]
    next: tuple[str | float, ...]
    steps: int
    after: tuple[ProgramLine, ...] = ()
    remembered: Mapping[str, str | float] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)

    @property
    def operations(self) -> Mapping[str, int]:
        """Number of operations of each kind per sample."""
        single, per_step = (
            Counter(OPERATIONS[line.operation].counts_as for line in lines)
            for lines in (self.before + self.after, self.loop)
        )
        return {kind: single[kind] + self.steps * per_step[kind] for kind in sorted({*single, *per_step})}

    def run(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """The sought and the stored values, for inputs of one shape; stored inputs are 0 by default."""
        values: dict[str, Any] = {name: np.asarray(inputs[name], float) for name in self.inputs}
        values |= self.tables
        values |= {name: np.asarray(inputs.get(name, 0.0), float) for name in self.remembered}
        _execute(self.before, values)
        values |= {name: np.zeros(np.shape(values[self.inputs[0]])) for name in self.unknowns}
        for _ in range(self.steps):
            _execute(self.loop, values)
            values |= dict(zip(self.unknowns, [_value(name, values) for name in self.next], strict=True))
        _execute(self.after, values)
        memories = {name: _value(word, values) for name, word in self.remembered.items()}
        return {name: values[name] for name in self.unknowns} | memories


def write_program(forward: Forward, bound: Bound) -> Program:
    """The steps a <- a + C (V - G(a)) as a program."""
    outputs = tuple(f"v{axis}" for axis in forward.axes)
    nexts, later = _next(forward, bound, outputs), list(forward.memory.values())
    nodes = sort_nodes([*nexts, *later])
    iterated = _find_dependent_nodes(nodes, set(forward.unknowns))
    own_names = {*forward.unknowns, *outputs, *forward.memory}
    used = [node.name for node in nodes if node.operation == "given" and node.name not in own_names]
    names = _Names()
    in_loop = [node for node in sort_nodes(nexts) if node in iterated]
    lines_before = [names.line(node) for node in nodes if node not in iterated and node.inner]
    loop = [names.line(node) for node in in_loop if node.inner]
    next_ = tuple(names.word(node) for node in nexts)
    names.forget(in_loop)  # they depend on the result of the loop
    lines_after = [names.line(node) for node in sort_nodes(later) if node in iterated and node.inner]
    return Program(
        inputs=(*outputs, *used),
        unknowns=forward.unknowns,
        before=tuple(lines_before),
        loop=tuple(loop),
        next=next_,
        steps=bound.steps,
        after=tuple(lines_after),
        remembered={name: names.word(node) for name, node in forward.memory.items()},
        tables={name: table for table, name in names.tables.items()},
    )


class _Names:
    """Names of the lines that compute nodes."""

    def __init__(self) -> None:
        self._names: dict[Node, str] = {}
        self._lines = 0
        self.tables: dict[Table, str] = {}

    def line(self, node: Node) -> ProgramLine:
        """The node as the next line."""
        inner = tuple(self.word(operand) for operand in node.inner)
        if node.table is not None:
            inner = (*inner, self.tables.setdefault(node.table, f"table{len(self.tables)}"))
        self._names[node] = f"t{self._lines}"
        self._lines += 1
        return ProgramLine(self._names[node], node.operation, inner)

    def word(self, node: Node) -> str | float:
        """The node in later lines."""
        return node.value if node.constant else node.name or self._names[node]

    def forget(self, nodes: Sequence[Node]) -> None:
        """Compute these nodes again."""
        for node in nodes:
            self._names.pop(node, None)


def _next(forward: Forward, bound: Bound, outputs: tuple[str, ...]) -> list[Node]:
    errors = [variable(name) - G for name, G in zip(outputs, forward.outputs, strict=True)]
    nexts = []
    for name, row in zip(forward.unknowns, bound.C, strict=True):
        next_node = variable(name)
        for share, error in zip(row, errors, strict=True):
            next_node += number(float(share)) * error
        nexts.append(next_node)
    return nexts


def _find_dependent_nodes(nodes: list[Node], unknowns: set[str]) -> set[Node]:
    """The nodes that depend on the sought values."""
    dependent: set[Node] = set()
    for node in nodes:
        if node.name in unknowns or any(inner in dependent for inner in node.inner):
            dependent.add(node)
    return dependent


def _execute(lines: tuple[ProgramLine, ...], values: dict[str, Any]) -> None:
    for line in lines:
        values[line.name] = OPERATIONS[line.operation].apply(*(_value(name, values) for name in line.inner))


def _value(name: str | float, values: Mapping[str, Any]) -> Any:
    return values[name] if isinstance(name, str) else np.asarray(name)
