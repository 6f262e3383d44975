"""Simulated sensors in simulated hands: calibrated by hand-positions, by two other prescriptions, and on a stage.

The other prescriptions are those of two programs that calibrate without a stage; no code of theirs is used.

imu_tk   30 s at rest, then 12 orientations or more, about 4 s each; a window of 101 samples is at rest if the norm of
         its variances is below a multiple, 2 to 10, of that at first; the multiple with the least residual wins
imucal   six sides, 3 s each, as Ferraris et al.: means of opposite sides give the zero of their own axis and the
         gains; the sides count as exact
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from calibrations.analyses.hand_turns import fit_turns
from calibrations.design.orientations import ORIENTATIONS
from calibrations.table import Array, Table
from drivers.handheld.hand import Hand
from drivers.handheld.triad import noise_v, steady_v
from drivers.handheld.world import FIELDS, FORCES, Handheld, HandheldWorld
from drivers.recorder import Samples
from drivers.world import turned_sensors
from drivers.world.config import WorldConfig
from drivers.world.kernel import record
from procedures.hand_fields import hand_fields
from procedures.hand_positions import hand_positions
from procedures.hand_turns import hand_turns
from procedures.session import Dwell, Session
from rig.instruments.by_hand import HandAnalysis
from rig.record.turns import is_turn, turn_columns
from tests.procedures.bench import Adc, Book, session

CALM = Hand(slips=0.0, errs=0.0, clings=0.0)
RATE_HZ = 200.0
DEG = np.pi / 180
ENOUGH = 12  # intervals for imu_tk


@dataclass(frozen=True)
class LinearCalibration:
    """Zeros b (3,) and matrix M (3, 3) of outputs v = b + M a, with the positions and the time that they took."""

    b: Array
    M: Array
    positions: int
    time_s: float

    @property
    def gains(self) -> Array:
        """Output per g along each sensing axis, shape (3,)."""
        return np.asarray(np.linalg.norm(self.M, axis=1))

    @property
    def angles_deg(self) -> Array:
        """Departures of the sensing axes from 90 deg: xy, xz, yz; shape (3,)."""
        rows = self.M / self.gains[:, None]
        return np.asarray([np.arcsin(rows[i] @ rows[j]) / DEG for i, j in ((0, 1), (0, 2), (1, 2))])

    def errors(self, true: LinearCalibration) -> dict[str, Array]:
        """Errors of zeros in mg, gains in per mille, angles in deg, each (3,)."""
        return {
            "bias_mg": 1e3 * (self.b - true.b) / true.gains,
            "scale_per_mille": 1e3 * (self.gains / true.gains - 1),
            "angle_deg": self.angles_deg - true.angles_deg,
        }


class SlowAdc(Adc):
    """The converter of the bench of a hand: 200 Hz."""

    def acquire(self, duration_s: float) -> Samples:
        start_s, n = self.world.now_s, round(duration_s * RATE_HZ)
        volts = self.world.adc_volts(self.channels, start_s, 1 / RATE_HZ, n)
        return Samples(volts, self.channels, RATE_HZ, start_s)

    def stream(self, duration_s: float, block_s: float) -> Generator[Samples, None, None]:
        begin_s, n = self.world.now_s, round(block_s * RATE_HZ)
        for start_s in begin_s + block_s * np.arange(round(duration_s / block_s)):
            yield Samples(self.world.adc_volts(self.channels, start_s, 1 / RATE_HZ, n), self.channels, RATE_HZ, start_s)


def hand_session(world: HandheldWorld, dwells: tuple[Dwell, ...] = ()) -> tuple[Session, Book]:
    """A simulated session in which a person turns the sensor by hand, and the book that keeps its data."""
    rig, book = session(world, dwells=dwells)
    return replace(rig, adc=SlowAdc(world), by_hand=HandAnalysis()), book


def world_of(seed: int, hand: Hand | None = None) -> HandheldWorld:
    """One sensor and one hand."""
    return HandheldWorld(WorldConfig.ideal(), seed, Handheld(hand=hand or Hand()))


def truth(world: HandheldWorld) -> LinearCalibration:
    """The calibration of a perfect laboratory."""
    masses = world.triad.x, world.triad.y, world.triad.z
    rows = [
        mass.volts_per_g
        * (np.cos(mass.leans_deg * DEG) * np.eye(3)[k] + np.sin(mass.leans_deg * DEG) * np.eye(3)[k - 2])
        for k, mass in enumerate(masses)
    ]
    return LinearCalibration(np.array([mass.zero_v for mass in masses]), np.array(rows), 0, 0.0)


def by_procedure(seed: int, hand: Hand | None = None, target_g: float = 0.001) -> LinearCalibration:
    """hand-positions, with the estimate of all programs here."""
    world = world_of(seed, hand)
    rig, book = hand_session(world)
    hand_positions(rig, target_g=target_g)
    means = np.array([[dwell.means[name] for name in FORCES] for dwell in book.dwells])
    b, M, _ = magnitude_fit(means)
    return LinearCalibration(b, M, len(means), world.now_s)


def by_imu_tk(
    seed: int, hand: Hand | None = None, positions: int = 16, every_s: float = 8.0
) -> LinearCalibration | None:
    """The prescription of imu_tk; None if no multiple leaves 12 intervals ("not enough intervals").

    The person gives each of `positions` `every_s`, as nothing tells whether it was taken.
    """
    world = world_of(seed, hand)
    rng = np.random.default_rng([seed, 99])
    blocks = [_samples(world, 30.0)]
    order = rng.permutation(len(ORIENTATIONS))
    for up in (order[k % len(order)] for k in range(positions)):
        world.turn_by_hand(ORIENTATIONS[up])
        blocks.append(_samples(world, every_s))
    samples = np.vstack(blocks)
    spread = _moving_variance(samples, 101)
    at_first = float(np.median(spread[:5000]))
    found = []
    for multiple in range(2, 11):
        means = _intervals(samples, spread < multiple * at_first, 101, round(1.0 * RATE_HZ))
        if len(means) >= ENOUGH:
            found.append((*magnitude_fit(means), len(means)))
    if not found:
        return None
    b, M, _, count = min(found, key=lambda each: each[2])
    return LinearCalibration(b, M, count, world.now_s)


def by_imucal(seed: int, hand: Hand | None = None, rest_s: float = 3.0) -> LinearCalibration:
    """The prescription of imucal: six sides; a person marks the rests afterwards, here without an error.

    No side is a wrong one: with six sides a person notices it, and the method would not survive it.
    """
    world, means = world_of(seed, replace(hand or Hand(), errs=0.0)), []
    for k in range(6):
        up = np.eye(3)[k // 2] * (1 - 2 * (k % 2))
        world.turn_by_hand(up)
        _samples(world, 4.0)
        while any(s.tremor for s in world.script.segments if s.start_s <= world.now_s < s.end_s):
            _samples(world, 0.5)  # the person marks no stretch in which the hand holds the sensor
        means.append(_samples(world, rest_s).mean(axis=0))
    faces = np.array(means).reshape(3, 2, 3)
    return LinearCalibration(np.diag(faces.mean(axis=1)).copy(), (faces[:, 0] - faces[:, 1]).T / 2, 6, world.now_s)


def on_stage(seed: int, dwell_s: float = 5.0) -> LinearCalibration:
    """26 exact orientations, `dwell_s` each, with a move of 4 s between them."""
    world = world_of(seed)
    rng = np.random.default_rng([seed, 98])
    memory, wander, means = np.zeros(3), world.triad.wander_v * rng.standard_normal(3), []
    for up in ORIENTATIONS:
        n = round(dwell_s * RATE_HZ)
        noise, memory, wander = noise_v(world.triad, memory, wander, 1 / RATE_HZ, n, rng)
        means.append(steady_v(world.triad, up[None])[0] + noise.mean(axis=0))
    columns = np.column_stack([np.ones(len(ORIENTATIONS)), ORIENTATIONS])
    solved = np.linalg.lstsq(columns, np.array(means), rcond=None)[0]
    return LinearCalibration(solved[0], solved[1:].T, len(ORIENTATIONS), (dwell_s + 4.0) * len(ORIENTATIONS))


def magnitude_fit(means: Array) -> tuple[Array, Array, float]:
    """b (3,), lower triangular M (3, 3) and the rms residual in g, so that |M^-1 (v - b)| = 1 for all means (n, 3)."""
    middle = means.mean(axis=0)
    size = float(np.linalg.norm(means - middle, axis=1).mean())
    lower = np.tril_indices(3)

    def residual(theta: Array) -> Array:
        inverse = np.zeros((3, 3))
        inverse[lower] = theta[3:]
        return np.asarray(np.linalg.norm(((means - middle) / size - theta[:3]) @ inverse.T, axis=1) - 1)

    found = least_squares(residual, np.concatenate([np.zeros(3), np.eye(3)[lower]]))
    inverse = np.zeros((3, 3))
    inverse[lower] = found.x[3:]
    return middle + size * found.x[:3], size * np.linalg.inv(inverse), float(np.sqrt(2 * found.cost / len(means)))


def _samples(world: HandheldWorld, duration_s: float) -> Array:
    return world.adc_volts(FORCES, world.now_s + 1 / RATE_HZ, 1 / RATE_HZ, round(duration_s * RATE_HZ))


def _moving_variance(samples: Array, width: int) -> Array:
    """Norm of the three variances in a window about each sample, shape (n,)."""
    centred = samples - samples.mean(axis=0)
    first, second = (np.cumsum(np.vstack([np.zeros(3), part]), axis=0) for part in (centred, centred**2))
    variance = (second[width:] - second[:-width]) / width - ((first[width:] - first[:-width]) / width) ** 2
    norm = np.linalg.norm(variance, axis=1)
    return np.pad(norm, (width // 2, len(samples) - len(norm) - width // 2), constant_values=np.inf)


def _intervals(samples: Array, still: Array, width: int, shortest: int) -> Array:
    """Means of the stretches at rest of `shortest` samples or more, shape (k, 3)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(int), [0]])))
    bounds = [(a, b) for a, b in pairwise(edges) if still[a] and b - a >= shortest]
    return np.array([samples[a:b].mean(axis=0) for a, b in bounds]).reshape(-1, 3)


