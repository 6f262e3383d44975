"""How far rigs of one kind differ."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Spread:
    """Standard deviations from rig to rig."""

    zero_g_v: float = 0.02
    sensitivity_fraction: float = 0.01
    imperfection_fraction: float = 0.1  # of every imperfection of stages, base and sensor that is not 0
