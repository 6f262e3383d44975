"""The fibre-optic displacement sensor: from the gap between its tip and the carriage to volts.

Fibres light the target through the gap, other fibres beside them catch what comes back. The returned spot widens
with the gap: w = w0 + 2 gap tan(divergence). A receiving fibre at the distance s from the spot's middle catches

    exp(-2 s^2 / w^2) / w^2

of a Gaussian spot: more and more as the spot reaches it (near side), most at w^2 = 2 s^2 (optical peak), and less
again as the same light is spread over a larger spot (far side).

The probe is held by the turning table, behind the carriage: the gap grows with the carriage's x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.simulation.kernel import kernel


@dataclass(frozen=True)
class FibreProbe:
    """Tip, electronics and where it is clamped."""

    peak_v: float = 5.0  # at the optical peak: the gain is set there
    spacing_um: float = 200.0  # from lighting to receiving fibres
    spot_um: float = 60.0  # radius of the spot without gap
    divergence_deg: float = 16.7  # half the angle of the fibres' cone
    standoff_um: float = 150.0  # gap with the carriage at 0
    noise_v: float = 0.3e-3  # rms of a sample


@kernel
def seen_v(probe: FibreProbe, gap_um: float) -> float:
    """Output at a gap; a target that touches the tip is at 0."""
    width = probe.spot_um + 2 * max(0.0, gap_um) * math.tan(math.radians(probe.divergence_deg))
    reach = 2 * (probe.spacing_um / width) ** 2
    return probe.peak_v * reach * math.exp(1 - reach)
