"""What a product remembers when it comes to each row of a table: it was given samples all the way there.

Between poses the way is that of the stages, as the effects themselves have it (`calibrations.visits`); what is sensed
on it stands for what the product finds there, which is as close to it as at the poses.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from calibrations.chain import Step
from calibrations.compensation.forward import Forward, steps_of
from calibrations.table import AXES, Array, Table
from calibrations.visits import turning_points


def memory_at(table: Table, a: Array, forward: Forward) -> dict[str, Array]:
    """By its names, shape (n,), for what is sensed at the rows, `a` (n, 3); nothing where nothing is remembered.

    Rows in order of time.
    """
    if not forward.memory:
        return {}
    steps = [step for step in steps_of(forward.model) if step[0].name in forward.remembering]
    held = np.array(list(_along(table, a, steps)))  # (n, slots, 3)
    columns = {f"m{slot}{axis}": held[:, slot, k] for slot in range(held.shape[1]) for k, axis in enumerate(AXES)}
    return {name: columns[name] for name in forward.memory}


def _along(table: Table, a: Array, steps: Sequence[Step]) -> Iterator[list[Array]]:
    """What is remembered before each row, (3,) for every slot."""
    held = [[np.zeros((1, 3))] * effect.memory for effect, _ in steps]
    way = turning_points(table) if "alpha_deg" in table else np.empty((table.n, 0, 3))
    for i in range(table.n):
        row = table.rows(np.array([i]))
        for here in way[i]:
            held = _after(steps, here, row, held)
        yield [slot[0] for each in held for slot in each]
        held = _after(steps, a[i], row, held)


def _after(steps: Sequence[Step], here: Array, row: Table, before: list[list[Array]]) -> list[list[Array]]:
    """What each effect remembers after one sample more, of the specific force `here`, (3,)."""
    return [
        list(effect.follow(here[None], row, p, held)[1])
        for (effect, p), held in zip(steps, before, strict=True)
        if effect.follow is not None
    ]
