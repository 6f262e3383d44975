"""Turns in which an output reached the end of its range: the integral is too small by an unknown amount.

A clipped output repeats its extreme value, and leaves it steeply. An output of coarse steps repeats it too, at the peak
of a turn, but leaves it as a parabola does: twice as far from the peak it is four steps lower.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from calibrations.criteria import CLIPPED_STEPS, LEAST_CLIPPED_NOISE, SHORTEST_CLIPPED
from calibrations.table import AXES, Array, Table

RATES = tuple(f"g{axis}" for axis in AXES)


def find_clipped_output(turn: Array, rest: Array) -> int | None:
    """The number of an output (column) that a turn (n, outputs) clips, None if none does; `rest` (m, outputs)."""
    for k, (values, at_rest) in enumerate(zip(turn.T, rest.T, strict=True)):
        least = LEAST_CLIPPED_NOISE * float(at_rest.std())
        if any(abs(end - at_rest.mean()) > least and _is_limit(values, end) for end in (values.min(), values.max())):
            return k
    return None


def find_clipped_turns(table: Table) -> dict[int, str]:
    """The numbers of the clipped turns of a table of samples, each with the output that is clipped."""
    turns, is_resting, rates = table.column("turn"), table.column("resting") > 0.5, table.outputs
    edges = np.flatnonzero(np.diff(turns, prepend=np.nan, append=np.nan) != 0)
    found: dict[int, str] = {}
    for first, last in pairwise(edges.tolist()):
        resting = is_resting[first:last]
        if resting.any() and not resting.all():
            k = find_clipped_output(rates[first:last][~resting], rates[first:last][resting])
            found |= {} if k is None else {int(turns[first]): RATES[k]}
    return found


def clipped_turns_warning(table: Table) -> str | None:
    """A warning that clipped turns are not used; None if there are none."""
    if not (found := find_clipped_turns(table)):
        return None
    listed = ", ".join(f"{number} ({output})" for number, output in found.items())
    return (
        f"an output reached the end of its range in turn{'s' if len(found) > 1 else ''} {listed}, and no model is "
        "fitted to it; turn more slowly, or choose a wider range of the sensor"
    )


def _is_limit(values: Array, end: float) -> bool:
    """Whether `values` (n,) repeat the extreme `end` in a run, and are many steps away from it next to the run."""
    levels = np.unique(values)
    edges = np.flatnonzero(np.diff(values == end, prepend=False, append=False))
    runs = edges.reshape(-1, 2)
    first, last = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    if last - first < SHORTEST_CLIPPED or len(levels) < 2:
        return False
    reach = (last - first) // 2
    beside = values[[max(first - reach, 0), min(last - 1 + reach, len(values) - 1)]]
    return bool(np.abs(beside - end).max() > CLIPPED_STEPS * np.diff(levels).min())
