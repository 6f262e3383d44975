"""Normal gravity: that of the earth's ellipsoid at a latitude and height; real places differ by some 0.0005 m/s^2.

Source  H. Moritz, Geodetic Reference System 1980: Somigliana's formula, and the second-order formula for the height.
"""

from __future__ import annotations

import math

EQUATOR_M_S2 = 9.7803267715
K, E2 = 0.001931851353, 0.00669438002290
A_M, F, M = 6378137.0, 0.00335281068118, 0.00344978600308


def normal_gravity(latitude_deg: float, height_m: float = 0.0) -> float:
    """Normal gravity in m/s^2, at a height above the ellipsoid in m."""
    s2 = math.sin(math.radians(latitude_deg)) ** 2
    at_zero = EQUATOR_M_S2 * (1 + K * s2) / math.sqrt(1 - E2 * s2)
    height = height_m / A_M
    return at_zero * (1 - 2 * (1 + F + M - 2 * F * s2) * height + 3 * height**2)
