"""A triaxial accelerometer of three proof masses, each on its own springs between its own plates.

specific force -> part along each mass's direction -> displacement -> divided voltage -> amplifier, filter, noise

Source  Acar and Shkel, MEMS Vibratory Gyroscopes (2009), chapter 4: springs, and capacitors that sense displacement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from drivers.world.accelerometer import per_g_nm
from drivers.world.kernel import Floats

NEWTON = 3  # steps of the balance of load and springs


@dataclass(frozen=True)
class Mass:
    """One proof mass with its plates and its amplifier."""

    resonance_hz: float = 5500.0
    hardening_per_um2: float = 0.0  # relative stiffness gained per square of the displacement; negative softens
    gap_um: float = 1.0
    plate_mismatch_fraction: float = 0.0  # half the difference of both plates' areas, relative to their mean
    zero_v: float = 1.65
    volts_per_g: float = 0.8
    leans_deg: float = 0.0  # of its direction toward the next axis: x toward y, y toward z, z toward x


@dataclass(frozen=True)
class Triad:
    """The three masses, and the common parts of their outputs."""

    x: Mass = field(default_factory=Mass)
    y: Mass = field(default_factory=Mass)
    z: Mass = field(default_factory=Mass)
    noise_v: float = 1.2e-3  # rms of a sample, white behind the filter
    filter_hz: float = 50.0
    wander_v: float = 3e-5  # rms of a slow wander of each zero
    wander_s: float = 300.0
    spread_zero_v: float = 0.03  # from sensor to sensor: standard deviation
    spread_gain: float = 0.02
    spread_leans_deg: float = 0.5


def individual(triad: Triad, random: np.random.Generator) -> Triad:
    """One sensor drawn from the spread of its kind."""
    deviations = random.standard_normal((3, 3))
    masses = [
        replace(
            mass,
            zero_v=mass.zero_v + triad.spread_zero_v * zero,
            volts_per_g=mass.volts_per_g * (1 + triad.spread_gain * gain),
            leans_deg=mass.leans_deg + triad.spread_leans_deg * leans,
        )
        for mass, (zero, gain, leans) in zip((triad.x, triad.y, triad.z), deviations, strict=True)
    ]
    return replace(triad, x=masses[0], y=masses[1], z=masses[2])


def steady_v(triad: Triad, force_g: Floats) -> Floats:
    """Outputs without noise for specific forces (n, 3) in the frame of the sensor, shape (n, 3)."""
    volts = np.empty_like(force_g)
    for k, mass in enumerate((triad.x, triad.y, triad.z)):
        leans = math.radians(mass.leans_deg)
        load_g = math.cos(leans) * force_g[:, k] + math.sin(leans) * force_g[:, (k + 1) % 3]
        volts[:, k] = _read_v(mass, _displacement_nm(mass, load_g))
    return volts


def _displacement_nm(mass: Mass, load_g: Floats) -> Floats:
    """Displacement at which the springs balance the load."""
    load_nm = load_g * per_g_nm(mass.resonance_hz)
    x_nm, hard = load_nm.copy(), 1e-6 * mass.hardening_per_um2
    for _ in range(NEWTON):
        x_nm = x_nm - ((1 + hard * x_nm**2) * x_nm - load_nm) / (1 + 3 * hard * x_nm**2)
    return x_nm


def _read_v(mass: Mass, x_nm: Floats) -> Floats:
    """The voltage at a finger between two plates, amplified; trimmed at rest."""
    u, odd = x_nm / (1e3 * mass.gap_um), mass.plate_mismatch_fraction
    nearer, farther = (1 + odd) / (1 - u), (1 - odd) / (1 + u)
    divided = (nearer - farther) / (nearer + farther) - odd
    seen_nm = 1e3 * mass.gap_um * divided / (1 - odd**2)
    return np.asarray(mass.zero_v + mass.volts_per_g * seen_nm / per_g_nm(mass.resonance_hz))


def noise_v(
    triad: Triad, memory: Floats, wander: Floats, interval_s: float, n: int, random: np.random.Generator
) -> tuple[Floats, Floats, Floats]:
    """Noise of `n` samples (n, 3), and the new `memory` of the filter and the `wander`, each (3,)."""
    from scipy.signal import lfilter  # slow to import, and only a sensor in a hand needs it

    decay = math.exp(-2 * math.pi * triad.filter_hz * interval_s)
    fresh = triad.noise_v * math.sqrt(1 - decay**2) * random.standard_normal((n, 3))
    white, _ = lfilter([1.0], [1.0, -decay], fresh, axis=0, zi=decay * memory[None, :])
    step_s = n * interval_s
    wander_decay = math.exp(-step_s / triad.wander_s)
    wander_after = wander_decay * wander + triad.wander_v * math.sqrt(1 - wander_decay**2) * random.standard_normal(3)
    return np.asarray(white + np.linspace(wander, wander_after, n)), np.asarray(white[-1]), wander_after
