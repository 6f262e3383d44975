"""The way back as straight lines of code: what stands before the loop, what the loop repeats, and their count.

What does not follow the sought values is computed once, before the loop. What is remembered for the next sample is
computed after it, from what was found. Every line has a name of its own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from calibrations.compensation.bound import Bound
from calibrations.compensation.forward import Forward
from calibrations.compensation.graph import Node, apply, given, number, ordered
from calibrations.compensation.operations import OPERATIONS
from calibrations.table import Array


@dataclass(frozen=True)
class Line:
    """`name` = operation of `inner`, which are names of lines before it, of inputs, or numbers."""

    name: str
    operation: str
    inner: tuple[str | float, ...]


@dataclass(frozen=True)
class Program:
    """`inputs` and, sought from 0 on, `sought`: run `before` once, and `steps` times `loop`, which ends in `next`.

    Then run `after` once: `remembered`, by name, is what the next sample is given.
    """

    inputs: tuple[str, ...]
    sought: tuple[str, ...]
    before: tuple[Line, ...]
    loop: tuple[Line, ...]
    next: tuple[str | float, ...]
    steps: int
    after: tuple[Line, ...] = ()
    remembered: Mapping[str, str | float] = field(default_factory=dict)

    @property
    def operations(self) -> Mapping[str, int]:
        """How many operations of each kind one sample takes."""
        once, again = (
            Counter(OPERATIONS[line.operation].counts_as for line in lines)
            for lines in (self.before + self.after, self.loop)
        )
        return {kind: once[kind] + self.steps * again[kind] for kind in sorted({*once, *again})}

    def run(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """What is sought and what is remembered, for inputs of any one shape: as it stands, for tests and pictures.

        What was remembered before is among the inputs; 0 where it is not.
        """
        values: dict[str, Array] = {name: np.asarray(inputs[name], float) for name in self.inputs}
        values |= {name: np.asarray(inputs.get(name, 0.0), float) for name in self.remembered}
        _do(self.before, values)
        values |= {name: np.zeros(np.shape(values[self.inputs[0]])) for name in self.sought}
        for _ in range(self.steps):
            _do(self.loop, values)
            values |= dict(zip(self.sought, [_value(name, values) for name in self.next], strict=True))
        _do(self.after, values)
        after = {name: _value(word, values) for name, word in self.remembered.items()}
        return {name: values[name] for name in self.sought} | after


def program(forward: Forward, bound: Bound) -> Program:
    """The steps a <- a + C (V - G(a)) as a program."""
    outputs = tuple(f"v{axis}" for axis in forward.axes)
    nexts, later = _next(forward, bound, outputs), list(forward.memory.values())
    nodes = ordered([*nexts, *later])
    moving = _following(nodes, set(forward.sought))
    known = {*forward.sought, *outputs, *forward.memory}
    used = [node.name for node in nodes if node.operation == "given" and node.name not in known]
    named = _Names()
    in_loop = [node for node in ordered(nexts) if node in moving]
    before = [named.line(node) for node in nodes if node not in moving and node.inner]
    loop = [named.line(node) for node in in_loop if node.inner]
    next_ = tuple(named.word(node) for node in nexts)
    named.forget(in_loop)  # they follow what is sought, which is found only now
    after = [named.line(node) for node in ordered(later) if node in moving and node.inner]
    return Program(
        inputs=(*outputs, *used),
        sought=forward.sought,
        before=tuple(before),
        loop=tuple(loop),
        next=next_,
        steps=bound.steps,
        after=tuple(after),
        remembered={name: named.word(node) for name, node in forward.memory.items()},
    )


class _Names:
    """Nodes by the names of the lines that compute them."""

    def __init__(self) -> None:
        self._of: dict[Node, str] = {}
        self._lines = 0

    def line(self, node: Node) -> Line:
        """The node as the next line."""
        inner = tuple(self.word(each) for each in node.inner)
        self._of[node] = f"t{self._lines}"
        self._lines += 1
        return Line(self._of[node], node.operation, inner)

    def word(self, node: Node) -> str | float:
        """How later lines write it."""
        return node.value if node.constant else node.name or self._of[node]

    def forget(self, nodes: Sequence[Node]) -> None:
        """They are to be computed anew."""
        for node in nodes:
            self._of.pop(node, None)


def _next(forward: Forward, bound: Bound, outputs: tuple[str, ...]) -> list[Node]:
    errors = [apply("-", given(name), G) for name, G in zip(outputs, forward.outputs, strict=True)]
    nexts = []
    for name, row in zip(forward.sought, bound.C, strict=True):
        moved = given(name)
        for share, error in zip(row, errors, strict=True):
            moved = apply("+", moved, apply("*", number(float(share)), error))
        nexts.append(moved)
    return nexts


def _following(nodes: list[Node], sought: set[str]) -> set[Node]:
    """The nodes that follow what is sought."""
    found: set[Node] = set()
    for node in nodes:
        if node.name in sought or any(inner in found for inner in node.inner):
            found.add(node)
    return found


def _do(lines: tuple[Line, ...], values: dict[str, Array]) -> None:
    for line in lines:
        values[line.name] = OPERATIONS[line.operation].apply(*(_value(name, values) for name in line.inner))


def _value(name: str | float, values: Mapping[str, Array]) -> Array:
    return values[name] if isinstance(name, str) else np.asarray(name)
