"""Records of motion with a hidden cause, from a simulation of their own: no formula is the catalogue's.

The sensor lies on a mover on two stages: 30 um at 10 Hz and 80 um at 4 Hz, or three lines, at six attitudes. Time is
stepped eight times finer than the samples. A mechanism has a size, and the forms of real ones: a second harmonic, a
linear part, a lag of the thermometer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, cont2discrete, lfilter, lfilter_zi
from scipy.spatial.transform import Rotation

from calibrations.fitting.fit import fit
from calibrations.model.file import read_model
from calibrations.table import Array, Table

GRAVITY = 9.80131
RATE_HZ, FINER = 1000.0, 8
CORNER_HZ = 15.07
LEAD_S, GAP_S, BETWEEN_S = 0.3, 20.0, 5.0  # before a record, between records; a record before the first
NOISE_V = 110e-6  # per root Hz, before the filter
PROBE_M = 0.2e-6
ATTITUDES = ((45.0, 90.0), (90.0, 0.0), (90.0, 180.0), (90.0, 90.0), (90.0, 270.0), (135.0, 45.0))
LAYOUTS: Mapping[str, tuple[tuple[tuple[float, float], ...], float]] = {
    "two lines": (((30e-6, 10.0), (80e-6, 4.0)), 0.0),
    "three lines": (((25e-6, 12.0), (60e-6, 5.0), (15e-6, 20.0)), 0.0),
    "rests and levels": (((30e-6, 10.0), (80e-6, 4.0)), 2.3),
}  # (amplitude m, frequency Hz) of each line, and how long the sensor rests first, s
RECORD_S = 8.0
UNKNOWN = "not in the catalogue"


@dataclass(frozen=True)
class Signals:
    """One record in continuous time: `since` power-on, s; `motion` along x and `force` (n, 3), g; `q` a set's own."""

    attitude: tuple[float, float]
    since: Array
    displacement: Array
    motion: Array
    force: Array
    temperature: Array
    q: float

    @property
    def own(self) -> Array:
        """Force along x and y, g, (n, 2)."""
        return self.force[:, :2]

    @property
    def other(self) -> Array:
        """Force along y and x, g, (n, 2)."""
        return self.force[:, [1, 0]]


By = Callable[[Signals, float], Array]


@dataclass(frozen=True)
class Mechanism:
    """What acts, by where it acts: angles, deg, gravity's direction, force, response, corner, delay, displacement."""

    cause: str
    begin: float  # a size to start from
    angles: Callable[[float, float, float, float], tuple[float, float]] | None = None  # (alpha, beta, size, q)
    tilt: bool = False  # of the base
    turn: bool = False  # of the sensor in its mount
    force: By | None = None
    response: By | None = None
    corner: bool = False  # of the output filter, as a part of it
    delay: By | None = None  # s
    displacement: By | None = None  # of the reference, m


def _per_axis(column: Array, y: float = 0.7) -> Array:
    return column[:, None] * np.array([1.0, y])


def _resonant(s: Signals, size: float) -> Array:
    """A mount that resonates above the motion."""
    w, damping, step = 2 * np.pi * (24 + 4 * s.q), 0.15, 1 / (RATE_HZ * FINER)
    b, a, _ = cont2discrete(([w * w], [1, 2 * damping * w, w * w]), step, "bilinear")
    return np.outer(size * (lfilter(np.ravel(b), a, s.motion) - s.motion), [1.0, 0.0, 0.0])


def _jerk(s: Signals) -> Array:
    return np.asarray(np.gradient(s.motion) * RATE_HZ * FINER)


def _rectified(s: Signals, size: float) -> Array:
    step = 1 / (RATE_HZ * FINER * 0.02)
    return _per_axis(size * np.asarray(lfilter([step], [1, step - 1], s.motion**2)), 0.8)


def _tilting(s: Signals, size: float) -> Array:
    return np.outer(size * s.displacement / 30e-6, [0.0, 0.3, 1.0])


def _warming(s: Signals, size: float) -> Array:
    return _per_axis(size * (np.exp(-s.since / 45) + 0.3 * np.exp(-s.since / 150)))


def _at_one(s: Signals, size: float) -> Array:
    return np.tile(size * np.array([1.0, -1.0]) * (s.attitude == (90.0, 90.0)), (len(s.since), 1))


