"""The supply of the sensor: nominal voltage, drift, a slow cycle, a random wander."""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.simulation.kernel import kernel
from drivers.simulation.relaxation import wandered
from drivers.simulation.state import State


@dataclass(frozen=True)
class Supply:
    """All slow: a supply's fast ripple is picked up as hum (see noise)."""

    nominal_v: float = 5.0
    drift_v_per_h: float = 0.0
    cycle_v: float = 0.0  # amplitude of a slow sinusoid that starts at 0
    cycle_s: float = 600.0
    wander_v: float = 0.0  # rms of a slow random wander
    wander_s: float = 300.0  # its correlation time


@kernel
def tick(world: State, supply: Supply, t_s: float, step_s: float, normal: float) -> None:
    """Advance the supply by one tick that ends at `t_s`."""
    world.supply_wander_v = wandered(world.supply_wander_v, supply.wander_v, supply.wander_s, step_s, normal)
    cycle = supply.cycle_v * math.sin(2 * math.pi * t_s / supply.cycle_s)
    world.supply_v = supply.nominal_v + supply.drift_v_per_h * t_s / 3600 + cycle + world.supply_wander_v
