"""The chain from the true force to the logged means of a dual-axis sensor, with causes of a demanded size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tests.benchmark.foreign.bench import LAYOUTS, Array, Bench, bench, flicker
from tests.benchmark.foreign.causes import Cause, Scene, rounded

STOPS = 6  # on the way to each pose
WHITE_V = 5e-5  # noise of a mean
SAMPLES = 5000


@dataclass(frozen=True)
class Hidden:
    """A cause in its scene, with its size, so that it adds the demanded rms to the output."""

    cause: Cause
    scene: Scene
    size: float


@dataclass(frozen=True)
class Sensor:
    """A sensor on a bench, before any cause."""

    bench: Bench
    bias_v: Array
    gain_v: Array
    scenes: tuple[Scene, ...]

    def output(self, hidden: Sequence[Hidden], noise: Array | float = 0.0) -> Array:
        """Means, V, (n, 2), with such noise in front of the converter."""
        stages = {name: [h for h in hidden if h.cause.stage == name]
                  for name in ("angles", "tilt", "frame", "response", "volts")}  # fmt: skip
        angles = (self.bench.alpha, self.bench.beta)
        for h in stages["angles"]:
            angles = h.cause.law(angles, h.size, h.scene)
        up = np.array([[0.0, 0.0, 1.0]])
        for h in stages["tilt"]:
            up = h.cause.law(up, h.size, h.scene)
        force = turned(*angles, up[0])
        for h in stages["frame"]:
            force = h.cause.law(force, h.size, h.scene)
        u = force[:, :2]
        for h in stages["response"]:
            u = h.cause.law(u, h.size, h.scene)
        v = self.bias_v + self.gain_v * u + noise
        for h in stages["volts"]:
            v = h.cause.law(v, h.size, h.scene)
        return v


def turned(alpha: Array, beta: Array, up: Array) -> Array:
    """Specific force in the sensor, g, (n, 3), of a vertical `up` in the laboratory."""
    x = np.cos(alpha) * up[0] + np.sin(alpha) * up[2]
    z = np.cos(alpha) * up[2] - np.sin(alpha) * up[0]
    y = np.full_like(alpha, up[1])
    c, s = np.cos(beta), np.sin(beta)
    return np.column_stack([c * x - s * y, s * x + c * y, z])


def sensor(random: np.random.Generator, causes: int) -> Sensor:
    """A sensor on a bench of a random layout, with a scene for each cause."""
    b = bench(random, str(random.choice(LAYOUTS)))
    force = turned(b.alpha, b.beta, np.array([0.0, 0.0, 1.0]))
    share = np.arange(1, STOPS + 1) / STOPS
    alpha, beta = (x[:-1, None] + np.diff(x)[:, None] * share for x in (np.r_[0.0, b.alpha], np.r_[b.beta[0], b.beta]))
    way = turned(alpha.ravel(), beta.ravel(), np.array([0.0, 0.0, 1.0]))[:, :2].reshape(b.n, STOPS, 2)
    scenes = tuple(
        Scene(b, force, random.uniform(size=8), random.choice([-1, 1], 2) * random.uniform(0.5, 1.2, 2), way)
        for _ in range(causes)
    )
    return Sensor(b, random.uniform(2.4, 2.6, 2), random.uniform(0.9, 1.1, 2), scenes)


def sized(plain: Sensor, cause: Cause, scene: Scene, rms_v: float) -> Hidden:
    """The cause with the size at which it adds so much beyond bias, scale factor and the other causes' absence."""
    nothing = plain.output(())
    linear = cause.stage in ("frame", "tilt") or cause.name == "stage-zero-offset"
    base = np.column_stack([np.ones(plain.bench.n), scene.force[:, :2]])

    def added(size: float) -> float:
        d = plain.output((Hidden(cause, scene, size),)) - nothing
        columns = [base[:, [0, k + 1]] if linear else base for k in range(2)]
        left = [d[:, k] - c @ np.linalg.lstsq(c, d[:, k], rcond=None)[0] for k, c in enumerate(columns)]
        return float(np.sqrt(np.mean(np.square(left))))

    low, high = 1e-9, 1e-6
    while added(high) < rms_v and high < 1e4:
        high *= 2
    for _ in range(40):
        middle = np.sqrt(low * high)
        low, high = (middle, high) if added(middle) < rms_v else (low, middle)
    return Hidden(cause, scene, high)


def table(random: np.random.Generator, causes: Sequence[Cause], floors: Sequence[float], slow: float) -> str:
    """A sensor with hidden causes of these sizes, in noise floors, as CSV text. `slow`: slow noise over white noise."""
    made = sensor(random, len(causes))
    hidden = [sized(made, c, s, size * WHITE_V) for c, s, size in zip(causes, made.scenes, floors, strict=True)]
    return logged(random, made, hidden, slow)


def logged(random: np.random.Generator, made: Sensor, hidden: Sequence[Hidden], slow: float) -> str:
    """The table as CSV text. `slow`: slow noise over white noise."""
    b = made.bench
    noise = random.normal(0, WHITE_V, (b.n, 2))
    noise += slow * WHITE_V * np.column_stack([flicker(random, b.t) for _ in range(2)])
    v = made.output(hidden, noise)
    std = np.tile(b.sample_noise_v[:, None], (1, 2))
    for rounding in [h for h in hidden if h.cause.name == "quantisation"]:
        std = rounded(made.output([h for h in hidden if h is not rounding], noise), rounding.size, rounding.scene)[1]
    std = std * random.normal(1, 1 / np.sqrt(500), (b.n, 2))
    lines = ["# sample_rate_hz: 1000", "# filter_corner_hz: 15.2",
             "path,t_s,alpha_deg,beta_deg,direction,temperature_c,vx_v,vy_v,vx_std_v,vy_std_v,n,supply_v"]  # fmt: skip
    supply = b.supply_v + random.normal(0, 1e-5, b.n)
    for i in range(b.n):
        lines.append(
            f"{int(b.path[i])},{b.t[i]:.2f},{np.degrees(b.alpha[i]):.4f},{np.degrees(b.beta[i]):.4f},"
            f"{int(b.direction[i])},{b.thermometer_c[i]:.3f},{v[i, 0]:.7f},{v[i, 1]:.7f},"
            f"{std[i, 0]:.7f},{std[i, 1]:.7f},{SAMPLES},{supply[i]:.6f}"
        )
    return "\n".join(lines) + "\n"
