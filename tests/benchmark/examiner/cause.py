"""The type of a cause, and the constants that are drawn for it.

A cause changes one stage of the chain. Its law is called with the record, the value at that stage, the size and the
constants, and returns the value that goes on:

    pose        `Stand`: angles of the stages, tilt of the base, an added signal
    alignment   specific force in the sensor, g, (n, 3)
    force       force on the sensing axes, g, (n, 2)
    response    the law is called with the force (n, 3) and returns what the output gets in addition, g, (n, 2)
    limit       response of the sensing axes, g, (n, 2)
    output      output voltage, V, (n, 2)
    converter   samples, V, (n, 2, samples)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tests.benchmark.examiner.layouts import Array
from tests.benchmark.examiner.record import Record


@dataclass(frozen=True)
class Stand:
    """Where the stages truly are, degrees, (n,); the tilt of the base, rad; an added signal, g, (n, 2)."""

    alpha: Array
    beta: Array
    tilt_x: Array
    tilt_y: Array
    added: Array


@dataclass(frozen=True)
class Constants:
    """Constants of one cause in one sensor."""

    weights: Array  # of the two axes, one of them 1 or -1
    widths: Array  # of a threshold on each axis
    sign: float
    other_sign: float
    axis: Array  # unit vector (3,), mostly in the plane of the axes
    plane_axis: Array  # unit vector (3,) in that plane
    phase: float
    other_phase: float
    offset: float  # 0..1
    bits: Array  # relative errors of five bits
    channel: int
    share: float  # of the record, 0.3..0.7
    seed: int
    rate_hz: float  # one period a day, or 1.3 records
    pose_period_s: float  # of 7.3 poses


@dataclass(frozen=True)
class Cause:
    """A mechanism in one form.

    `name` is the catalogue's; `form` and `text` go into the truth. `needs` are demands on the record. A size is what
    the columns `base` leave. `low` and `high` bound the amplitude. `layouts`: the only ones that show it (None: all).
    `is_smooth`: sixty single poses determine it.
    """

    name: str
    form: str
    text: str
    stage: str
    law: Callable[[Record, Any, float, Constants], Any]
    needs: tuple[str, ...] = ()
    base: str = "affine"
    low: float = 1e-7
    high: float = 10.0
    layouts: tuple[str, ...] | None = None
    is_smooth: bool = True
    remark: str = ""


Shape = Callable[[Array, Array, Array, Record], Array]


def response(name: str, form: str, text: str, shape: Shape, needs: tuple[str, ...] = ()) -> Cause:
    """A cause that adds `shape(x, y, z, record)` to each axis: own, other and third force, g, (n,)."""

    def law(record: Record, force: Array, size: float, constants: Constants) -> Array:
        x, y, z = force.T
        shapes = [shape(x, y, z, record), shape(y, x, z, record)]
        return np.stack([size * constants.weights[k] * shapes[k] for k in (0, 1)], 1)

    return Cause(name, form, text, "response", law, needs)


def draw_constants(random: np.random.Generator, record: Record) -> Constants:
    """Constants of one cause."""
    weights = [1.0, float(random.uniform(0.3, 1.0) * random.choice([-1, 1]))]
    if random.random() < 0.5:
        weights = weights[::-1]
    if random.random() < 0.5:
        weights = [-weights[0], -weights[1]]
    axis = random.normal(size=3)
    axis[2] *= 0.3
    axis /= np.linalg.norm(axis)
    heading = random.uniform(0, 2 * np.pi)
    elapsed = record.clock.elapsed
    is_two_days = record.poses.layout == "two_days"
    return Constants(
        weights=np.array(weights),
        widths=np.array([1.0, random.uniform(0.6, 1.0)]),
        sign=float(random.choice([-1, 1])),
        other_sign=float(random.choice([-1, 1])),
        axis=axis,
        plane_axis=np.array([math.cos(heading), math.sin(heading), 0.0]),
        phase=float(random.uniform(0, 6.28)),
        other_phase=float(random.uniform(0, 6.28)),
        offset=float(random.random()),
        bits=random.normal(size=5) * np.array([1.0, 0.7, 0.6, 0.4, 0.3]),
        channel=int(random.integers(2)),
        share=float(random.uniform(0.3, 0.7)),
        seed=int(random.integers(1 << 30)),
        rate_hz=1 / 86400.0 if is_two_days else 1 / max(float(elapsed[-1]) * 1.3, 1),
        pose_period_s=7.3 * float(np.median(np.diff(elapsed))),
    )
