"""Results of fleets as JSON documents, `rig.fleet/1`, and as pages."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from calibrations.fleet.batch import Population
from calibrations.presentation.certificate.terms import name as result_name
from calibrations.presentation.charts.fleet import Spread
from calibrations.presentation.document import Section, Table
from calibrations.presentation.report.fleet import calibration_report, population_report
from calibrations.text import estimate_text, rounded
from rig.files import program
from rig.fleet.calibrate import CalibratedBatch, FleetCalibration
from rig.fleet.worker import effects_of
from rig.services.provenance import today

SCHEMA = "rig.fleet/1"
Document = dict[str, Any]


def population_document(population: Population, model: str) -> Document:
    """The document of `rig fleet discover`."""
    return {
        "schema": SCHEMA,
        "what": "discovery",
        "model": model,
        "verdicts": dict(population.verdicts),
        "batches": [
            {
                "batch": batch.batch,
                "sensors": batch.sensors,
                "effects": [{**vars(e), "rivals": list(e.rivals)} for e in batch.effects],
                "shares": dict(batch.shares),
            }
            for batch in population.batches
        ],
        "rigs": [vars(error) for error in population.rigs],
        "unconnected": [list(group) for group in population.unconnected] if len(population.unconnected) > 1 else [],
        "sensors": [
            {
                **vars(batch),
                "effects": list(batch.effects),
                "own": list(batch.own),
                "rivals": {name: list(rival_names) for name, rival_names in batch.rivals.items()},
                "needs_a_person": batch.needs_a_person,
            }
            for batch in population.sensors
        ],
    }


def calibration_document(calibration: FleetCalibration, model: str) -> Document:
    """The document of `rig fleet calibrate`."""
    return {
        "schema": SCHEMA,
        "what": "calibration",
        "model": model,
        "batches": [_batch(batch) for batch in calibration.batches],
        "failed": [{"sensor": m.sensor, "data": m.data, "why": reason} for m, reason in calibration.faults.items()],
    }


def _batch(batch: CalibratedBatch) -> Document:
    scale = batch.pooled.scale
    population = [
        {
            **_name_document(name),
            "mean": parameter.mean * size,
            "mean_std": parameter.mean_std * size,
            "spread": parameter.spread * size,
            "spread_interval": (parameter.spread_interval(0.025, 0.975) * size).tolist(),
            "pooled": parameter.pooled,
            "apart": batch.marked(parameter.outliers),
        }
        for name, parameter, size in zip(batch.names, batch.pooled.parameters, scale, strict=True)
    ]
    return {"batch": batch.batch, "population": population, "sensors": _sensors(batch)}


def _sensors(batch: CalibratedBatch) -> list[Document]:
    pooled, (low, high) = batch.pooled, batch.pooled.intervals()
    values, stds, own_stds, is_outlier = pooled.values, pooled.stds, pooled.alone, pooled.outliers
    return [
        {
            "sensor": member.sensor,
            "rig": member.rig,
            "data": member.data,
            "excess": batch.looks[k].excess,
            "stands_out": batch.unlike[k],
            "parameters": [
                {
                    **_name_document(name),
                    "value": float(values[k, j]),
                    "std": float(stds[k, j]),
                    "interval": [float(low[k, j]), float(high[k, j])],
                    "alone": float(batch.looks[k].theta[j]),
                    "std_alone": float(own_stds[k, j]) if math.isfinite(own_stds[k, j]) else None,
                    "apart": bool(is_outlier[k, j]),
                }
                for j, name in enumerate(batch.names)
            ],
        }
        for k, member in enumerate(batch.members)
    ]


def _name_document(name: tuple[str, str, str, str]) -> Document:
    return dict(zip(("effect", "name", "axis", "unit"), name, strict=True))


# Pages on a fleet, as the commands write them.

HOLDS_95 = 1.96


def population_page(population: Population, model: str) -> str:
    """The HTML page of `rig fleet discover`."""
    return population_report(population, model, _facts(model))


def calibration_page(calibration: FleetCalibration, model: str) -> str:
    """The HTML page of `rig fleet calibrate`."""
    quantities: dict[str, list[Spread]] = {}
    for batch in calibration.batches:
        for k, name in enumerate(batch.names):
            quantities.setdefault(_parameter_title(batch, name), []).append(_spread(batch, k))
    rows = [row for batch in calibration.batches for row in _rows(batch)]
    head = ("batch", "sensors", "parameter", "mean", "spread", "standard uncertainty / alone", "unlike the rest")
    failed = [f"{member.sensor}: {reason}" for member, reason in calibration.faults.items()]
    not_calibrated = (f"Not calibrated: {'; '.join(failed)}",) if failed else ()
    batches = Section("Batches", (*not_calibrated, Table("Batches", head, rows, headed=False)))
    count = sum(len(batch.members) for batch in calibration.batches)
    return calibration_report(quantities, batches, len(calibration.batches), f"{count} sensors", _facts(model))


def _facts(model: str) -> dict[str, str]:
    return {"model": model, "program": program(), "made": today()}


def _parameter_title(batch: CalibratedBatch, name: tuple[str, str, str, str]) -> str:
    effect, parameter, axis, unit = name
    return f"{result_name(effects_of(batch.question.own)[effect], parameter, axis)} in {unit}"


def _spread(batch: CalibratedBatch, k: int) -> Spread:
    parameter, size = batch.pooled.parameters[k], batch.pooled.scale[k]
    low, high = (end[:, k] for end in batch.pooled.intervals())
    value = batch.pooled.values[:, k]
    reach = HOLDS_95 * float(np.sqrt(parameter.variance + parameter.mean_std**2))
    band = ((parameter.mean - reach) * size, (parameter.mean + reach) * size) if parameter.pooled else None
    expanded = np.maximum(high - value, value - low)
    return Spread(batch.batch, value, expanded, [m.sensor for m in batch.members], parameter.outliers, band)


def _rows(batch: CalibratedBatch) -> list[tuple[object, ...]]:
    return [
        (
            batch.batch or "no batch",
            len(batch.members),
            _parameter_title(batch, name),
            estimate_text(parameter.mean * size, parameter.mean_std * size),
            rounded(parameter.spread * size, 2),
            rounded(float(gain), 2),
            ", ".join(batch.marked(parameter.outliers)) or "-",
        )
        for name, parameter, size, gain in zip(
            batch.names, batch.pooled.parameters, batch.pooled.scale, batch.gains, strict=True
        )
    ]
