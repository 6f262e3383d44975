"""Disturbances of the sensor that a model of a good sensor does not have, all off by default; and its supply.

Each displaces the mass: charge on the plates from a certain time on; a cable that pulls in one sector of beta; a mount
with two seats, between which gravity decides; a lid that snaps in and out at random times; dust between the fingers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from drivers.world.kernel import kernel, step_wander
from drivers.world.state import State


@dataclass(frozen=True)
class Oddities:
    """Displacements in pm (8 pm are about 1 mg), equal on both axes unless stated otherwise."""

    charge_pm: float = 0.0  # from `charge_s` on
    charge_s: float = 1800.0
    tug_pm: float = 0.0  # at the middle of the sector
    tug_middle_deg: float = 200.0
    tug_half_width_deg: float = 25.0
    seat_pm: float = 0.0  # apart, of two seats between which the mount rocks
    seat_toward_deg: float = 35.0  # in-plane direction of gravity in which it rocks over
    seat_grip_g: float = 0.3  # in-plane load that it takes to rock over
    lid_pm: float = 0.0  # while the lid is popped in
    lid_every_s: float = 500.0  # mean time between pops
    dust_fraction: float = 0.0  # share of the travel beyond the grain that is lost
    dust_nm: float = 4.0  # where x or y meets the grain


@kernel
def oddities_tick(world: State, odd: Oddities, step_s: float, normal: float) -> None:
    """Pop the lid, or not: the tail of a normal number against the chance of a pop in this tick."""
    chance = math.erfc(abs(normal) / math.sqrt(2.0))
    if chance < step_s / odd.lid_every_s:
        world.lid_in = 1.0 - world.lid_in


@kernel
def rock(world: State, odd: Oddities, gx: float, gy: float) -> None:
    """Let gravity rock the mount between its seats."""
    toward = math.radians(odd.seat_toward_deg)
    load = gx * math.cos(toward) + gy * math.sin(toward)
    if abs(load) > odd.seat_grip_g:
        world.seat = math.copysign(0.5, load)


@kernel
def displacement_nm(world: State, odd: Oddities, beta_deg: float, t_s: float) -> float:
    """Displacement by the faults, nm, equal for both axes."""
    pm = odd.seat_pm * world.seat + odd.lid_pm * world.lid_in
    if t_s >= odd.charge_s:
        pm += odd.charge_pm
    distance_deg = (beta_deg - odd.tug_middle_deg + 180) % 360 - 180
    if abs(distance_deg) < odd.tug_half_width_deg:
        pm += odd.tug_pm * math.cos(math.pi / 2 * distance_deg / odd.tug_half_width_deg) ** 2
    return 1e-3 * pm


@kernel
def stopped_nm(odd: Oddities, x_nm: float) -> float:
    """Travel that a grain of dust prevents, nm."""
    return -odd.dust_fraction * max(0.0, x_nm - odd.dust_nm)


# The supply of the sensor: nominal voltage, drift, a slow cycle, a random wander.


@dataclass(frozen=True)
class Supply:
    """The slow changes of the supply voltage. Its fast ripple is picked up as hum (see `pickup`)."""

    nominal_v: float = 5.0
    drift_v_per_h: float = 0.0
    cycle_v: float = 0.0  # amplitude of a slow sinusoid that starts at 0
    cycle_s: float = 600.0
    wander_v: float = 0.0  # rms of a slow random wander
    wander_s: float = 300.0  # its correlation time


@kernel
def supply_tick(world: State, supply: Supply, t_s: float, step_s: float, normal: float) -> None:
    """Advance the supply by one tick that ends at `t_s`."""
    world.supply_wander_v = step_wander(world.supply_wander_v, supply.wander_v, supply.wander_s, step_s, normal)
    cycle = supply.cycle_v * math.sin(2 * math.pi * t_s / supply.cycle_s)
    world.supply_v = supply.nominal_v + supply.drift_v_per_h * t_s / 3600 + cycle + world.supply_wander_v
