"""hand-positions on a simulated hand, without sockets."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calibrations.analyses.hand_positions import FEWEST
from drivers.handheld.hand import Hand
from drivers.handheld.world import Handheld, HandheldWorld
from drivers.world.config import WorldConfig
from procedures.errors import Declined, NoAnswer
from procedures.hand_positions import hand_positions
from procedures.session import Dwell, Guidance
from rig.instruments.by_hand import HandAnalysis
from tests.handling import CALM
from tests.procedures.bench import Book, session


def taken(hand: Hand = CALM, seed: int = 1, dwells: tuple[Dwell, ...] = (), **settings: Any) -> Book:
    world = HandheldWorld(WorldConfig.ideal(), seed, Handheld(hand=hand))
    rig, book = session(world, dwells=dwells)
    hand_positions(replace(rig, by_hand=HandAnalysis()), **settings)
    return book


@pytest.fixture(scope="module")
def calm() -> Book:
    return taken()


def ups(book: Book) -> np.ndarray:
    """Directions upward of the positions, by the true zero and gains."""
    masses = (book.world.triad.x, book.world.triad.y, book.world.triad.z)  # type: ignore[attr-defined]
    zero, gain = (np.array([getattr(m, name) for m in masses]) for name in ("zero_v", "volts_per_g"))
    return np.array([(np.array([d.means[f"a{axis}"] for axis in "xyz"]) - zero) / gain for d in book.dwells])


def test_a_calm_hand_needs_no_more_positions_than_the_parameters_do(calm: Book) -> None:
    assert len(calm.dwells) == FEWEST
    assert calm.asked == ["at-rest"]
    assert calm.world.now_s < 120


def test_each_position_is_the_requested_one(calm: Book) -> None:
    turns = [guidance for guidance in calm.guided if guidance.moves]
    cosines = np.sum(ups(calm) * np.array([guidance.up for guidance in turns]), axis=1)
    assert np.degrees(np.arccos(np.minimum(cosines, 1.0))).max() < 35  # an edge is missed by 8 deg about each axis
    assert all(f": {d.pose.path}" in g.text for d, g in zip(calm.dwells, turns, strict=True))


def test_each_position_is_two_seconds_at_rest(calm: Book) -> None:
    assert {dwell.n for dwell in calm.dwells} == {2000}
    noise_v = 1.2e-3
    assert max(max(dwell.stds.values()) for dwell in calm.dwells) < 1.1 * noise_v
    assert calm.dwells[0].temperature_c is not None


def test_the_guidance_has_the_directions_so_far(calm: Book) -> None:
    last = calm.guided[-1]
    assert isinstance(last, Guidance)
    assert not last.moves
    assert "0.001" not in last.text
    assert "target 1 mg" in last.text
    assert re.search(
        r"; the (scale factor of [xyz]|bias of [xyz]|nonorthogonality of . and .): standard uncertainty ", last.text
    )
    assert np.array(last.taken) == pytest.approx(ups(calm), abs=0.02)


def test_a_smaller_target_takes_more_positions(calm: Book) -> None:
    finer = taken(target_g=9e-5)
    assert len(calm.dwells) < len(finer.dwells) <= 40
    assert len(taken(target_g=1e-9, most_positions=14).dwells) == 14


def test_a_resumed_run_goes_on_after_its_last_position(calm: Book) -> None:
    again = taken(dwells=tuple(calm.dwells[:9]))
    assert len(again.dwells) == FEWEST
    assert len(again.blocks) == FEWEST - 9


def test_a_hand_that_trembles_slips_and_errs_still_ends() -> None:
    hand = Hand(slips=0.4, errs=0.2, clings=0.3, patience_s=4.0, table_deg=5.0)
    book = taken(hand, seed=4)
    assert FEWEST <= len(book.dwells) <= 20
    assert max(max(dwell.stds.values()) for dwell in book.dwells) < 1.15 * 1.2e-3


def test_a_position_is_not_recorded_twice() -> None:
    """The hand always puts the sensor back as it was."""
    world = HandheldWorld(WorldConfig.ideal(), 1, Handheld(hand=CALM))
    rig, book = session(world)
    book.guide = book.guided.append
    with pytest.raises(NoAnswer, match="this position is measured already"):
        hand_positions(replace(rig, by_hand=HandAnalysis()), wait_s=15.0)
    assert len(book.dwells) == 1


def test_a_side_recorded_under_another_name_is_not_requested_for_ever() -> None:
    """At first the zero is not known, so a wrong side counts as the one that was told. Later that side is wanted."""
    world = HandheldWorld(WorldConfig.ideal(), 1, Handheld(hand=CALM))
    rig, book = session(world)
    follow = book.guide

    def wrong_at_first(guidance: Guidance) -> None:
        wrong = guidance.moves and not guidance.taken
        follow(replace(guidance, up=(0.0, 0.0, 1.0)) if wrong else guidance)

    book.guide = wrong_at_first
    hand_positions(replace(rig, by_hand=HandAnalysis()))
    assert FEWEST <= len(book.dwells) <= FEWEST + 2
    wanted = [guidance.up for guidance in book.guided if guidance.moves]
    assert wanted.count((0.0, 0.0, 1.0)) <= 2
    assert np.linalg.svd(ups(book))[1].min() > 1.0


def test_the_first_rest_must_be_quiet() -> None:
    world = HandheldWorld(WorldConfig.ideal(), 1, Handheld(hand=replace(CALM, patience_s=0.3)))
    world.turn_by_hand((0.0, 0.0, 1.0))
    rig, _ = session(world)
    with pytest.raises(NoAnswer, match="not at rest for 10 s within 20 s"):
        hand_positions(replace(rig, by_hand=HandAnalysis()), wait_s=20.0)


def test_a_sensor_that_is_not_on_the_table_is_not_measured() -> None:
    world = HandheldWorld(WorldConfig.ideal(), 1, Handheld(hand=CALM))
    rig, book = session(world)
    book.ask = lambda question: "no"
    with pytest.raises(Declined):
        hand_positions(replace(rig, by_hand=HandAnalysis()))
    assert not book.dwells