# A magnetometer in a hand.

FIELD_UT = 50.0
PLACE = {"field_ut": FIELD_UT, "dip_deg": 65.0, "declination_deg": 3.0}


def magnetometer_settings(seed: int) -> dict[str, Any]:
    """A magnetometer with its own offsets, gains and angles, near a magnet and iron that turn with it."""
    rng = np.random.default_rng([seed, 31])
    plates = {
        axis: {"volts_per_ut": 0.02 * (1 + 0.03 * gain), "offset_v": 0.02 * offset}
        for axis, gain, offset in zip("xyz", *rng.standard_normal((2, 3)), strict=True)
    }
    moments = dict(zip(("moment_x_ma_m2", "moment_y_ma_m2", "moment_z_ma_m2"), 2 * rng.standard_normal(3), strict=True))
    y_deg, z_deg = 0.5 * rng.standard_normal(2)
    iron = {"x_mm": 9.0, "y_mm": 17.0, "z_mm": -4.0, "radius_mm": float(rng.uniform(3.0, 8.0))}
    return plates | {"y_off_square_deg": y_deg, "z_off_square_deg": z_deg, "magnet": moments, "iron": iron}


def field_world(seed: int, hand: Hand | None = None, **laboratory: Any) -> HandheldWorld:
    """A magnetometer of `magnetometer_settings` and one hand, in a field of FIELD_UT unless `laboratory` changes it."""
    settings = {"preset": "ideal", "magnetometer": magnetometer_settings(seed), "laboratory": PLACE | laboratory}
    return HandheldWorld(WorldConfig.from_mapping(settings), seed, Handheld(hand=hand or Hand()))


