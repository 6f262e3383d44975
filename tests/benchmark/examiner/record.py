"""One bench with its sensor, as drawn: the inputs of all causes, and the columns that a size does not contain."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tests.benchmark.examiner.averaging import Averaging, Vibration, draw_averaging, draw_kind, draw_vibration
from tests.benchmark.examiner.layouts import RAD, Array, Poses, draw_poses, gravity
from tests.benchmark.examiner.room import (
    Clock,
    Supply,
    Temperature,
    draw_clock,
    draw_supply,
    draw_temperature,
)

STEP_DEG = 0.01  # of the derivatives


@dataclass(frozen=True)
class Sensor:
    """A dual-axis sensor with an analogue output.

    `scale_v` is its nominal scale factor, V/g; `sensitivity_v` (2,) the true one of each axis, `zero_v` (2,) the output
    at 0 g, `floor_v` the white noise of a mean.
    """

    scale_v: float
    sensitivity_v: Array
    zero_v: Array
    floor_v: float


@dataclass(frozen=True)
class Columns:
    """Which columns the file has, and the noise and the resolution of its thermometer, K."""

    has_temperature: bool
    has_supply: bool
    has_direction: bool
    has_humidity: bool
    thermometer_noise_k: float
    thermometer_step_k: float


@dataclass(frozen=True, eq=False)
class Record:
    """A bench with a sensor, before any cause. `force` is the ideal specific force, g, (n, 3)."""

    poses: Poses
    clock: Clock
    temperature: Temperature
    supply: Supply
    sensor: Sensor
    gravity_m_s2: float
    averaging: Averaging
    vibration: Vibration
    columns: Columns
    force: Array

    @property
    def n(self) -> int:
        """Number of poses."""
        return self.poses.n

    @cached_property
    def ideal_v(self) -> Array:
        """Output without noise and without a cause, V, (n, 2)."""
        return self.sensor.zero_v + self.sensor.sensitivity_v * self.force[:, :2]

    @cached_property
    def bases(self) -> dict[str, list[Array]]:
        """Orthonormal columns of each axis: 'affine' 1, ax, ay, az; 'bias+scale' 1 and the own force."""
        one = np.ones(self.n)
        affine = np.linalg.qr(np.column_stack([one, self.force]))[0]
        own = [np.linalg.qr(np.column_stack([one, self.force[:, k]]))[0] for k in (0, 1)]
        return {"affine": [affine, affine], "bias+scale": own}

    def residual(self, values: Array, base: str) -> Array:
        """Remainder of (n, 2) after a least-squares fit of the base columns."""
        q = self.bases[base]
        return np.stack([values[:, k] - q[k] @ (q[k].T @ values[:, k]) for k in (0, 1)], 1)

    def derivative(self, of: str) -> Array:
        """Change of the force, g per degree, (n, 2), by 'alpha', 'beta', 'tilt_x' or 'tilt_y'."""
        p, tilt = self.poses, STEP_DEG * RAD
        moved = {
            "alpha": lambda: gravity(p, p.alpha + STEP_DEG, p.beta),
            "beta": lambda: gravity(p, p.alpha, p.beta + STEP_DEG),
            "tilt_x": lambda: gravity(p, p.alpha, p.beta, tilt, 0.0),
            "tilt_y": lambda: gravity(p, p.alpha, p.beta, 0.0, tilt),
        }[of]()
        return (moved - self.force)[:, :2] / STEP_DEG


@dataclass(frozen=True)
class Demands:
    """What the causes of a set need of their record. `None` is drawn."""

    needs: Collection[str] = ()  # "temperature", "supply", "direction", "vibration", "young"
    temperature: str | None = None
    averaging: str | None = None
    restarted: bool | None = None
    has_fine_thermometer: bool = False


def draw_record(seed: int, layout: str, demands: Demands) -> Record:
    """A record of one layout."""
    random = np.random.default_rng(seed)
    poses = draw_poses(random, layout)
    clock = draw_clock(random, poses, "young" in demands.needs, demands.restarted)
    temperature = draw_temperature(random, clock, demands.temperature)
    supply = draw_supply(random, clock, temperature)
    sensor = _draw_sensor(random, supply.nominal_v)
    local_gravity = float(random.uniform(9.7805, 9.8285))
    averaging = draw_averaging(random, demands.averaging or draw_kind(random), sensor.floor_v)
    vibration = draw_vibration(random, clock.elapsed, averaging, sensor.scale_v, "vibration" in demands.needs)
    columns = _draw_columns(random, demands)
    force = gravity(poses, poses.alpha, poses.beta)
    return Record(poses, clock, temperature, supply, sensor, local_gravity, averaging, vibration, columns, force)


def _draw_sensor(random: np.random.Generator, supply_v: float) -> Sensor:
    scale = float(random.choice([1.0, 1.0, 0.66, 0.33, 0.312])) * (1 if supply_v == 5 else 0.66)
    sensitivity = scale * random.uniform(0.96, 1.04, 2)
    zero = supply_v / 2 + scale * random.uniform(-0.05, 0.05, 2)
    return Sensor(scale, sensitivity, zero, float(scale * random.uniform(30e-6, 80e-6)))


def _draw_columns(random: np.random.Generator, demands: Demands) -> Columns:
    has_temperature = "temperature" in demands.needs or random.random() < 0.88
    has_supply = "supply" in demands.needs or random.random() < 0.6
    has_direction = "direction" in demands.needs or random.random() < 0.85
    noise, step = 0.001, 1e-4
    if not demands.has_fine_thermometer:
        noise = float(random.choice([0.004, 0.01]))
        step = float(random.choice([1e-3, 1e-2, 0.01, 0.0625], p=[0.4, 0.3, 0.2, 0.1]))
    return Columns(has_temperature, has_supply, has_direction, bool(random.random() < 0.15), noise, step)