MECHANISMS: Mapping[str, Mechanism] = {
    each.cause: each
    for each in (
        Mechanism("sampling-delay", 3e-4, delay=lambda s, size: np.full(len(s.since), size)),
        Mechanism("output-filter", 0.01, corner=True),
        Mechanism("axis-misalignment", 0.3, turn=True),
        Mechanism("stage-zero-offset", 0.3, angles=lambda alpha, beta, size, _: (alpha, beta + size)),
        Mechanism(
            "stage-eccentricity",
            0.3,
            angles=lambda alpha, beta, size, q: (alpha, beta + size * float(np.sin(np.radians(beta) + 3 * q))),
        ),
        Mechanism("base-tilt", 0.3, tilt=True),
        Mechanism("quadratic-nonlinearity", 1e-3, response=lambda s, size: size * s.own**2 * (1 + 0.2 * s.q * s.own)),
        Mechanism("cubic-nonlinearity", 1e-3, response=lambda s, size: size * np.sin(2.2 * s.own)),
        Mechanism("scale-factor-asymmetry", 1e-3, response=lambda s, size: size * np.sqrt(s.own**2 + 0.03**2)),
        Mechanism(
            "cross-axis-bias", 1e-3, response=lambda s, size: size * s.other**2 * (1 + 0.15 * s.other) * [1.0, -0.6]
        ),
        Mechanism(
            "z-axis-bias",
            1e-3,
            response=lambda s, size: _per_axis(size * s.force[:, 2] ** 2 * (1 + 0.2 * s.force[:, 2])),
        ),
        Mechanism(
            "temperature-bias",
            1e-3,
            response=lambda s, size: _per_axis(size * (s.temperature - 23 + 0.05 * (s.temperature - 23) ** 2)),
        ),
        Mechanism("temperature-scale", 1e-3, response=lambda s, size: size * (s.temperature - 23)[:, None] * s.own),
        Mechanism("warm-up-bias", 1e-3, response=_warming),
        Mechanism("vibration-rectification", 1e-3, response=_rectified),
    )
}
OUTSIDE: Mapping[str, Mechanism] = {
    "mover pitches": Mechanism(UNKNOWN, 1e-3, force=_tilting),
    "mount resonates": Mechanism(UNKNOWN, 0.02, force=_resonant),
    "drive couples": Mechanism(UNKNOWN, 1e-3, response=lambda s, size: _per_axis(size * s.displacement / 30e-6, 0.4)),
    "sensitivity swings": Mechanism(
        UNKNOWN, 1e-3, response=lambda s, size: size * np.sin(0.7 * s.since + s.q)[:, None] * s.own
    ),
    "beat of the mains": Mechanism(
        UNKNOWN, 1e-3, response=lambda s, size: _per_axis(size * np.sin(2.3 * s.since), 1.0)
    ),
    "one attitude": Mechanism(UNKNOWN, 1e-3, response=_at_one),
    "slew": Mechanism(UNKNOWN, 1e-3, response=lambda s, size: _per_axis(size * np.tanh(_jerk(s) / 2), 1.0)),
    "jerk": Mechanism(UNKNOWN, 1e-3, response=lambda s, size: size * (_jerk(s) / 60)[:, None] * s.own[:, :1]),
    "clocks part": Mechanism(UNKNOWN, 3e-4, delay=lambda s, size: size * s.since / 200),
    "clock jumps": Mechanism(UNKNOWN, 3e-4, delay=lambda s, size: np.where(s.since > 90, size, 0.0)),
    "reference's scale": Mechanism(
        UNKNOWN, 0.01, displacement=lambda s, size: s.displacement * (1 + size * np.sin(s.since / 27 + s.q))
    ),
}


Acting = tuple[tuple[Mechanism, float], ...]  # with the size of each, in the unit of its formula


def measured(acting: Acting, layout: str, seed: int) -> Table:
    """The table of all records."""
    random = np.random.default_rng([seed, 5])
    q, warmer = float(random.normal()), 1.0 if seed % 2 else -1.0
    records = [_record(acting, *LAYOUTS[layout], number, q, warmer, random) for number in range(len(ATTITUDES))]
    columns = {name: np.concatenate([r[name] for r in records]) for name in records[0]}
    constants = {"filter_corner_hz": CORNER_HZ, "sample_rate_hz": RATE_HZ, "gravity_m_s2": GRAVITY}
    causes = ", ".join(mechanism.cause for mechanism, _ in acting)
    return Table.from_columns("motion", columns, constants, f"{causes or 'nothing'}, {layout}, {seed}")


