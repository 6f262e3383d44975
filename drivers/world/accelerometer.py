"""The accelerometer, from specific force to volts: friction and springs of its proof mass, plates and amplifier.

Friction: Maxwell slip elements parallel to the spring. Each element is a weak spring that ends in a sliding contact: it
follows the mass, and slips when its stretch is at the limit. Four of them, with limits of 1/4 to 4/4 of the largest,
give a smooth loop. The load of the neighbouring axis can increase the pressure on the contact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from drivers.world.kernel import Floats, kernel

ELEMENTS = 4


@dataclass(frozen=True)
class Friction:
    """The slip elements of one sensing axis."""

    stiffness_fraction: float = 0.0  # of one element, relative to the spring
    slip_nm: float = 3.0  # stretch at which the last element slips
    pressing_per_g2: float = 0.0  # relative growth of all limits per square of the neighbouring axis's load


@kernel
def drag_nm(friction: Friction, seats: Floats, x_nm: float, neighbour_g: float) -> float:
    """Displacement lost to friction at `x_nm`; moves the elements' `seats` (nm, shape (4,)) along."""
    limit = friction.slip_nm * (1 + friction.pressing_per_g2 * neighbour_g**2) / ELEMENTS
    drag = 0.0
    for k in range(ELEMENTS):
        reach = (k + 1) * limit
        seats[k] = min(max(seats[k], x_nm - reach), x_nm + reach)
        drag += x_nm - seats[k]
    return friction.stiffness_fraction * drag


# The proof mass on its springs: from specific force to displacement, in nm.
#
# In the plane the four folded beams balance the mass (Newton's method). Their stiffness can change with deflection and
# temperature, differ for both directions, and couple x with y. A bent beam is shorter (foreshortening), so the mass
# moves by the square of the neighbour's deflection and of the sag; beams of unequal height tilt the mass as it sags.
# Package stress displaces it with temperature.

STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True)
class Springs:
    """The springs of one sensing axis."""

    resonance_hz: float = 5500.0  # in-plane resonance: fixes the displacement per g (8.2 nm)
    hardening_per_um2: float = 0.0  # relative stiffness gained per square of displacement; negative softens
    one_sided_fraction: float = 0.0  # stiffness toward + minus stiffness toward -, relative
    coupling_fraction: float = 0.0  # share of the neighbour's displacement that pulls on this axis
    foreshortening_per_um: float = 0.0  # displacement per square of the neighbour's displacement
    sag_foreshortening_per_um: float = 0.0  # displacement per square of the sag
    sag_tilt_fraction: float = 0.0  # displacement per sag
    stress_pm_per_k: float = 0.0  # displacement by package stress
    stiffening_ppm_per_k: float = 0.0  # relative change of stiffness with temperature


@kernel
def per_g_nm(resonance_hz: float) -> float:
    """Displacement under 1 g of a mass on springs with this resonance."""
    return 1e9 * STANDARD_GRAVITY_M_S2 / (2 * math.pi * resonance_hz) ** 2


@kernel
def restoring_nm(springs: Springs, x_nm: float, warmer_k: float) -> tuple[float, float]:
    """Restoring force of one axis and its slope, in units of the nominal stiffness."""
    warm = 1 + 1e-6 * springs.stiffening_ppm_per_k * warmer_k
    hard = springs.hardening_per_um2 * 1e-6 * x_nm * x_nm
    side = math.copysign(springs.one_sided_fraction / 2, x_nm)
    return warm * (1 + hard + side) * x_nm, warm * (1 + 3 * hard + side)


@kernel
def balanced_nm(x: Springs, y: Springs, gx: float, gy: float, warmer_k: float) -> tuple[float, float]:
    """In-plane displacements that balance the loads (in g): three Newton steps, good to 1e-9 of full scale."""
    load_x, load_y = gx * per_g_nm(x.resonance_hz), gy * per_g_nm(y.resonance_hz)
    dx, dy = load_x, load_y
    for _ in range(3):
        fx, kx = restoring_nm(x, dx, warmer_k)
        fy, ky = restoring_nm(y, dy, warmer_k)
        rx = load_x - fx - x.coupling_fraction * dy
        ry = load_y - fy - y.coupling_fraction * dx
        det = kx * ky - x.coupling_fraction * y.coupling_fraction
        dx += (ky * rx - x.coupling_fraction * ry) / det
        dy += (kx * ry - y.coupling_fraction * rx) / det
    return dx, dy


