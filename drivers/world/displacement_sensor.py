"""The fibre-optic displacement sensor: from the gap between tip and carriage to volts, and its calibration curve.

Fibres light the target through the gap, and other fibres beside them receive the reflected light. The reflected spot
widens with the gap: w = w0 + 2 gap tan(divergence). A fibre at the distance s from the middle of the spot receives

    exp(-2 s^2 / w^2) / w^2

of a Gaussian spot. This grows until the spot reaches the fibre (near side), is largest at w^2 = 2 s^2 (optical peak),
and falls as the same light is spread over a larger spot (far side).

The probe is on the turning table, behind the carriage: the gap grows with the carriage's x.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass

import numpy as np

from drivers.world.kernel import Floats, kernel, record


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


# The calibration of the simulated D63, as in a laboratory: gaps are set and volts are read, both rounded.
#
#     python -m drivers.world.displacement_sensor > drivers/philtec_d63_simulated.yaml
#
# The target moves away from the tip in steps. An interferometer gives the gap to 0.01 um, a voltmeter the output to
# 0.1 mV, as the mean of many readings. Points at the foot and near the peak, where the curve has no slope, are omitted.

SERIAL, DATE = "SIM-0063", "2026-11-21"
GAPS_UM = np.concatenate([np.arange(20.0, 420.0, 10.0), np.arange(420.0, 2001.0, 40.0)])
WANDER_UM = 0.4  # standard deviation of a gap that is set by hand
READINGS = 1000  # averaged at each step
FOOT_SHARE, PEAK_SHARE = 0.02, 0.95  # of the highest reading: only readings between them are used


def measure_curve(probe: FibreProbe, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Gaps in um and volts, rounded as in the certificate."""
    gaps = GAPS_UM + WANDER_UM * random.standard_normal(len(GAPS_UM))
    numbers = record(probe)
    volts = np.array([seen_v(numbers, gap) for gap in gaps])
    volts += probe.noise_v / np.sqrt(READINGS) * random.standard_normal(len(gaps))
    return np.round(gaps, 2), np.round(volts, 4)


def certificate(probe: FibreProbe, seed: int = 63) -> str:
    """The curve as a YAML document that `philtec_d63.CalibrationCurve` reads."""
    gaps, volts = measure_curve(probe, np.random.Generator(np.random.PCG64(seed)))
    highest = int(np.argmax(volts))
    used = (volts > FOOT_SHARE * volts[highest]) & (volts < PEAK_SHARE * volts[highest])
    points = [f"  - [{gap:.2f}, {volt:.4f}]" for gap, volt in zip(gaps, volts, strict=True)]
    near = (point for point, use in zip(points[:highest], used[:highest], strict=True) if use)
    far = (point for point, use in zip(points[highest:], used[highest:], strict=True) if use)
    heading = (
        "# Calibration of the simulated D63: python -m drivers.world.displacement_sensor",
        f"serial: {SERIAL}",
        f'date: "{DATE}"',
    )
    return "\n".join([*heading, "near:  # gap in um, output in V", *near, "far:", *far]) + "\n"


if __name__ == "__main__":
    sys.stdout.write(certificate(FibreProbe()))
