"""The calibration of the simulated D63, as a laboratory would make it: gaps set, volts read, both rounded.

    python -m drivers.simulation.fibre_probe_certificate > drivers/philtec_d63_simulated.yaml

The target is driven away from the tip in steps, its gap read off an interferometer to 0.01 um, the output off a
voltmeter to 0.1 mV as the mean of many readings. Points at the foot and near the peak, where the curve has no
slope, are left out.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable

import numpy as np

from drivers.simulation.fibre_probe import FibreProbe, seen_v
from drivers.simulation.kernel import Floats, record

SERIAL, DATE = "SIM-0063", "2026-11-21"
GAPS_UM = np.concatenate([np.arange(20.0, 420.0, 10.0), np.arange(420.0, 2001.0, 40.0)])
WANDER_UM = 0.4  # by which a hand misses a step
READINGS = 1000  # that are averaged at each
FOOT_SHARE, PEAK_SHARE = 0.02, 0.95  # of the highest reading: only what is between them is used


def measured(probe: FibreProbe, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Gaps in um and volts, as they are written down."""
    gaps = GAPS_UM + WANDER_UM * random.standard_normal(len(GAPS_UM))
    numbers = record(probe)
    volts = np.array([seen_v(numbers, gap) for gap in gaps])
    volts += probe.noise_v / np.sqrt(READINGS) * random.standard_normal(len(gaps))
    return np.round(gaps, 2), np.round(volts, 4)


def certificate(probe: FibreProbe, seed: int = 63) -> str:
    """The curve as a YAML document that `philtec_d63.Curve` reads."""
    gaps, volts = measured(probe, np.random.Generator(np.random.PCG64(seed)))
    highest = int(np.argmax(volts))
    used = (volts > FOOT_SHARE * volts[highest]) & (volts < PEAK_SHARE * volts[highest])
    points = [f"  - [{gap:.2f}, {volt:.4f}]" for gap, volt in zip(gaps, volts, strict=True)]
    near = (point for point, use in zip(points[:highest], used[:highest], strict=True) if use)
    far = (point for point, use in zip(points[highest:], used[highest:], strict=True) if use)
    return "\n".join([*_heading(), "near:  # gap in um, output in V", *near, "far:", *far]) + "\n"


def _heading() -> Iterable[str]:
    yield "# Calibration of the simulated D63: python -m drivers.simulation.fibre_probe_certificate"
    yield f"serial: {SERIAL}"
    yield f'date: "{DATE}"'


if __name__ == "__main__":
    sys.stdout.write(certificate(FibreProbe()))
