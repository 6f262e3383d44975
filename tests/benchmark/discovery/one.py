"""One set, answered by every method: a record of plain values, from which all figures are worked out."""

from __future__ import annotations

from typing import Any

from tests.benchmark.discovery import oracle, ours, peers, told
from tests.benchmark.discovery.cases import case
from tests.benchmark.discovery.equals import equals
from tests.benchmark.discovery.library import library
from tests.benchmark.discovery.rig import NotShown
from tests.benchmark.discovery.sets import Case


def attempt(which: Case) -> dict[str, Any]:
    """`record`, or why there is none."""
    try:
        return record(which)
    except NotShown as error:
        return {"key": which.key, "failed": str(error)}


def record(which: Case) -> dict[str, Any]:
    """What is true of a set, and what each method says of it."""
    table, truth = case(which.name, which.strength, which.seed)
    lib = library(table)
    said = {
        "ours": ours.answer(table, truth),
        **peers.answers(table, truth, lib),
        "told": told.answer(table, truth),
        "oracle": oracle.answer(table, truth),
    }
    return {
        "key": which.key,
        "row": which.row,
        "name": which.name,
        "strength": which.strength,
        "seed": which.seed,
        "mechanisms": [name for name, _ in truth.built],
        "layout": truth.layout,
        "rows": table.n,
        "slow": truth.slow,
        "causes": [sorted(names) for names in truth.causes],
        "equals": [sorted(names) for names in equals(table, truth, lib)],
        "outside": truth.outside,
        "structure": truth.structure,
        "experiment": truth.experiment,
        "answers": {name: answer for name, answer in said.items() if answer is not None},
    }
