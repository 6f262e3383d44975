"""The differential capacitor and its amplifier: from displacement to volts.

A finger between two fixed ones divides a voltage: (C1 - C2) / (C1 + C2 + stray). With equal plates and no
stray capacitance that is linear in the displacement, whatever the gap. Sag and the neighbour's displacement
change the overlap; charge that creeps into the oxide pulls the finger aside. The factory trims offset and
gain at zero load and 25 C; the output is a fraction of the supply.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.simulation.kernel import kernel
from drivers.simulation.springs import per_g_nm

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


@kernel
def divided(plates: Plates, overlap: float, u: float) -> float:
    """Share of the voltage at a finger displaced by u (of the gap), with a relative overlap."""
    nearer = overlap * (1 + plates.plate_mismatch_fraction) / (1 - u)
    farther = overlap * (1 - plates.plate_mismatch_fraction) / (1 + u)
    return (nearer - farther) / (nearer + farther + plates.stray_fraction)


@kernel
def slope(plates: Plates) -> float:
    """Slope of `divided` at rest, which the factory trims."""
    whole = 2 + plates.stray_fraction
    return 2 / whole - (2 * plates.plate_mismatch_fraction / whole) ** 2


@kernel
def read_v(
    plates: Plates, resonance_hz: float, x_nm: float, neighbour_nm: float, sag_nm: float, supply_v: float
) -> float:
    """Output in V for a displaced finger; clipped near the rails."""
    gap_nm = 1e3 * plates.gap_um
    lost = (plates.height_step_nm + sag_nm) ** 2 - plates.height_step_nm**2
    overlap = 1 - 1e-6 * plates.overlap_loss_per_um2 * lost + 1e-3 * plates.overlap_slide_per_um * neighbour_nm
    change = divided(plates, overlap, x_nm / gap_nm) - divided(plates, 1.0, 0.0)
    seen_nm = gap_nm * change / slope(plates)
    seen_nm = math.copysign(max(0.0, abs(seen_nm) - plates.dead_band_nm), seen_nm)
    volts = plates.zero_g_v + plates.sensitivity_v_per_g * seen_nm / per_g_nm(resonance_hz)
    return min(max(volts * supply_v / TRIM_SUPPLY_V, RAIL_V), max(RAIL_V, supply_v - RAIL_V))
