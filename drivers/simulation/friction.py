"""Friction inside the suspension: Maxwell slip elements beside the spring.

Each element is a weak spring that ends in a sliding contact: it follows the mass, and slips once it is
stretched by its limit. Four of them, with limits of 1/4 to 4/4 of the largest, make a smooth loop.
The contact may be pressed harder by the load of the neighbouring axis.
"""

from __future__ import annotations

from dataclasses import dataclass

from drivers.simulation.kernel import Floats, kernel

ELEMENTS = 4


@dataclass(frozen=True)
class Friction:
    """The slip elements of one sensing axis."""

    stiffness_fraction: float = 0.0  # of one element, relative to the spring
    slip_nm: float = 3.0  # stretch at which the last element slips
    pressing_per_g2: float = 0.0  # relative growth of all limits per square of the neighbouring axis's load


@kernel
def drag_nm(friction: Friction, seats: Floats, x_nm: float, neighbour_g: float) -> float:
    """Displacement lost to friction at `x_nm`; moves the elements' `seats` (nm, shape (4,)) along."""
    limit = friction.slip_nm * (1 + friction.pressing_per_g2 * neighbour_g**2) / ELEMENTS
    drag = 0.0
    for k in range(ELEMENTS):
        reach = (k + 1) * limit
        seats[k] = min(max(seats[k], x_nm - reach), x_nm + reach)
        drag += x_nm - seats[k]
    return friction.stiffness_fraction * drag
