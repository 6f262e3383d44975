"""The whole answer: floor, places, causes, unseen error, in the fields of the project's JSON."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import chi2

from tests.benchmark.free_forms.geometry import geometry
from tests.benchmark.free_forms.held_out import held_out
from tests.benchmark.free_forms.measurement import Array, Measurement
from tests.benchmark.free_forms.naming import Place, places
from tests.benchmark.free_forms.search import SearchResult, search

TOO_SMALL = 0.93  # of a stated noise: a residual below contradicts it
MOST_LEFT = 0.1  # of the excess variance: with more left unseen, nothing is named
ADEQUATE = 1.15


def discover(data: Measurement) -> tuple[SearchResult, dict[str, Any]]:
    """Places that act and their causes. The first is for pictures, the second for machines."""
    white, source, why = _floor(data)
    result = search(data, white)
    if (again := _contradicted(result)) is not None:
        white, source, why = again, "scatter", "the standard deviations of the means contain more than their noise"
        result = search(data, white)
    acting = places(result)
    floor = float(np.sqrt(np.mean(white**2)))
    shape = geometry(result, {p.name: p.size * floor for p in acting})
    named = [p for p in acting if p.material]
    causes = list(dict.fromkeys([c for p in named for c in p.causes] + list(shape.causes)))
    unknown = [p for p in named if not p.causes]
    alternatives = {c: list(p.inseparable_from) for p in named for c in p.causes if p.inseparable_from}
    alternatives |= {c: list(v) for c, v in shape.alternatives.items()}
    before, after = held_out(result, []), held_out(result, result.active)
    total = sum(p.size**2 for p in acting) or 1.0
    short = after > ADEQUATE + 0.1
    if short and after**2 - 1 > MOST_LEFT * (before**2 - 1):
        causes, alternatives = [], {}  # most of the misfit is nowhere: what was identified may be part of it
    answer = {
        "schema": "rig.discovery/1",
        "verdict": "unexplained" if unknown or short else "ambiguous" if alternatives else "adequate",
        "causes": causes,
        "alternatives": alternatives,
        "held_out": after,
        "steps": [{"added": c, "held_out_before": before, "held_out_after": after} for c in causes],
        "places": [_place(p, floor, data, total) for p in acting],
        "floor": {"source": source, "why": why},
    }
    return result, answer


def _place(p: Place, floor: float, data: Measurement, total: float) -> dict[str, Any]:
    return {
        "place": p.name,
        "axes": list(data.axes),
        "size": p.size * floor,
        "unit": data.unit,
        "size_over_floor": p.size,
        "share": p.size**2 / total,
        "p_value": float(0.5 * chi2.sf(max(p.gain, 0.0), 1)),
        "explained_by": list(p.causes),
        "explained_share": p.share,
        "inseparable_from": list(p.inseparable_from),
        "components": list(p.components),
        "material": p.material,
    }


def _floor(data: Measurement) -> tuple[Array, str, str]:
    """The noise of each mean: from the samples where known, else from neighbours along beta."""
    if data.white is not None:
        return data.white, "samples", "standard deviation and number of the samples of each mean"
    y = data.outputs
    second = y[:, 2:] - 2 * y[:, 1:-1] + y[:, :-2]
    std = np.median(np.abs(second), axis=1) / 0.6745 / np.sqrt(6)
    return np.tile(std[:, None], (1, data.n)), "scatter", "neighbouring poses: no standard deviation or no number"


def _contradicted(result: SearchResult) -> Array | None:
    """White noise of equal rows where the residual is smaller than stated and the stated noise differs by row."""
    left = result.columns[:, -1] - _fitted(result)
    freedom = max(len(left) - result.gram.base_rank - 30, 1)
    if float(left @ left) / freedom > TOO_SMALL**2:
        return None
    r = left.reshape(result.white.shape) * result.white
    std = np.median(np.abs(r - np.median(r, axis=1, keepdims=True)), axis=1) / 0.6745
    return np.tile(std[:, None], (1, r.shape[1]))


def _fitted(result: SearchResult) -> Array:
    b = result.columns.shape[1] - 1 - len(result.gram.with_data)
    rows = result.gram.indices(result.sizes.variances)
    base = result.gram.base_inverse @ (
        result.gram.base_with_data - result.gram.base_products[:, rows] @ result.sizes.coefficients
    )
    return np.asarray(result.columns[:, :b] @ base + result.columns[:, b + rows] @ result.sizes.coefficients)
