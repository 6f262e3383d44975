"""The state of the world. For the kernels it is one record (see kernel)."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

import numpy as np

from drivers.world import accelerometer, positioner, stage
from drivers.world.errors import BadSetting
from drivers.world.heat import Warmth
from drivers.world.kernel import Floats, Ints, record, zeros
from drivers.world.noise import Fluctuation
from drivers.world.pickup import Pickup

JSON = dict[str, "JSON"] | list["JSON"] | str | float | int | bool | None


@dataclass
class State:
    """Times in ns of world time; axis 0 of an array is (alpha, beta) or (x, y)."""

    now_ns: int = 0
    ticks: int = 0  # of the slow processes, so far
    mechanics_ns: int = 0  # when the mechanics were last brought up to date

    pieces: Floats = field(default_factory=zeros(2, stage.PIECES, 4))  # the motors' moves, see stage
    rest_ns: Ints = field(default_factory=zeros(2, dtype=int))  # when each motor's move ends
    table_deg: Floats = field(default_factory=zeros(2))  # behind the gear play
    up: Floats = field(default_factory=zeros(3))  # the vertical in the base
    mount: Floats = field(default_factory=zeros(3, 3))  # package from table
    board: Floats = field(default_factory=zeros(3, 3))  # board from table, which magnetometer and gyroscope lie on
    grip_nm: Floats = field(default_factory=zeros(2))  # displacement by the clamp that holds the package
    carriage: Floats = field(default_factory=zeros(3, positioner.PIECES, positioner.TERMS))  # its motion in x, y, z
    carriage_rest_ns: Ints = field(default_factory=zeros(3, dtype=int))  # when it has settled

    seats_nm: Floats = field(default_factory=zeros(2, accelerometer.ELEMENTS))  # of the slip elements
    volts: Floats = field(default_factory=zeros(2))  # in front of the filter, without noise
    powered: int = 1
    powered_ns: int = 0  # since when
    charged: float = 0.0  # share of the charge that has crept into the plates' oxide

    warmth: Warmth = field(default_factory=Warmth)
    supply_v: float = 0.0
    supply_wander_v: float = 0.0

    x: Fluctuation = field(default_factory=Fluctuation)  # noise of each output
    y: Fluctuation = field(default_factory=Fluctuation)
    pickup_x: Pickup = field(default_factory=Pickup)
    pickup_y: Pickup = field(default_factory=Pickup)

    earth_deg_s: Floats = field(default_factory=zeros(3))  # its rotation in the base
    field_ut: Floats = field(default_factory=zeros(3))  # magnetic, in the base
    plates: Floats = field(default_factory=zeros(3, 3))  # of the magnetometer, their normals on the board
    die: Floats = field(default_factory=zeros(3, 3))  # of the gyroscope, from the board
    turned_rad: Floats = field(default_factory=zeros(2))  # where the tables stood at the last step
    turned_ns: int = 0
    field_v: Floats = field(default_factory=zeros(3))  # of the magnetometer, without noise
    rate_v: Floats = field(default_factory=zeros(3))  # of the gyroscope, without noise

    seat: float = 0.5  # of a mount that rocks
    lid_in: float = 0.0  # 1 while a lid is popped in


def to_json(world: State) -> dict[str, JSON]:
    """The record as plain numbers and lists, one mapping for each part."""
    return _as_json(world, State())


def from_json(values: dict[str, Any]) -> State:
    """The record that `to_json` described.

    Raises:
        BadSetting: names are missing or unknown, as in a state kept by another version.
    """
    world = record(State())
    _fill(world, values, State())
    return world


def _as_json(part: Any, template: Any) -> dict[str, Any]:
    """`part` is a record with the names of the dataclass `template`."""
    pairs = [(f.name, getattr(part, f.name), getattr(template, f.name)) for f in fields(template)]
    return {
        name: _as_json(value, default) if is_dataclass(default) else np.asarray(value).tolist()
        for name, value, default in pairs
    }


def _fill(part: Any, values: Any, template: Any) -> None:
    names = {f.name for f in fields(template)}
    if not isinstance(values, dict) or values.keys() != names:
        odd = ", ".join(sorted(set(values) ^ names)) if isinstance(values, dict) else repr(values)
        raise BadSetting(f"The kept world does not fit this version ({odd})", "Start the run anew")
    for name, value in values.items():
        if is_dataclass(getattr(template, name)):
            _fill(getattr(part, name), value, getattr(template, name))
        else:
            setattr(part, name, value)
