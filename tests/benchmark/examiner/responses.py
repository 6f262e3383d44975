"""Forms of causes: response of the sensing element to the force along its own axis, the other axis and z.

None is a polynomial of the order that gives the effect its name: a fit with the textbook form leaves a remainder.
"""

from __future__ import annotations

import numpy as np

from tests.benchmark.examiner.cause import Cause, Constants, response
from tests.benchmark.examiner.layouts import Array
from tests.benchmark.examiner.record import Record


def _sech(x: Array) -> Array:
    return 1 / np.cosh(x)


def _round_dead_zone(record: Record, force: Array, size: float, constants: Constants) -> Array:
    width = size * constants.widths
    return force - width * np.tanh(force / width)


def _spread_dead_zone(record: Record, force: Array, size: float, constants: Constants) -> Array:
    """Friction elements in parallel, each with a threshold of its own (Iwan's model without memory)."""
    held = np.zeros_like(force)
    for part in (0.5, 0.8, 1.0, 1.2, 1.6):
        width = size * constants.widths * part
        held = held + np.clip(force - 0.004, -width, width) / 5
    return force - held


def _soft_clip(record: Record, response: Array, size: float, constants: Constants) -> Array:
    limit = 2 * np.exp(-size * constants.widths)
    return response / (1 + np.abs(response / limit) ** 12) ** (1 / 12)


def _exponential_knee(record: Record, response: Array, size: float, constants: Constants) -> Array:
    limit, softness = 1.05 - size * constants.widths, 0.2
    beyond = np.clip(response - limit, 0, None)
    return response - beyond + softness * (1 - np.exp(-beyond / softness))


DEAD_ZONE = {"high": 0.5, "low": 1e-6, "is_smooth": False}

CAUSES = (
    response("cross-axis-bias", "sech", "A (1 - sech 2y)", lambda x, y, z, r: 1 - _sech(2 * y)),
    response(
        "cross-axis-bias",
        "power, with odd part",
        "A (|y|^1.5 + 0.3 y^3)",
        lambda x, y, z, r: np.abs(y) ** 1.5 + 0.3 * y**3,
    ),
    response("cross-axis-bias", "|a| by smooth sign", "A y tanh 3y", lambda x, y, z, r: y * np.tanh(3 * y)),
    response("cross-axis-scale", "tanh", "A x tanh 1.5y", lambda x, y, z, r: x * np.tanh(1.5 * y)),
    response(
        "cross-axis-scale", "odd quadratic", "A x (y + 0.3 y|y|)", lambda x, y, z, r: x * (y + 0.3 * y * np.abs(y))
    ),
    response("z-axis-bias", "sech", "A (1 - sech 2z)", lambda x, y, z, r: 1 - _sech(2 * z)),
    response(
        "z-axis-bias", "power, skew", "A |z|^1.6 (1 + 0.2 z)", lambda x, y, z, r: np.abs(z) ** 1.6 * (1 + 0.2 * z)
    ),
    response("z-axis-scale", "tanh", "A x tanh 1.2z", lambda x, y, z, r: x * np.tanh(1.2 * z)),
    response("z-axis-scale", "exponential", "A x (exp 0.8z - 1)", lambda x, y, z, r: x * (np.exp(0.8 * z) - 1)),
    response("quadratic-nonlinearity", "cosh", "A (cosh 1.5x - 1)", lambda x, y, z, r: np.cosh(1.5 * x) - 1),
    response(
        "quadratic-nonlinearity",
        "even root",
        "A (sqrt(1 + (x/0.7)^2) - 1)",
        lambda x, y, z, r: np.sqrt(1 + (x / 0.7) ** 2) - 1,
    ),
    response("cubic-nonlinearity", "sinh", "A sinh 2x", lambda x, y, z, r: np.sinh(2 * x)),
    response("cubic-nonlinearity", "closing gap", "A x/(1 - 0.35 x^2)", lambda x, y, z, r: x / (1 - 0.35 * x * x)),
    response(
        "odd-quadratic-nonlinearity",
        "rounded",
        "A x sqrt(x^2 + 0.05^2)",
        lambda x, y, z, r: x * np.sqrt(x * x + 0.0025),
    ),
    response(
        "odd-quadratic-nonlinearity", "power", "A sign(x)|x|^1.8", lambda x, y, z, r: np.sign(x) * np.abs(x) ** 1.8
    ),
    response("scale-factor-asymmetry", "even root", "A sqrt(x^2 + 0.04^2)", lambda x, y, z, r: np.sqrt(x * x + 0.0016)),
    response(
        "scale-factor-asymmetry",
        "log cosh, kink off zero",
        "A w log cosh((x-0.03)/w), w = 0.06",
        lambda x, y, z, r: 0.06 * np.log(np.cosh((x - 0.03) / 0.06)),
    ),
    Cause("dead-zone", "tanh", "x <- x - w tanh(x/w)", "force", _round_dead_zone, **DEAD_ZONE),
    Cause(
        "dead-zone",
        "spread of thresholds",
        "x <- x - mean_k clip(x-0.004, +-w_k), w_k = 0.5..1.6 w",
        "force",
        _spread_dead_zone,
        **DEAD_ZONE,
    ),
    Cause(
        "saturation",
        "soft clip, both sides",
        "u <- u/(1 + |u/L|^12)^(1/12)",
        "limit",
        _soft_clip,
        high=2.5,
        low=1e-3,
        is_smooth=False,
    ),
    Cause(
        "saturation",
        "exponential knee, high side",
        "u <- L + s(1 - exp(-(u-L)/s)) above L, s = 0.2",
        "limit",
        _exponential_knee,
        high=1.2,
        low=0.01,
        is_smooth=False,
    ),
)
