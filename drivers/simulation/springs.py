"""The proof mass on its springs: from specific force to displacement, in nm.

In the plane the four folded beams balance the mass (Newton's method); the stiffness may harden with
deflection, differ for both directions, couple x with y, and follow temperature. A beam that bends is
also shortened (foreshortening), so the mass is drawn aside by the square of the neighbour's deflection
and of the sag; beams of unequal height tilt the mass as it sags. Package stress displaces it with temperature.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.simulation.kernel import kernel

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
def drawn_aside_nm(springs: Springs, neighbour_nm: float, sag_nm: float, stress_k: float) -> float:
    """Displacement that is no balance of forces: foreshortened beams, tilt by sag, package stress."""
    shortened = springs.foreshortening_per_um * neighbour_nm**2 + springs.sag_foreshortening_per_um * sag_nm**2
    return 1e-3 * (shortened + springs.stress_pm_per_k * stress_k) + springs.sag_tilt_fraction * sag_nm
