"""What each candidate would explain: by projection on a basis freed of the model, and by a least-squares solve each.

Both give the fall of the sum of squares when a candidate joins the model. The projection works out the model's part
once for all candidates.
"""

from __future__ import annotations

import json
import sys

import numpy as np

from calibrations.candidates import candidates
from calibrations.effect import catalogue
from calibrations.fit import Fit, fit
from calibrations.model_file import read_model
from calibrations.screen import Screen
from calibrations.table import Array
from rig.data import load
from tests.benchmark.timed import seconds


def by_projection(before: Fit, columns: list[Array]) -> Array:
    screen = Screen(before)
    return np.array([screen.statistic(screen.basis(each)) for each in columns])


def by_least_squares(before: Fit, columns: list[Array]) -> Array:
    return np.array([_explained(before, each) for each in columns])


def _explained(before: Fit, columns: Array) -> float:
    model = before.whitened[:, 1:]
    return _left(before, model) - _left(before, np.hstack([model, before.noise.whiten(columns)]))


def _left(before: Fit, columns: Array) -> float:
    """Sum of squares that is left."""
    residual, scaled = before.whitened[:, 0], columns / np.linalg.norm(columns, axis=0)
    return float(np.sum((residual - scaled @ np.linalg.lstsq(scaled, residual)[0]) ** 2))


def main(data: str) -> None:
    before = fit(read_model("linear"), load(data))
    found = [c for c in candidates(before, catalogue()) if c.columns.shape[2] == c.basis.shape[1]]
    columns = [c.columns for c in found]
    quick, plain = by_projection(before, columns), by_least_squares(before, columns)
    difference = float(np.max(np.abs(quick - plain)) / np.sum(before.whitened[:, 0] ** 2))
    projection = seconds(lambda: by_projection(before, columns), 9)
    least_squares = seconds(lambda: by_least_squares(before, columns), 9)
    ratio = float(np.median(least_squares) / np.median(projection))
    document = {"seconds": projection, "least_squares_s": float(np.median(least_squares)), "times_faster": ratio}
    print(json.dumps({**document, "candidates": len(found), "greatest_difference": difference}))


if __name__ == "__main__":
    main(sys.argv[1])
