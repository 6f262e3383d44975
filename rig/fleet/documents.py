"""What fleets come to as JSON documents, `rig.fleet/1`."""

from __future__ import annotations

import math
from typing import Any

from calibrations.fleet.population import Population
from rig.fleet.calibrate import Calibrated, Calibration

SCHEMA = "rig.fleet/1"
Document = dict[str, Any]


def population_document(found: Population, model: str) -> Document:
    """Of `rig fleet discover`."""
    return {
        "schema": SCHEMA,
        "what": "discovery",
        "model": model,
        "verdicts": dict(found.verdicts),
        "batches": [
            {
                "batch": each.batch,
                "sensors": each.sensors,
                "effects": [{**vars(e), "rivals": list(e.rivals)} for e in each.effects],
                "shares": dict(each.shares),
            }
            for each in found.batches
        ],
        "rigs": [vars(error) for error in found.rigs],
        "unconnected": [list(group) for group in found.unconnected] if len(found.unconnected) > 1 else [],
        "sensors": [
            {
                **vars(each),
                "effects": list(each.effects),
                "own": list(each.own),
                "rivals": {name: list(of) for name, of in each.rivals.items()},
                "needs_a_person": each.needs_a_person,
            }
            for each in found.sensors
        ],
    }


def calibration_document(found: Calibration, model: str) -> Document:
    """Of `rig fleet calibrate`."""
    return {
        "schema": SCHEMA,
        "what": "calibration",
        "model": model,
        "batches": [_batch(each) for each in found.batches],
        "failed": [{"sensor": m.sensor, "data": m.data, "why": why} for m, why in found.faults.items()],
    }


def _batch(found: Calibrated) -> Document:
    scale = found.pooled.scale
    population = [
        {
            **_named(name),
            "mean": each.mean * size,
            "mean_std": each.mean_std * size,
            "spread": each.spread * size,
            "spread_interval": (each.spread_interval(0.025, 0.975) * size).tolist(),
            "pooled": each.pooled,
            "apart": [m.sensor for m, out in zip(found.members, each.apart, strict=True) if out],
        }
        for name, each, size in zip(found.names, found.pooled.parameters, scale, strict=True)
    ]
    return {"batch": found.batch, "population": population, "sensors": _sensors(found)}


def _sensors(found: Calibrated) -> list[Document]:
    together, (low, high) = found.pooled, found.pooled.intervals()
    values, stds, alone, apart = together.values, together.stds, together.alone, together.apart
    return [
        {
            "sensor": member.sensor,
            "rig": member.rig,
            "data": member.data,
            "excess": found.looks[k].excess,
            "stands_out": found.unlike[k],
            "parameters": [
                {
                    **_named(name),
                    "value": float(values[k, j]),
                    "std": float(stds[k, j]),
                    "interval": [float(low[k, j]), float(high[k, j])],
                    "alone": float(found.looks[k].theta[j]),
                    "std_alone": float(alone[k, j]) if math.isfinite(alone[k, j]) else None,
                    "apart": bool(apart[k, j]),
                }
                for j, name in enumerate(found.names)
            ],
        }
        for k, member in enumerate(found.members)
    ]


def _named(name: tuple[str, str, str, str]) -> Document:
    return dict(zip(("effect", "name", "axis", "unit"), name, strict=True))
