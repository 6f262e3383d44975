"""Forms of causes: temperature, warm-up after power-on, and drift over time."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tests.benchmark.examiner.cause import response
from tests.benchmark.examiner.layouts import Array
from tests.benchmark.examiner.loops import plays
from tests.benchmark.examiner.record import Record
from tests.benchmark.examiner.room import slow_noise

TEMPERATURE = ("temperature",)
CYCLE = ("temperature", "cycle")
YOUNG = ("young",)


@lru_cache(maxsize=2)
def _thermal_plays(record: Record) -> Array:
    """Prandtl-Ishlinskii hysteresis of the temperature, from the first pose on."""
    q = record.temperature.q - record.temperature.q[0]
    return plays(q, np.array([0.25, 0.5, 0.8]), np.array([0.5, 0.5, 0.4]))


def _package_gradient(record: Record) -> Array:
    """The die follows the package late; the gradient between them stresses the die."""
    room = record.temperature
    return room.lagged_q + 2 * (room.lagged_q - room.q)


def _decay(record: Record, share: float) -> Array:
    """exp(-t / (share P)), P: length of the record."""
    return np.exp(-record.clock.since_start / (share * _length(record)))


def _stretched(record: Record) -> Array:
    """Stretched exponential exp(-(t / tau)^0.6), the sum of many relaxations.

    Source: Kohlrausch, Theorie des elektrischen Rückstandes in der Leidener Flasche, Annalen der Physik (1854).
    """
    return np.exp(-((record.clock.since_start / (0.15 * _length(record))) ** 0.6))


def _power_law(record: Record) -> Array:
    return (1 + record.clock.since_start / (0.12 * _length(record))) ** -1.2


def _length(record: Record) -> float:
    """Length of the record after power-on, s; of the first day if it has two."""
    since, half = record.clock.since_start, record.n // 2
    return float(since[half - 1] if record.poses.layout == "two_days" else since.max())


def _age(record: Record) -> Array:
    """Time since the first pose over the length of the record, with the night."""
    return record.clock.elapsed / record.clock.elapsed[-1]


def _wandering_line(record: Record) -> Array:
    walk = slow_noise(np.random.default_rng(record.n), record.clock.elapsed, "walk")
    return _age(record) + 0.05 * walk


CAUSES = (
    response(
        "temperature-bias",
        "polynomial",
        "A (q + 0.4 q^2), q = (T-mean)/(1.5 sd)",
        lambda x, y, z, r: r.temperature.q + 0.4 * r.temperature.q**2,
        TEMPERATURE,
    ),
    response(
        "temperature-bias",
        "lag",
        "A q(T through a first-order lag of 3..8 % of the record)",
        lambda x, y, z, r: r.temperature.lagged_q,
        TEMPERATURE,
    ),
    response(
        "temperature-bias",
        "exponential",
        "A (exp 1.2q - 1)",
        lambda x, y, z, r: np.exp(1.2 * r.temperature.q) - 1,
        TEMPERATURE,
    ),
    response(
        "temperature-scale",
        "polynomial",
        "A x (q + 0.3 q^2)",
        lambda x, y, z, r: x * (r.temperature.q + 0.3 * r.temperature.q**2),
        TEMPERATURE,
    ),
    response(
        "temperature-scale",
        "lag, tanh",
        "A x tanh(1.2 q_lagged)",
        lambda x, y, z, r: x * np.tanh(1.2 * r.temperature.lagged_q),
        TEMPERATURE,
    ),
    response(
        "temperature-hysteresis",
        "three plays",
        "A sum w_k play_rk(q), r = 0.25, 0.5, 0.8",
        lambda x, y, z, r: _thermal_plays(r),
        CYCLE,
    ),
    response(
        "temperature-hysteresis",
        "gradient in the package",
        "A (q_lagged + 2 (q_lagged - q))",
        lambda x, y, z, r: _package_gradient(r),
        CYCLE,
    ),
    response(
        "warm-up-bias",
        "two time constants",
        "A (0.6 exp(-t/0.06P) + 0.4 exp(-t/0.3P)), P: length",
        lambda x, y, z, r: 0.6 * _decay(r, 0.06) + 0.4 * _decay(r, 0.3),
        YOUNG,
    ),
    response("warm-up-bias", "stretched", "A exp(-(t/0.15P)^0.6)", lambda x, y, z, r: _stretched(r), YOUNG),
    response(
        "warm-up-scale",
        "two time constants",
        "A x (0.7 exp(-t/0.1P) + 0.3 exp(-t/0.4P))",
        lambda x, y, z, r: x * (0.7 * _decay(r, 0.1) + 0.3 * _decay(r, 0.4)),
        YOUNG,
    ),
    response("warm-up-scale", "power law", "A x (1 + t/0.12P)^-1.2", lambda x, y, z, r: x * _power_law(r), YOUNG),
    response("bias-drift", "line with a little walk", "A (t/P + 0.05 walk)", lambda x, y, z, r: _wandering_line(r)),
    response("bias-drift", "power law", "A (t/P)^1.6", lambda x, y, z, r: _age(r) ** 1.6),
    response("bias-drift", "logarithm", "A log(1 + t/0.3P)", lambda x, y, z, r: np.log1p(_age(r) / 0.3)),
)
