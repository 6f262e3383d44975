"""The motion of a hand-held sensor from one attitude to the next: its attitude, angular rate and acceleration.

An attitude is a matrix (3, 3) whose columns are the directions to the north, to the west and upward in the frame of the
sensor. From one attitude to the next the sensor turns along the great circle of its upward direction, and at the same
time about the vertical; a trembling hand turns and shakes it besides.

Source  Elble, J. Clinical Neurophysiology 13 (1996), 133-144: physiological tremor of a hand, 8 to 12 Hz;
        Solà, Deray and Atchuthan, A micro Lie theory (2018), the Jacobian of SO(3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from drivers.world.kernel import Floats

TREMOR_HZ = (7.0, 8.3, 9.1, 10.4, 11.8)
BUMP_HZ, BUMP_S = 25.0, 0.08
TAPER_S = 0.1  # in which a trembling hand takes hold of the sensor, and lets it go
NORTH = (1.0, 0.0, 0.0)  # in the frame of the sensor, as it lies at first


@dataclass(frozen=True)
class Segment:
    """A turn: from `start_s` to `end_s` the upward direction changes from `before` to `after`, both unit vectors.

    `tremor`: share of the hand's tremor that reaches the sensor. `bumps`: whether it was put down at `start_s`.
    `north`: the direction to the north at `start_s`. Besides the shortest way, the sensor turns by `heading_rad` about
    the vertical, clockwise seen from above if it is positive. `place_mm`: where on the table it is, to the north and
    to the west.
    """

    start_s: float
    end_s: float
    before: tuple[float, float, float]
    after: tuple[float, float, float]
    tremor: float = 0.0
    bumps: bool = False
    north: tuple[float, float, float] = NORTH
    heading_rad: float = 0.0
    place_mm: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Shaking:
    """The tremor of a hand, and the force with which it puts the sensor down."""

    tremor_g: float  # rms of the acceleration along each axis
    tremor_deg: float
    bump_g: float


@dataclass(frozen=True)
class Motion:
    """At times (n,): attitudes (n, 3, 3), specific forces (n, 3), angular rates (n, 3) in the frame of the sensor, and
    the places on the table (n, 2).
    """

    attitude: Floats
    force_g: Floats
    rate_deg_s: Floats
    place_mm: Floats


def move(segment: Segment, shaking: Shaking, times_s: Floats) -> Motion:
    """The motion at `times_s` within the segment."""
    attitude, rate_rad_s = _turn(segment, times_s)
    pushed_g = np.zeros((len(times_s), 3))
    if segment.tremor:
        amplitude, slope = _taper(segment, times_s)
        waves, wave_slopes = _waves(times_s)
        tilt = math.radians(shaking.tremor_deg) * amplitude * waves[:, :3]
        tilt_slope = math.radians(shaking.tremor_deg) * (slope * waves[:, :3] + amplitude * wave_slopes[:, :3])
        shaken = rotations(-tilt)
        rate_rad_s = np.einsum("nij,nj->ni", shaken, rate_rad_s)
        rate_rad_s += np.einsum("nij,nj->ni", _jacobians(-tilt), tilt_slope)
        attitude = shaken @ attitude
        pushed_g += shaking.tremor_g * amplitude * waves[:, 3:]
    if segment.bumps:
        after_s = times_s - segment.start_s
        bump = shaking.bump_g * np.exp(-after_s / BUMP_S) * np.cos(2 * np.pi * BUMP_HZ * after_s)
        pushed_g += bump[:, None] * np.array(segment.after)
    place_mm = np.tile(segment.place_mm, (len(times_s), 1))
    return Motion(attitude, attitude[:, :, 2] + pushed_g, np.degrees(rate_rad_s), place_mm)


def last_north(segment: Segment) -> Floats:
    """The direction to the north at the end of a segment, shape (3,)."""
    end_s = np.array([segment.start_s + 1.0 if math.isinf(segment.end_s) else segment.end_s])
    return np.asarray(_turn(segment, end_s)[0][0, :, 0])


def rotations(vectors: Floats) -> Floats:
    """Rotations by vectors (n, 3), rad, as matrices (n, 3, 3)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    cross, square = _cross(vectors)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * cross + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * square)


