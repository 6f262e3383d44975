"""hand-fields on a simulated hand, without sockets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from drivers.handheld.hand import Hand
from procedures.hand_fields import hand_fields
from procedures.session import Dwell
from tests.handling import (
    CALM,
    FIELDS,
    FieldErrors,
    field_world,
    fields_by_procedure,
    hand_session,
    true_ellipsoid,
)
from tests.procedures.bench import Book

FEWEST = 12
MAGNET = {"x_mm": 0.0, "z_mm": -80.0, "moment_z_ma_m2": 40.0}  # below the table


def taken(
    hand: Hand = CALM, dwells: tuple[Dwell, ...] = (), place: Mapping[str, Any] | None = None, **settings: Any
) -> Book:
    world = field_world(1, hand, **(place or {}))
    rig, book = hand_session(world, dwells)
    hand_fields(rig, **settings)
    return book


@pytest.fixture(scope="module")
def calm() -> Book:
    return taken()


def directions(book: Book) -> np.ndarray:
    """Directions of the field in the sensor, by the true hard iron."""
    means = np.array([[dwell.means[name] for name in FIELDS] for dwell in book.dwells])
    centred = means - true_ellipsoid(book.world)[0]
    return np.asarray(centred / np.linalg.norm(centred, axis=1, keepdims=True))


def test_a_calm_hand_needs_no_more_positions_than_the_parameters_do(calm: Book) -> None:
    assert len(calm.dwells) == FEWEST
    assert calm.asked == ["at-rest"]
    assert calm.world.now_s < 150


def test_the_first_position_needs_no_turn(calm: Book) -> None:
    first = next(guidance for guidance in calm.guided if guidance.moves)
    assert first.text.startswith("position 1: +z side up, +x side to the north, then let go")
    assert (first.up, first.north) == ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))


def test_each_direction_of_the_field_is_the_requested_one(calm: Book) -> None:
    turns = [guidance for guidance in calm.guided if guidance.moves]
    known = slice(5, None)  # from the sixth position on the direction of the field in the room is known
    cosines = np.sum(directions(calm)[known] * np.array([guidance.target for guidance in turns])[known], axis=1)
    assert np.degrees(np.arccos(np.minimum(cosines, 1.0))).max() < 40  # a heading is missed by 10 deg, an edge by 8


def test_the_directions_cover_the_sphere(calm: Book) -> None:
    spread = np.linalg.svd(directions(calm))[1]
    assert spread.min() > 0.7 * spread.max()
    assert np.array(calm.guided[-1].taken) == pytest.approx(directions(calm), abs=0.1)


@pytest.mark.parametrize("dip_deg", [-70.0, 0.0, 89.0])
def test_it_works_everywhere_on_earth(dip_deg: float) -> None:
    errors = fields_by_procedure(1, dip_deg=dip_deg)
    assert errors.positions <= FEWEST + 2
    assert 100 * worst(errors) < 0.2


def test_north_may_be_any_direction() -> None:
    errors = fields_by_procedure(2, declination_deg=130.0)
    assert errors.positions <= FEWEST + 2
    assert 100 * worst(errors) < 0.2


def test_a_smaller_target_takes_more_positions(calm: Book) -> None:
    assert len(calm.dwells) < len(taken(target_percent=0.009).dwells) <= 40
    assert len(taken(target_percent=1e-6, most_positions=14).dwells) == 14


def test_a_resumed_run_goes_on_after_its_last_position(calm: Book) -> None:
    again = taken(dwells=tuple(calm.dwells[:9]))
    assert len(again.dwells) == FEWEST
    assert len(again.blocks) == FEWEST - 9


def test_a_magnet_in_the_table_is_reported_and_does_not_pass(calm: Book) -> None:
    book = taken(place={"magnet": MAGNET}, most_positions=16)
    assert len(book.dwells) == 16
    assert "the magnitude of the field differs by" in book.guided[-1].text
    assert not any("magnitude of the field" in guidance.text for guidance in calm.guided)


def test_a_clumsy_hand_takes_longer_and_is_not_worse() -> None:
    clumsy = Hand(slips=0.3, errs=0.15, clings=0.3, patience_s=5.0, table_deg=5.0, tremor_deg=0.8)
    assert 100 * worst(fields_by_procedure(4, clumsy)) < 0.2


@pytest.mark.slow
def test_ten_hands_reach_the_target() -> None:
    found = [fields_by_procedure(seed) for seed in range(1, 11)]
    assert max(100 * worst(errors) for errors in found) < 0.1
    assert max(errors.positions for errors in found) <= FEWEST + 2
    assert max(errors.time_s for errors in found) < 200


def worst(errors: FieldErrors) -> float:
    """The largest error, as a share of the field."""
    return float(max(np.abs(errors.hard_iron).max(), np.abs(errors.ellipsoid).max()))
