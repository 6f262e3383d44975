"""The differential capacitor and its amplifier: from displacement to volts.

A finger moves between two fixed ones, gaps d (1 + m) and d (1 - m): the capacitances' difference is linear
for small displacements of a centred finger only. Sag and the neighbour's displacement change the overlap;
charge that creeps into the oxide pulls the finger aside. The factory trims offset and gain at zero load
and 25 C; the output is a fraction of the supply.
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
    gap_mismatch_fraction: float = 0.0  # how far the finger rests off the middle, relative to the gap
    overlap_loss_per_um2: float = 0.0  # relative overlap lost per square of the height difference
    height_step_nm: float = 0.0  # height difference of moving and fixed fingers at zero load
    overlap_slide_per_um: float = 0.0  # relative overlap gained per displacement of the neighbouring axis
    charging_pm: float = 0.0  # displacement by charge that creeps into the plates' oxide while powered
    dead_band_nm: float = 0.0  # half width around the trimmed zero in which the amplifier is blind


@kernel
def difference(mismatch: float, u: float) -> float:
    """Half the difference of both capacitances, in units of the nominal one, at displacement u (of the gap)."""
    return (1 / (1 - mismatch - u) - 1 / (1 + mismatch + u)) / 2


@kernel
def read_v(
    plates: Plates, resonance_hz: float, x_nm: float, neighbour_nm: float, sag_nm: float, supply_v: float
) -> float:
    """Output in V for a displaced finger; clipped near the rails."""
    m, gap_nm = plates.gap_mismatch_fraction, 1e3 * plates.gap_um
    height = plates.height_step_nm + sag_nm
    lost = 1e-6 * plates.overlap_loss_per_um2 * (height**2 - plates.height_step_nm**2)
    overlap = 1 - lost + 1e-3 * plates.overlap_slide_per_um * neighbour_nm
    slope = (1 / (1 - m) ** 2 + 1 / (1 + m) ** 2) / 2
    seen_nm = (overlap * difference(m, x_nm / gap_nm) - difference(m, 0.0)) / slope * gap_nm
    seen_nm = math.copysign(max(0.0, abs(seen_nm) - plates.dead_band_nm), seen_nm)
    volts = plates.zero_g_v + plates.sensitivity_v_per_g * seen_nm / per_g_nm(resonance_hz)
    return min(max(volts * supply_v / TRIM_SUPPLY_V, RAIL_V), max(RAIL_V, supply_v - RAIL_V))
