"""Mechanisms outside of the catalogue: no effect of it has their cause."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.benchmark.examiner.cause import Cause, Constants, Stand
from tests.benchmark.examiner.layouts import RAD, Array
from tests.benchmark.examiner.record import Record

Signal = Callable[[Record, Constants], Array]
Law = Callable[[Record, Stand, float, Constants], Stand]

LIFT_S = 55  # time of an elevator at the floor
OFTEN = ("nested", "random", "large", "serpentine")


def _added(signal: Signal) -> Law:
    """A law that adds a signal (n,) to both axes with their weights."""

    def law(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
        added = size * constants.weights * signal(record, constants)[:, None]
        return replace(stand, added=stand.added + added)

    return law


def _in_one_channel(signal: Signal) -> Law:
    """A law that adds a signal (n,) to one axis."""

    def law(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
        added = size * np.eye(2)[constants.channel] * signal(record, constants)[:, None]
        return replace(stand, added=stand.added + added)

    return law


def _wind_up(record: Record, constants: Constants) -> Array:
    """A cable that winds up: 0 and 360 degrees differ."""
    turns = record.poses.beta / 180 - 1
    return turns + 0.6 * turns**3


def _heading(record: Record, constants: Constants) -> Array:
    """A magnetic field at a fixed heading of the inner stage."""
    beta = record.poses.beta
    return np.cos(beta * RAD - constants.phase) + 0.4 * np.sin(2 * beta * RAD)


def _jump(record: Record, constants: Constants) -> Array:
    """A change of the resonator's mode."""
    return (np.arange(record.n) > constants.share * record.n).astype(float)


def _elevator(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    random = np.random.default_rng(constants.seed)
    elapsed = record.clock.elapsed
    is_near, period, arrival = np.zeros(record.n, bool), random.uniform(300, 500), 0.0
    while arrival < elapsed[-1]:
        is_near |= (elapsed > arrival) & (elapsed < arrival + LIFT_S)
        arrival += period * random.uniform(0.8, 1.2)
    return replace(stand, tilt_x=stand.tilt_x + size * is_near, tilt_y=stand.tilt_y + 0.5 * size * is_near)


def _condensation(record: Record, constants: Constants) -> Array:
    """Water condenses once the temperature has passed a threshold, and stays."""
    celsius, elapsed = record.temperature.celsius, record.clock.elapsed
    is_cold = celsius < np.quantile(celsius, 0.6)
    start = max(int(np.argmax(is_cold)), record.n // 5)
    rise = 1 - np.exp(-(elapsed - elapsed[start]) / (0.08 * elapsed[-1]))
    return np.where(np.arange(record.n) >= start, rise, 0)


def _motor_current(record: Record, constants: Constants) -> Array:
    """The current of a stepper motor stays on after long moves; elsewhere after a new alpha, or at random."""
    poses = record.poses
    if poses.layout == "random":
        return (poses.move > 90).astype(float)
    is_new = np.r_[True, np.abs(np.diff(poses.alpha)) > 1e-6]
    return (is_new | (np.random.default_rng(record.n).random(record.n) < 0.25)).astype(float)


def _daily_tilt(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    angle = 2 * np.pi * record.clock.elapsed * constants.rate_hz
    return replace(
        stand,
        tilt_x=stand.tilt_x + size * np.sin(angle + constants.phase),
        tilt_y=stand.tilt_y + size * 0.7 * np.cos(angle + constants.other_phase),
    )


def _telegraph(record: Record, constants: Constants) -> Array:
    """A trap in the electronics that is full or empty.

    Source: Machlup, Noise in Semiconductors: Spectrum of a Two-Parameter Random Signal, Journal of Applied Physics 25
    (1954).
    """
    random = np.random.default_rng(constants.seed)
    return np.cumsum([random.random() < 12.0 / record.n for _ in range(record.n)]) % 2.0


def _mains(record: Record, stand: Stand, size: float, constants: Constants) -> Stand:
    """Pick-up of the mains, aliased by the pace of the poses."""
    angle = 2 * np.pi * record.clock.elapsed / constants.pose_period_s
    waves = [np.sin(angle + constants.phase), 0.7 * np.sin(angle + constants.other_phase)]
    return replace(stand, added=stand.added + size * np.stack(waves, 1))


def _unknown(
    name: str,
    text: str,
    law: Law,
    layouts: tuple[str, ...],
    needs: tuple[str, ...] = (),
    remark: str = "",
) -> Cause:
    return Cause(name, "", text, "pose", law, needs, layouts=layouts, remark=remark)


CAUSES = (
    _unknown(
        "cable wind-up",
        "A [w + 0.6 w^3], w = unwrapped beta/180 - 1 (0 and 360 differ)",
        _added(_wind_up),
        ("nested", "large", "irregular", "alpha_inner"),
    ),
    _unknown(
        "magnetic heading",
        "A [cos(beta-f) + 0.4 sin 2 beta], whatever alpha",
        _added(_heading),
        ("nested", "random", "serpentine", "large"),
    ),
    _unknown("mode jump", "A at t > t1 in one channel", _in_one_channel(_jump), OFTEN),
    _unknown(
        "elevator",
        "base tilts by A for 55 s about every 400 s",
        _elevator,
        ("nested", "random", "irregular", "large"),
    ),
    _unknown(
        "condensation",
        "once T has passed a threshold: A (1 - exp(-(t-t1)/tau)), stays",
        _added(_condensation),
        OFTEN,
        ("temperature",),
        "like a warm-up that starts in the middle of the record",
    ),
    _unknown(
        "stepper current",
        "constant A per axis in poses whose move kept the motor current on (long moves, or at random)",
        _added(_motor_current),
        ("random", "nested", "serpentine", "irregular"),
        (),
        "no column tells which poses",
    ),
    _unknown(
        "floor tilts by day",
        "base tilt A sin(2 pi t/24 h + f) about x and cos about y",
        _daily_tilt,
        ("two_days", "large", "irregular"),
    ),
    _unknown("telegraph noise", "A or 0, jumps about twelve times, one channel", _in_one_channel(_telegraph), OFTEN),
    _unknown(
        "aliased mains",
        "A sin(2 pi t/P + f_axis), P about 7.3 poses",
        _mains,
        ("nested", "random", "irregular", "serpentine"),
    ),
)