def true_ellipsoid(world: HandheldWorld) -> tuple[Array, Array]:
    """Hard iron (3,) and the symmetric matrix (3, 3) whose square is that of the ellipsoid, in V per field."""
    sensor = world.config.magnetometer
    fields, volts = FIELD_UT * np.vstack([np.eye(3), -np.eye(3)]), np.empty((6, 3))
    turned_sensors.magnetometer_volts(record(sensor), turned_sensors.normals(sensor), fields, 0.0, volts)
    return volts.mean(axis=0), symmetric_root((volts[:3] - volts[3:]).T / 2)


def symmetric_root(matrix: Array) -> Array:
    """The symmetric matrix with the same ellipsoid: a turn of the sensor's frame has no effect."""
    values, vectors = np.linalg.eigh(matrix @ matrix.T)
    return np.asarray(vectors * np.sqrt(values) @ vectors.T)


@dataclass(frozen=True)
class FieldErrors:
    """Errors as shares of the field: of the hard iron (3,), of the ellipsoid (3, 3); positions and time."""

    hard_iron: Array
    ellipsoid: Array
    positions: int
    time_s: float


def fields_by_procedure(
    seed: int, hand: Hand | None = None, target_percent: float = 0.2, **laboratory: Any
) -> FieldErrors:
    """hand-fields, with the ellipsoid of its means by an estimate of its own."""
    world = field_world(seed, hand, **laboratory)
    rig, book = hand_session(world)
    hand_fields(rig, target_percent=target_percent)
    means = np.array([[dwell.means[name] for name in FIELDS] for dwell in book.dwells])
    hard_iron, M, _ = magnitude_fit(means)
    true_iron, true_root = true_ellipsoid(world)
    size = float(np.trace(true_root)) / 3
    return FieldErrors((hard_iron - true_iron) / size, (symmetric_root(M) - true_root) / size, len(means), world.now_s)