def size_for(mechanism: Mechanism, times: float, layout: str, seed: int) -> float:
    """The size of which the linear model leaves about `times` the noise floor."""
    size, wanted = mechanism.begin, times**2 - 1
    for _ in range(6):
        table = measured(((mechanism, size),), layout, seed)
        left = max(fit(read_model("linear"), table).pooled_excess ** 2 - 1, 0.02)
        if abs(np.log(left / wanted)) < 0.4:
            break
        size *= float(np.clip(np.sqrt(wanted / left), 0.1, 30.0))
    return size


def _record(
    acting: Acting,
    lines: tuple[tuple[float, float], ...],
    rest_s: float,
    number: int,
    q: float,
    warmer: float,
    random: np.random.Generator,
) -> dict[str, Array]:
    n, step = int(RECORD_S * RATE_HZ), 1 / (RATE_HZ * FINER)
    t = np.arange(-LEAD_S, RECORD_S + LEAD_S, step)
    since = BETWEEN_S + number * (RECORD_S + GAP_S) + t
    x = _displacement(t, lines, rest_s, 0.4 + 0.3 * (number % 3) if rest_s else 1.0)
    motion = np.gradient(np.gradient(x, step), step) / GRAVITY
    true, tilt = ATTITUDES[number], 0.0
    for m, size in acting:
        true = m.angles(*true, size, q) if m.angles else true
        tilt += size if m.tilt else 0.0
    up = Rotation.from_euler("x", tilt, degrees=True).apply([0.0, 0.0, 1.0])
    force = np.tile(Rotation.from_euler("yz", true, degrees=True).apply(up), (len(t), 1))
    force[:, 0] += motion
    signals = Signals(ATTITUDES[number], since, x, motion, force, _temperature(since, warmer), q)
    for m, size in acting:
        force = force + m.force(signals, size) if m.force else force
        if m.turn:
            force = Rotation.from_euler("xyz", [0.3 * size * q, 0.0, size], degrees=True).inv().apply(force)
    v = 2.5 + np.array([0.01, -0.02]) + np.array([1.0, 1.02]) * force[:, :2]
    v = v + sum((m.response(signals, size) for m, size in acting if m.response), np.zeros(v.shape))
    v = v + NOISE_V / np.sqrt(2 * step) * random.standard_normal(v.shape)
    v = _low_pass(v, CORNER_HZ / (1 + sum(size for m, size in acting if m.corner)))
    at = np.arange(n) / RATE_HZ
    late = sum((np.interp(at, t, m.delay(signals, size)) for m, size in acting if m.delay), np.zeros(n))
    for m, size in acting:
        x = m.displacement(signals, size) if m.displacement else x
    first_s = float(since[0]) + LEAD_S
    return {
        "t_s": at + first_s,
        "displacement_m": np.interp(at, t, x) + PROBE_M * random.standard_normal(n),
        "alpha_deg": np.full(n, ATTITUDES[number][0]),
        "beta_deg": np.full(n, ATTITUDES[number][1]),
        "temperature_c": _temperature(first_s + at - 8, warmer) + 0.01 * random.standard_normal(n),  # it lags by 8 s
        "vx_v": np.interp(at - late, t, v[:, 0]),
        "vy_v": np.interp(at - late, t, v[:, 1]),
    }


def _displacement(t: Array, lines: tuple[tuple[float, float], ...], rest_s: float, level: float) -> Array:
    """Of the mover, m, which begins gently where it rests first."""
    ramp = np.clip((t - rest_s) / 0.4, 0.0, 1.0) if rest_s else np.ones(len(t))
    waves = (a * np.sin(2 * np.pi * f * t + k) for k, (a, f) in enumerate(lines))
    return np.asarray(level * ramp**3 * (10 - 15 * ramp + 6 * ramp**2) * sum(waves, np.zeros(len(t))))


def _temperature(since: Array, warmer: float) -> Array:
    return np.asarray(23 + warmer * 2 * np.exp(-since / 60) + 0.6 * np.sin(since / 37))


def _low_pass(v: Array, corner_hz: float) -> Array:
    b, a = butter(1, corner_hz, fs=RATE_HZ * FINER)
    return np.column_stack([lfilter(b, a, c, zi=lfilter_zi(b, a) * c[:400].mean())[0] for c in v.T])
