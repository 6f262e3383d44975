from __future__ import annotations

import numpy as np
import pytest

from drivers.world.accelerometer import ELEMENTS, Friction, drag_nm
from drivers.world.kernel import record


def drags(friction: Friction, path: np.ndarray, neighbour_g: float = 0.0) -> np.ndarray:
    seats = np.zeros(ELEMENTS)
    return np.array([drag_nm(record(friction), seats, x, neighbour_g) for x in path])


CYCLE = np.concatenate([np.linspace(0, 8, 81), np.linspace(8, -8, 161), np.linspace(-8, 8, 161)])


def test_a_stage_without_friction_has_no_drag() -> None:
    assert not drags(Friction(), CYCLE).any()


def test_a_full_cycle_closes_and_opens_most_in_the_middle() -> None:
    drag = drags(Friction(stiffness_fraction=0.005, slip_nm=3.0), CYCLE)
    down, up = drag[81:242], drag[242:][::-1]
    opening = up - down
    assert opening[0] == pytest.approx(0.0, abs=1e-12)
    assert opening[-1] == pytest.approx(0.0, abs=1e-3)
    # fully slipped: twice the sum of the elements' limits, 3 nm (1/4 + 2/4 + 3/4 + 4/4)
    assert opening[80] == pytest.approx(2 * 0.005 * 7.5)
    assert opening.max() == pytest.approx(opening[80])


def test_the_loop_does_not_depend_on_the_step() -> None:
    coarse = drags(Friction(stiffness_fraction=0.01), CYCLE[::20])
    fine = drags(Friction(stiffness_fraction=0.01), CYCLE)
    assert coarse[-1] == pytest.approx(fine[-1])


def test_the_neighbours_load_presses_the_contacts() -> None:
    friction = Friction(stiffness_fraction=0.01, slip_nm=3.0, pressing_per_g2=0.5)
    assert drags(friction, CYCLE, 1.0)[80] == pytest.approx(1.5 * drags(friction, CYCLE, 0.0)[80])
