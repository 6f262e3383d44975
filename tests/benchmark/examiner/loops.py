"""Forms of causes: hysteresis, by operators on the force along the true path of the stages.

Only the loop is a cause here: from each operator's output, the best single-valued cubic of the own force is removed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tests.benchmark.examiner.cause import Cause, Constants
from tests.benchmark.examiner.layouts import THERE_AND_BACK, Array, turned
from tests.benchmark.examiner.record import Record

STEP_DEG = 3.0  # between points of the path
APPROACH_DEG = (1.0, 2.0, 3.0, 2.0, 1.0, 0.0)  # beyond a pose that is approached again from the other side


def bouc_wen(x: Array, width: float = 0.18, n: float = 1.5, beta: float = 0.6, gamma: float = 0.4) -> Array:
    """Bouc-Wen hysteresis, dz = dx / width (1 - |z|^n (gamma + beta sign(dx z))).

    Source: Wen, Method for Random Vibration of Hysteretic Systems, Journal of the Engineering Mechanics Division 102
    (1976).
    """
    z, before, out = 0.0, 0.0, np.empty(len(x))
    for i, value in enumerate(x):
        steps = max(int(abs(value - before) / (0.1 * width)), 1)
        dx = (value - before) / steps
        for _ in range(steps):
            z += dx / width * (1 - abs(z) ** n * (gamma + beta * (1 if dx * z > 0 else -1)))
            z = min(max(z, -1.5), 1.5)
        out[i], before = z, value
    return out


def plays(x: Array, radii: Array, weights: Array) -> Array:
    """Prandtl-Ishlinskii hysteresis: a weighted sum of play operators s <- clip(s, x - r, x + r), at rest at 0.

    Source: Krasnoselskii and Pokrovskii, Systems with Hysteresis (1989).
    """
    state, out = np.zeros(len(radii)), np.empty(len(x))
    for i, value in enumerate(x):
        state = np.clip(state, value - radii, value + radii)
        out[i] = weights @ state
    return out


def preisach(x: Array, n: int = 24) -> Array:
    """Preisach hysteresis: relays that switch up at a and down at b < a, with Gaussian weights over a and b.

    Source: Preisach, Über die magnetische Nachwirkung, Zeitschrift für Physik 94 (1935).
    """
    grid = np.linspace(-1, 1, n)
    a, b = np.meshgrid(grid, grid)
    is_relay = a > b + 0.02
    a, b = a[is_relay], b[is_relay]
    weights = np.exp(-(((a - b) / 0.5) ** 2) - ((a + b) / 0.9) ** 2)
    weights /= weights.sum()
    state, out = np.where(a + b > 0, -1.0, 1.0), np.empty(len(x))
    for i, value in enumerate(x):
        state = np.where(value >= a, 1.0, np.where(value <= b, -1.0, state))
        out[i] = weights @ state
    return out


@lru_cache(maxsize=2)
def path(record: Record) -> tuple[Array, NDArray[np.int_]]:
    """Force along the path, g, (points, 3), and the point of each pose: alpha moves first, then beta."""
    poses, points, at = record.poses, [], []
    a0 = b0 = 0.0
    for i, (a, b) in enumerate(zip(poses.alpha, poses.beta, strict=True)):
        row = [(x, b0) for x in _between(a0, a)] + [(a, x) for x in _between(b0, b)]
        if poses.layout != "alpha_inner" and poses.turns_round(i) and a == poses.alpha[i - 1]:
            row += [(a, b - poses.side[i] * beyond) for beyond in APPROACH_DEG]
        if not points and not row:
            row = [(a, b)]
        points += [(x, y, poses.mount[i], poses.flip[i]) for x, y in row]
        at.append(len(points) - 1)
        a0, b0 = a, b
    alpha, beta, mount, flip = np.array(points).T
    return turned(alpha, beta, 0.0, 0.0, mount, flip), np.array(at)


def _between(start: float, end: float) -> list[float]:
    """Points after `start` up to `end`."""
    if start == end:
        return []
    count = int(min(max(abs(end - start) // STEP_DEG, 1), 60))
    return list(np.linspace(start, end, count + 1)[1:])


OPERATORS: dict[str, Callable[[Array], Array]] = {
    "Bouc-Wen": bouc_wen,
    "Prandtl-Ishlinskii": lambda x: (
        -plays(x, np.array([0.05, 0.12, 0.25, 0.45, 0.7]), np.array([1, 0.8, 0.6, 0.5, 0.4]))
    ),
    "Preisach": preisach,
}


@lru_cache(maxsize=2)
def loop(record: Record, form: str) -> Array:
    """The loop of each axis, (n, 2): an operator's output without its best cubic in the own force."""
    force, at = path(record)
    out = []
    for k in (0, 1):
        h, own = OPERATORS[form](force[:, k])[at], record.force[:, k]
        P = np.column_stack([np.ones(record.n), own, own**3])
        out.append(h - P @ np.linalg.lstsq(P, h, rcond=None)[0])
    return np.stack(out, 1)


def _hysteresis(form: str, text: str) -> Cause:
    def law(record: Record, force: Array, size: float, constants: Constants) -> Array:
        return size * constants.weights * loop(record, form)

    return Cause(
        "hysteresis",
        form,
        f"A (loop part of {text})",
        "response",
        law,
        ("direction",),
        layouts=(*THERE_AND_BACK, "alpha_inner"),
        is_smooth=False,
    )


CAUSES = (
    _hysteresis("Bouc-Wen", "Bouc-Wen, r = 0.18 g, n = 1.5"),
    _hysteresis("Prandtl-Ishlinskii", "Prandtl-Ishlinskii, five plays 0.05..0.7 g"),
    _hysteresis("Preisach", "Preisach, 24 x 24 relays, Gaussian weights"),
)
