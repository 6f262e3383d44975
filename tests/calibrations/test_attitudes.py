"""The choice of attitudes of a magnetometer in a hand, without noise."""

from __future__ import annotations

import numpy as np
import pytest

from calibrations.design.attitudes import (
    ATTITUDES,
    FIRST,
    MATRICES,
    assumed_field,
    estimate_field,
    name_attitude,
    next_attitude,
)
from calibrations.geometry.sphere import worst_ratio


def field(dip_deg: float) -> np.ndarray:
    dip = np.radians(dip_deg)
    return np.array([np.cos(dip), 0.0, -np.sin(dip)])


def test_each_attitude_has_a_name_of_its_own_and_is_a_rotation() -> None:
    assert len(ATTITUDES) == len({attitude.words for attitude in ATTITUDES}) == 144
    assert all(name_attitude(attitude.words) is attitude for attitude in ATTITUDES)
    assert MATRICES @ MATRICES.transpose(0, 2, 1) == pytest.approx(np.tile(np.eye(3), (144, 1, 1)))
    assert np.linalg.det(MATRICES) == pytest.approx(1.0)
    assert name_attitude("+x side up") is None


def test_the_field_in_the_room_survives_a_wrong_attitude() -> None:
    attitudes, true = ATTITUDES[::24], field(70.0)
    directions = np.array([attitude.matrix @ true for attitude in attitudes])
    directions[2] = -directions[2]
    assert estimate_field(directions, attitudes) == pytest.approx(true, abs=1e-9)


@pytest.mark.parametrize("dip_deg", [-90, -60, 0, 45, 70, 90])
def test_twelve_chosen_attitudes_determine_the_ellipsoid(dip_deg: float) -> None:
    true, taken = field(dip_deg), []
    for k in range(12):
        known = assumed_field() if k < 5 else true
        directions = np.array([attitude.matrix @ known for attitude in taken]).reshape(-1, 3)
        chosen = next_attitude(directions, known, taken[-1] if taken else None)
        assert k >= 6 or np.abs(chosen.attitude.up).max() == 1.0  # a side upward
        taken.append(chosen.attitude)
    assert worst_ratio(np.array([attitude.matrix @ true for attitude in taken]), 2) < 3


def test_the_words_say_how_to_turn() -> None:
    first = next_attitude(np.zeros((0, 3)), assumed_field(), None)
    assert (first.attitude.words, first.turn) == ("+z side up, +x side to the north", "")
    true, taken = field(60.0), [FIRST.matrix @ field(60.0)]
    second = next_attitude(np.array(taken), true, FIRST)
    assert second.attitude.words != first.attitude.words
    assert second.turn.startswith("turn it by ")
