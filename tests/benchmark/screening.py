"""What each of 25 candidates would explain at 5000 rows: all at once, and by a least-squares solution each.

The candidates are the catalogue's, on the table of a sweep of 2500 poses and two axes, made white: at most 20 of them.
The others are turned to within 1 - 1e-10 (cosine) of a column of the model. Two models are timed, the smallest and the
one with most parameters, both ways in turns, by the least time of each, so that nothing else on the machine counts.
"""

from __future__ import annotations

import json
from functools import partial

import numpy as np

from calibrations.discovery.significance import reductions
from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit
from calibrations.fitting.problem_kinds import make_problem
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.benchmark.timed import seconds

POSES, CANDIDATES, NEAR = 2500, 25, 5
COSINE = 1 - 1e-10
REPEATS = 41
LEAST_TIMES_FASTER = 6.0
MOST_DIFFERENCE = 1e-9  # of what a candidate explains
LITTLE = 1e-4  # of all squares: a candidate that explains less is compared to so much


def table() -> Table:
    """A sweep of a sensor with a little of everything, so that each candidate explains something."""
    random = np.random.default_rng(6)
    alpha, beta = np.degrees(np.arccos(random.uniform(-1, 1, POSES))), np.arange(POSES) * 7.0 % 360
    a, b = np.radians(alpha), np.radians(beta)
    t = 6.0 * np.arange(POSES)
    x, y = np.sin(a) * np.cos(b), np.sin(a) * np.sin(b)
    bent = [g + 0.01 * g**2 + 0.02 * np.abs(g) + 1e-3 * random.standard_normal(POSES) for g in (x, y)]
    columns = {
        "alpha_deg": alpha,
        "beta_deg": beta,
        "direction": np.where(np.arange(POSES) % 2, 1.0, -1.0),
        "t_s": t,
        "temperature_c": 25 + np.sin(t / 900),
        "supply_v": 5 + 0.01 * np.sin(t / 333),
        "vx_v": 2.5 + bent[0],
        "vy_v": 2.5 + bent[1],
        "vx_std_v": np.full(POSES, 7e-3),
        "vy_std_v": np.full(POSES, 7e-3),
        "n": np.full(POSES, 49.0),
    }
    return Table.from_columns("poses", columns)


def candidates(before: Fit) -> list[Array]:
    """White columns of the catalogue's effects at each of their starts, and near copies of the model's own."""
    plain: list[Array] = []
    for effect in catalogue().values():
        if before.model.holds(effect.name) or effect.excluded(before.table) or effect.searched(before.table) > 1:
            continue
        problem = make_problem(before.model.with_effect(effect), before.table)
        mine = problem.layout.of_effect(effect.name)
        plain += [before.noise.whiten(problem.jacobian(theta, mine)) for theta in problem.layout.starts()[:3]]
    plain = [columns for columns in plain if _adds(columns, before.whitened[:, 1:])][: CANDIDATES - NEAR]
    return plain + [
        _turned(columns, before.whitened[:, 1 + k % 4]) for k, columns in enumerate(plain[: CANDIDATES - len(plain)])
    ]


def _adds(columns: Array, model: Array) -> bool:
    """Whether there is more of each column beside the model than the rounding of numerical derivatives."""
    both = np.hstack([model, columns])
    both = both / np.maximum(np.linalg.norm(both, axis=0), np.finfo(float).tiny)
    return bool(np.min(np.abs(np.diag(np.linalg.qr(both)[1]))) > 1e-5)


def _turned(columns: Array, towards: Array) -> Array:
    size = np.linalg.norm(columns, axis=0)
    near = COSINE * towards[:, None] / np.linalg.norm(towards) + np.sqrt(1 - COSINE**2) * columns / size
    return np.asarray(near * size)


def by_solving(model: Array, residual: Array, columns: list[Array]) -> Array:
    """The peer: numpy's least-squares solution of [model | candidate] for each."""
    alone = _left(model, residual)
    return np.array([alone - _left(np.hstack([model, each]), residual) for each in columns])


def _left(columns: Array, residual: Array) -> float:
    """Sum of squares that is left."""
    rest = residual - columns @ np.linalg.lstsq(columns, residual)[0]
    return float(rest @ rest)


def compared(name: str) -> dict[str, float | bool | int]:
    """One model: how many times faster, and the greatest difference over what the candidate explains."""
    before = fit(read_model(name), table())
    residual = before.whitened[:, 0]
    model = before.whitened[:, 1:] / np.linalg.norm(before.whitened[:, 1:], axis=0)
    columns = [each / np.linalg.norm(each, axis=0) for each in candidates(before)]
    quick, plain = reductions(model, residual, columns), by_solving(model, residual, columns)
    difference = float(np.max(np.abs(quick - plain) / np.maximum(plain, LITTLE * float(residual @ residual))))
    ways = [partial(way, model, residual, columns) for way in (reductions, by_solving)]
    fast, slow = np.min([[seconds(way, 1)[0] for way in ways] for _ in range(REPEATS)], axis=0)
    return {
        "rows": len(residual),
        "parameters": model.shape[1],
        "candidates": len(columns),
        "seconds": float(fast),
        "least_squares_s": float(slow),
        "times_faster": round(float(slow / fast), 2),
        "greatest_difference": difference,
        "met": bool(slow >= LEAST_TIMES_FASTER * fast and difference <= MOST_DIFFERENCE),
    }


def main() -> None:
    """With as many threads as the environment gives."""
    print(json.dumps({name: compared(name) for name in ("linear", "physical")}))


if __name__ == "__main__":
    main()
