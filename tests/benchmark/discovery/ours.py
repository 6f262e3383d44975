"""Our answer to one set, as plain values, and how far its model is from the truth on fresh poses."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from calibrations.discovery.results import Diagnosis, Discovery
from calibrations.fitting.problem_kinds import make_problem
from calibrations.loop import diagnose, discover
from calibrations.model import Model
from calibrations.model.file import read_model
from calibrations.table import Table
from tests.benchmark.discovery.cases import Truth


def answer(table: Table, truth: Truth) -> dict[str, Any]:
    """Ranking, causes, verdict, and the processor time of both questions, s."""
    model = read_model("linear")
    began = time.process_time()
    asked = diagnose(_fresh(table), model)
    diagnosed = time.process_time()
    found = discover(_fresh(table), model)
    taken = {"diagnose_s": diagnosed - began, "discover_s": time.process_time() - diagnosed}
    experiment = found.next_experiment or asked.next_experiment
    return {
        "ranking": [c.name for c in asked.candidates[:5]],
        "p_value": asked.candidates[0].p_value if asked.candidates else 1.0,
        "diagnosis": asked.verdict,
        "verdict": found.verdict,
        "causes": list(found.causes),
        "refinements": list(found.refinements),
        "alternatives": {name: list(rivals) for name, rivals in found.alternatives.items()},
        "listed": _listed(asked, found),
        "structure": found.residual_structure or asked.residual_structure,
        "experiment": [experiment.procedure, dict(experiment.settings)] if experiment else None,
        "error": error(found.end.model, table, truth),
        **{name: round(seconds, 2) for name, seconds in taken.items()},
    }


def _listed(asked: Diagnosis, found: Discovery) -> list[str]:
    """The first cause and what it is said to be taken for."""
    if found.causes:
        return [found.causes[0], *found.alternatives.get(found.causes[0], ())]
    return [asked.missing[0], *asked.candidates[0].indistinguishable_from] if asked.missing else []


def _fresh(table: Table) -> Table:
    """The same table as if just read: nothing that was worked out for it before is remembered."""
    return Table.from_columns(table.kind, table.columns, table.constants, table.source, table.labels)


def error(model: Model, table: Table, truth: Truth) -> float | None:
    """What a reading at poses that were not shown would miss by, in noise floors: the model's error, and white noise.

    At the table's own poses, without their noise, where no others are known.
    """
    where = truth.fresh
    if where is None and truth.clean_v is not None:
        columns = {**table.columns, "vx_v": truth.clean_v[:, 0], "vy_v": truth.clean_v[:, 1]}
        where = Table.from_columns("poses", columns, table.constants, table.source)
    if where is None:
        return None
    problem = make_problem(model, where)
    theta = problem.layout.known()
    assert theta is not None
    missed = problem.residual(theta)
    if truth.fresh is not None and truth.run is not None:
        missed = missed[:, ~truth.run.visits.given[where.order]]
    return float(np.sqrt(1 + np.mean(missed**2) / truth.floor_v**2))