# A gyroscope in a hand, with an accelerometer on the same board.


def gyroscope_settings(seed: int) -> dict[str, Any]:
    """A gyroscope with its own zeros, gains and angles to the board."""
    rng = np.random.default_rng([seed, 37])
    tines = {
        axis: {"volts_per_nm": 0.11 * (1 + 0.02 * gain), "zero_v": 2.5 + 0.02 * zero}
        for axis, gain, zero in zip("xyz", *rng.standard_normal((2, 3)), strict=True)
    }
    return tines | dict(zip(("turn_x_deg", "turn_y_deg", "turn_z_deg"), 0.7 * rng.standard_normal(3), strict=True))


def turn_world(seed: int, hand: Hand | None = None) -> HandheldWorld:
    """A gyroscope of `gyroscope_settings` and one hand."""
    config = WorldConfig.from_mapping({"preset": "ideal", "gyroscope": gyroscope_settings(seed)})
    return HandheldWorld(config, seed, Handheld(hand=hand or Hand()))


def true_gyroscope(world: HandheldWorld) -> LinearCalibration:
    """Zeros and matrix of the gyroscope in the frame of its accelerometer: x kept, y in the plane of x and y."""
    sensor = world.config.gyroscope
    rates, volts = 50.0 * np.vstack([np.eye(3), -np.eye(3)]), np.empty((6, 3))
    turned_sensors.gyroscope_volts(record(sensor), turned_sensors.die(sensor), rates, np.zeros((6, 3)), 0.0, volts)
    frame, upper = np.linalg.qr(truth(world).M.T)
    return LinearCalibration(
        volts.mean(axis=0), (volts[:3] - volts[3:]).T / 100 @ (frame * np.sign(np.diag(upper))), 0, 0.0
    )


@dataclass(frozen=True)
class TurnErrors:
    """Errors of bias in deg/s, of scale as a share, each (3,), of misalignment in rad (6,); and what they took.

    `worst`: the largest error of scale or misalignment. `normalised`: errors over their stated uncertainties.
    """

    bias_deg_s: Array
    scale: Array
    misalignment: Array
    normalised: Array
    positions: int
    time_s: float

    @property
    def worst(self) -> float:
        """As a share, or in rad."""
        return float(max(np.abs(self.scale).max(), np.abs(self.misalignment).max()))


def turns_by_procedure(seed: int, hand: Hand | None = None, **settings: Any) -> TurnErrors:
    """hand-turns, and the fit of its turns."""
    world = turn_world(seed, hand)
    rig, book = hand_session(world)
    hand_turns(rig, **settings)
    return turn_errors(world, book)


def turn_errors(world: HandheldWorld, book: Book) -> TurnErrors:
    """The errors of a calibration from the record of hand-turns."""
    fitted = fit_turns(Table.from_columns("turns", turn_columns(book.blocks, 2.0), {}, "a hand"))
    true = true_gyroscope(world)
    rows = true.M / true.gains[:, None]
    bias, scale, angle, normalised = [], [], [], []
    for key, estimate in fitted.params.items():
        k = "xyz".index(key.rpartition(".")[2][0])
        if key.startswith("gyro-bias"):
            bias.append((estimate.value - true.b[k]) / true.gains[k])
        elif key.startswith("gyro-scale"):
            scale.append(estimate.value / true.gains[k] - 1)
            normalised.append((estimate.value - true.gains[k]) / estimate.std)
        else:
            angle_deg = np.degrees(np.arcsin(rows[k, "xyz".index(key[-1])]))
            angle.append(np.radians(estimate.value - angle_deg))
            normalised.append((estimate.value - angle_deg) / estimate.std)
    rests = sum(not is_turn(block.pose) for block in book.blocks)
    return TurnErrors(
        np.array(bias), np.array(scale), np.array(angle), np.array(normalised), positions=rests, time_s=world.now_s
    )
