"""The way back as straight lines of code: what stands before the loop, what the loop repeats, and their count.

What does not follow the sought values is computed once, before the loop. Every line has a name of its own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

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
    """`inputs` and, sought from 0 on, `sought`: run `before` once, and `steps` times `loop`, which ends in `next`."""

    inputs: tuple[str, ...]
    sought: tuple[str, ...]
    before: tuple[Line, ...]
    loop: tuple[Line, ...]
    next: tuple[str | float, ...]
    steps: int

    @property
    def operations(self) -> Mapping[str, int]:
        """How many operations of each kind one sample takes."""
        once, again = (
            Counter(OPERATIONS[line.operation].counts_as for line in lines) for lines in (self.before, self.loop)
        )
        return {kind: once[kind] + self.steps * again[kind] for kind in sorted({*once, *again})}

    def run(self, inputs: Mapping[str, Array]) -> dict[str, Array]:
        """What is sought, for inputs of any one shape: the program as it stands, for tests and pictures."""
        values: dict[str, Array] = {name: np.asarray(inputs[name], float) for name in self.inputs}
        _do(self.before, values)
        values |= {name: np.zeros(np.shape(values[self.inputs[0]])) for name in self.sought}
        for _ in range(self.steps):
            _do(self.loop, values)
            values |= dict(zip(self.sought, [_value(name, values) for name in self.next], strict=True))
        return {name: values[name] for name in self.sought}


def program(forward: Forward, bound: Bound) -> Program:
    """The steps a <- a + C (V - G(a)) as a program."""
    outputs = tuple(f"v{axis}" for axis in forward.axes)
    nexts = _next(forward, bound, outputs)
    nodes = ordered(nexts)
    moving = _following(nodes, set(forward.sought))
    used = [node.name for node in nodes if node.operation == "given" and node.name not in {*forward.sought, *outputs}]
    names: dict[Node, str | float] = {}
    before: list[Line] = []
    loop: list[Line] = []
    for node in nodes:
        if node.operation == "given":
            names[node] = node.name
        elif node.constant:
            names[node] = node.value
        else:
            names[node] = f"t{len(before) + len(loop)}"
            line = Line(str(names[node]), node.operation, tuple(names[inner] for inner in node.inner))
            (loop if node in moving else before).append(line)
    return Program(
        inputs=(*outputs, *used),
        sought=forward.sought,
        before=tuple(before),
        loop=tuple(loop),
        next=tuple(names[node] for node in nexts),
        steps=bound.steps,
    )


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
