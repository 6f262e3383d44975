"""Pages on a fleet, as the commands write them."""

from __future__ import annotations

import numpy as np

from calibrations.certificates.terms import name as result_name
from calibrations.fleet.population import Population
from calibrations.numerals import measured, plain
from calibrations.pictures.fleet import Spread
from calibrations.reports.fleet import calibration_report, population_report
from rig.analysis.provenance import program, today
from rig.fleet.calibrate import Calibrated, Calibration
from rig.fleet.own import effects_of

HOLDS_95 = 1.96


def population_page(found: Population, model: str) -> str:
    """Of `rig fleet discover`."""
    return population_report(found, model, _facts(model))


def calibration_page(found: Calibration, model: str) -> str:
    """Of `rig fleet calibrate`."""
    quantities: dict[str, list[Spread]] = {}
    for batch in found.batches:
        for k, name in enumerate(batch.names):
            quantities.setdefault(_titled(batch, name), []).append(_spread(batch, k))
    rows = [row for batch in found.batches for row in _rows(batch)]
    head = ("batch", "sensors", "parameter", "mean", "spread", "standard uncertainty / alone", "unlike the rest")
    failed = [f"{member.sensor}: {why}" for member, why in found.faults.items()]
    tables = {
        "title": "Batches",
        "words": [f"Not calibrated: {'; '.join(failed)}"] if failed else [],
        "pictures": [],
        "tables": [{"head": head, "rows": rows, "more": "", "batches": found.batches}],
    }
    count = sum(len(batch.members) for batch in found.batches)
    return calibration_report(quantities, tables, f"{count} sensors", _facts(model))


def _facts(model: str) -> dict[str, str]:
    return {"model": model, "program": program(), "made": today()}


def _titled(batch: Calibrated, name: tuple[str, str, str, str]) -> str:
    effect, parameter, axis, unit = name
    return f"{result_name(effects_of(batch.question.own)[effect], parameter, axis)} in {unit}"


def _spread(batch: Calibrated, k: int) -> Spread:
    each, size = batch.pooled.parameters[k], batch.pooled.scale[k]
    low, high = (end[:, k] for end in batch.pooled.intervals())
    value = batch.pooled.values[:, k]
    reach = HOLDS_95 * float(np.sqrt(each.variance + each.mean_std**2))
    band = ((each.mean - reach) * size, (each.mean + reach) * size) if each.pooled else None
    expanded = np.maximum(high - value, value - low)
    return Spread(batch.batch, value, expanded, [m.sensor for m in batch.members], each.apart, band)


def _rows(batch: Calibrated) -> list[tuple[object, ...]]:
    gains = np.median(batch.pooled.stds / batch.pooled.alone, axis=0)
    return [
        (
            batch.batch or "no batch",
            len(batch.members),
            _titled(batch, name),
            measured(each.mean * size, each.mean_std * size),
            plain(each.spread * size, 2),
            plain(float(gain), 2),
            ", ".join(m.sensor for m, out in zip(batch.members, each.apart, strict=True) if out) or "-",
        )
        for name, each, size, gain in zip(batch.names, batch.pooled.parameters, batch.pooled.scale, gains, strict=True)
    ]