def angle_between(first: Floats, second: Floats) -> float:
    """The angle between unit vectors, rad."""
    return math.acos(min(1.0, max(-1.0, float(first @ second))))


def unit(vector: Floats) -> Floats:
    """The vector, of length 1."""
    return np.asarray(vector / np.linalg.norm(vector))


def _turn(segment: Segment, times_s: Floats) -> tuple[Floats, Floats]:
    """Attitudes (n, 3, 3) and rates (n, 3), rad/s: slow at both ends, and without tremor."""
    start, end, north = np.array(segment.before), np.array(segment.after), np.array(segment.north)
    at_first = np.column_stack([north, np.cross(start, north), start])
    angle = angle_between(start, end)
    if (angle < 1e-6 and not segment.heading_rad) or math.isinf(segment.end_s):
        return np.tile(at_first, (len(times_s), 1, 1)), np.zeros((len(times_s), 3))
    axis = _axis(start, end)
    length_s = segment.end_s - segment.start_s
    share = np.clip((times_s - segment.start_s) / length_s, 0.0, 1.0)[:, None]
    turned, speed = share**2 * (3 - 2 * share), 6 * share * (1 - share) / length_s
    attitude = rotations(angle * turned * axis) @ rotations(segment.heading_rad * turned * start) @ at_first
    rate = -speed * (angle * axis + segment.heading_rad * attitude[:, :, 2])
    return attitude, np.asarray(rate)


def _axis(start: Floats, end: Floats) -> Floats:
    """The axis of the shortest turn from `start` to `end`; upside down it is over any side."""
    axis = np.cross(start, end)
    if np.linalg.norm(axis) < 1e-6:
        axis = np.cross(start, np.eye(3)[int(np.argmin(np.abs(start)))])
    return unit(axis)


def _taper(segment: Segment, times_s: Floats) -> tuple[Floats, Floats]:
    """The factor of the tremor and its derivative, each (n, 1). It rises and falls within TAPER_S."""
    rising = np.clip((times_s - segment.start_s) / TAPER_S, 0.0, 1.0)[:, None]
    falling = np.clip((segment.end_s - times_s) / TAPER_S, 0.0, 1.0)[:, None]
    up, down = (part**2 * (3 - 2 * part) for part in (rising, falling))
    up_slope, down_slope = (6 * part * (1 - part) / TAPER_S for part in (rising, falling))
    return segment.tremor * up * down, segment.tremor * (up_slope * down - up * down_slope)


def _waves(times_s: Floats) -> tuple[Floats, Floats]:
    """Six tremors of rms 1, and their slopes, each (n, 6)."""
    swing, turns = np.sqrt(2 / len(TREMOR_HZ)), 2 * np.pi * np.outer(times_s, TREMOR_HZ)
    phases = [turns + 1.7 * k + np.arange(len(TREMOR_HZ)) ** 2 for k in range(6)]
    per_s = 2 * np.pi * np.array(TREMOR_HZ)
    waves = [swing * np.sin(phase).sum(axis=1) for phase in phases]
    slopes = [swing * (np.cos(phase) * per_s).sum(axis=1) for phase in phases]
    return np.stack(waves, axis=1), np.stack(slopes, axis=1)


def _cross(vectors: Floats) -> tuple[Floats, Floats]:
    """The matrices of the cross product by vectors (n, 3), and their squares, each (n, 3, 3)."""
    zero, (x, y, z) = np.zeros(len(vectors)), vectors.T
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    return cross, cross @ cross


def _jacobians(vectors: Floats) -> Floats:
    """Derivatives of the rotations by vectors (n, 3) with respect to these vectors, shape (n, 3, 3)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    cross, square = _cross(vectors)
    third = np.where(angle > 1e-3, (1 - np.sinc(angle / np.pi)) / np.maximum(angle, 1e-3) ** 2, 1 / 6)
    return np.asarray(np.eye(3) + 0.5 * np.sinc(angle / 2 / np.pi) ** 2 * cross + third * square)
