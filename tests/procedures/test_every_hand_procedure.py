"""What hand-positions, hand-fields and hand-turns have in common, on a simulated hand, without sockets."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import pytest

from drivers.handheld.world import HandheldWorld
from procedures.errors import NoAnswer, SettingError
from procedures.hand_fields import hand_fields
from procedures.hand_positions import hand_positions
from procedures.hand_turns import hand_turns
from tests.handling import CALM, field_world, hand_session, turn_world, world_of


@dataclass(frozen=True)
class Procedure:
    """A procedure, the world of its sensor, and the setting of its target."""

    run: Callable[..., None]
    world: Callable[..., HandheldWorld]
    target: str


PROCEDURES = {
    "hand-positions": Procedure(hand_positions, world_of, "target_g"),
    "hand-fields": Procedure(hand_fields, field_world, "target_percent"),
    "hand-turns": Procedure(hand_turns, turn_world, "target_percent"),
}


@pytest.mark.parametrize("name", PROCEDURES)
def test_a_hand_that_never_rests_ends_with_a_message(name: str) -> None:
    procedure = PROCEDURES[name]
    rig, _ = hand_session(procedure.world(1, replace(CALM, clings=1.0, clings_s=1e4)))
    with pytest.raises(NoAnswer, match=r"no new position for 20 s; next: .* times the noise at rest"):
        procedure.run(rig, wait_s=20.0)


@pytest.mark.parametrize(("setting", "value"), [("target", 0.0), ("rest_s", 0.5), ("most_positions", 9), ("wait_s", 0)])
@pytest.mark.parametrize("name", PROCEDURES)
def test_settings_out_of_range_are_refused(name: str, setting: str, value: float) -> None:
    procedure = PROCEDURES[name]
    rig, _ = hand_session(procedure.world(1, CALM))
    with pytest.raises(SettingError, match=f"{name}: {procedure.target}"):
        procedure.run(rig, **{procedure.target if setting == "target" else setting: value})