@kernel
def shift_nm(springs: Springs, neighbour_nm: float, sag_nm: float, stress_k: float) -> float:
    """Displacement that is no balance of forces: foreshortened beams, tilt by sag, package stress."""
    shortened = springs.foreshortening_per_um * neighbour_nm**2 + springs.sag_foreshortening_per_um * sag_nm**2
    return 1e-3 * (shortened + springs.stress_pm_per_k * stress_k) + springs.sag_tilt_fraction * sag_nm


# The differential capacitor and its amplifier: from displacement to volts.
#
# A finger between two fixed ones divides a voltage: (C1 - C2) / (C1 + C2 + stray). With equal plates and no stray
# capacitance this is linear in the displacement, for any gap. Sag and the neighbour's displacement change the overlap;
# charge that creeps into the oxide displaces the finger. The factory trims offset and gain at zero load and 25 C; the
# output is a fraction of the supply.

TRIM_SUPPLY_V = 5.0
RAIL_V = 0.05


@dataclass(frozen=True)
class Plates:
    """The plates and the amplifier of one sensing axis."""

    zero_g_v: float = 2.5  # output at 0 g, 5 V, 25 C
    sensitivity_v_per_g: float = 1.0  # at 5 V, 25 C
    gap_um: float = 1.0
    plate_mismatch_fraction: float = 0.0  # half the difference of both plates' areas, relative to their mean
    stray_fraction: float = 0.0  # stray capacitance, relative to one plate's capacitance at rest
    overlap_loss_per_um2: float = 0.0  # relative overlap lost per square of the height difference
    height_step_nm: float = 0.0  # height difference of moving and fixed fingers at zero load
    overlap_slide_per_um: float = 0.0  # relative overlap gained per displacement of the neighbouring axis
    charging_pm: float = 0.0  # displacement by charge that creeps into the plates' oxide while powered
    dead_band_nm: float = 0.0  # half width around the trimmed zero in which the amplifier is blind


@dataclass(frozen=True)
class OutOfPlane:
    """The plates above and below the proof mass, which sense its sag: the third axis of a triaxial sensor."""

    plates: Plates = field(default_factory=lambda: Plates(gap_um=2.0))
    stress_pm_per_k: float = 0.0  # sag by package stress
    noise_v: float = 1.5e-3  # rms of a sample


@kernel
def divide_voltage(plates: Plates, overlap: float, u: float) -> float:
    """Share of the voltage at a finger displaced by u (of the gap), with a relative overlap."""
    nearer = overlap * (1 + plates.plate_mismatch_fraction) / (1 - u)
    farther = overlap * (1 - plates.plate_mismatch_fraction) / (1 + u)
    return (nearer - farther) / (nearer + farther + plates.stray_fraction)


@kernel
def slope(plates: Plates) -> float:
    """Slope of `divide_voltage` at rest, which the factory trims."""
    plate_sum = 2 + plates.stray_fraction
    return 2 / plate_sum - (2 * plates.plate_mismatch_fraction / plate_sum) ** 2


@kernel
def read_v(
    plates: Plates, resonance_hz: float, x_nm: float, neighbour_nm: float, sag_nm: float, supply_v: float
) -> float:
    """Output in V for a displaced finger; clipped near the rails."""
    gap_nm = 1e3 * plates.gap_um
    height_change_nm2 = (plates.height_step_nm + sag_nm) ** 2 - plates.height_step_nm**2
    overlap = (
        1 - 1e-6 * plates.overlap_loss_per_um2 * height_change_nm2 + 1e-3 * plates.overlap_slide_per_um * neighbour_nm
    )
    change = divide_voltage(plates, overlap, x_nm / gap_nm) - divide_voltage(plates, 1.0, 0.0)
    seen_nm = gap_nm * change / slope(plates)
    seen_nm = math.copysign(max(0.0, abs(seen_nm) - plates.dead_band_nm), seen_nm)
    volts = plates.zero_g_v + plates.sensitivity_v_per_g * seen_nm / per_g_nm(resonance_hz)
    return min(max(volts * supply_v / TRIM_SUPPLY_V, RAIL_V), max(RAIL_V, supply_v - RAIL_V))
