"""Everything that the world remembers, as one record: a number or a small array per name."""

from __future__ import annotations

from typing import Any

import numpy as np

from drivers.simulation import friction, noise, stage
from drivers.simulation.errors import BadSetting

JSON = dict[str, "JSON"] | list["JSON"] | str | float | int | bool | None

LAYOUT = np.dtype(
    [
        ("now_ns", "i8"),
        ("ticks", "i8"),  # ticks of slow processes so far
        ("mechanics_ns", "i8"),  # when the mechanics were last brought up to date
        # stages, mount
        ("pieces", "f8", (2, stage.PIECES, 4)),
        ("rest_ns", "i8", (2,)),  # when each stage's move ends
        ("table_deg", "f8", (2,)),  # behind the gear play
        ("up", "f8", (3,)),
        ("mount", "f8", (3, 3)),
        ("mount_deg", "f8"),
        ("flip", "i8"),
        # sensor
        ("seats_nm", "f8", (2, friction.ELEMENTS)),
        ("volts", "f8", (2,)),  # in front of the filter, without noise
        ("powered", "i8"),
        ("powered_ns", "i8"),  # since when
        # heat, supply
        ("wander_k", "f8"),
        ("chamber_c", "f8"),
        ("body_c", "f8"),
        ("board_k", "f8"),
        ("package_k", "f8"),
        ("glue_c", "f8"),
        ("thermocouple_c", "f8"),
        ("oven_set_c", "f8"),
        ("oven_running", "i8"),
        ("oven_integral", "f8"),
        ("supply_v", "f8"),
        ("supply_wander_v", "f8"),
        # noise, filter
        ("flicker_v", "f8", (2, noise.DECADES)),
        ("walk_v", "f8", (2,)),
        ("slow_v", "f8", (2,)),
        ("filtered_v", "f8", (2,)),
        ("filtered_ns", "i8", (2,)),
        ("white", "f8", (2,)),  # in units of its rms
        ("white_ns", "i8", (2,)),
        ("kept_ns", "i8"),
        ("kept", "f8"),
        # oddities
        ("seat", "f8"),
        ("lid_in", "f8"),
    ]
)


def blank() -> Any:
    """A record of zeros."""
    return np.zeros(1, LAYOUT)[0]


def to_json(world: Any) -> dict[str, JSON]:
    """The record as plain numbers and lists."""
    return {name: world[name].tolist() for name in LAYOUT.names or ()}


def from_json(values: dict[str, Any]) -> Any:
    """The record that `to_json` described.

    Raises:
        BadSetting: names are missing or unknown, as in a state kept by another version.
    """
    if values.keys() != set(LAYOUT.names or ()):
        odd = ", ".join(sorted(values.keys() ^ set(LAYOUT.names or ())))
        raise BadSetting(f"world state does not fit this version ({odd}); start the run anew")
    world = blank()
    for name, value in values.items():
        world[name] = value
    return world
