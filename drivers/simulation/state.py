"""Everything that the world remembers. The kernels see it as one record (see kernel)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from drivers.simulation import friction, noise, positioner, stage
from drivers.simulation.errors import BadSetting
from drivers.simulation.kernel import Floats, Ints, record

JSON = dict[str, "JSON"] | list["JSON"] | str | float | int | bool | None


def zeros(*shape: int, dtype: type = float) -> Callable[[], Any]:
    """What makes an array of zeros."""
    return lambda: np.zeros(shape, dtype)


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

    seats_nm: Floats = field(default_factory=zeros(2, friction.ELEMENTS))  # of the slip elements
    volts: Floats = field(default_factory=zeros(2))  # in front of the filter, without noise
    powered: int = 1
    powered_ns: int = 0  # since when
    charged: float = 0.0  # share of the charge that has crept into the plates' oxide

    wander_k: float = 0.0  # of the room
    chamber_c: float = 0.0
    body_c: float = 0.0
    board_k: float = 0.0  # self-heating
    package_k: float = 0.0  # self-heating
    glue_c: float = 0.0  # the temperature that the package stress follows
    thermocouple_c: float = 0.0
    oven_set_c: float = 0.0
    oven_running: int = 0
    oven_integral: float = 0.0
    supply_v: float = 0.0
    supply_wander_v: float = 0.0

    flicker_v: Floats = field(default_factory=zeros(2, noise.DECADES))
    walk_v: Floats = field(default_factory=zeros(2))
    slow_v: Floats = field(default_factory=zeros(2))  # sum of both
    filtered_v: Floats = field(default_factory=zeros(2))  # on the filter's capacitors, without white noise
    filtered_ns: Ints = field(default_factory=zeros(2, dtype=int))
    white: Floats = field(default_factory=zeros(2))  # behind the filter, in units of its rms
    white_ns: Ints = field(default_factory=zeros(2, dtype=int))
    kept_ns: int = 0  # the filter's last step, and its answers
    kept: float = 1.0  # share of the old
    fresh: float = 0.0  # share of new white noise, in rms

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
    """The record as plain numbers and lists."""
    return {f.name: np.asarray(getattr(world, f.name)).tolist() for f in fields(State)}


def from_json(values: dict[str, Any]) -> State:
    """The record that `to_json` described.

    Raises:
        BadSetting: names are missing or unknown, as in a state kept by another version.
    """
    names = {f.name for f in fields(State)}
    if values.keys() != names:
        odd = ", ".join(sorted(values.keys() ^ names))
        raise BadSetting(f"The kept world does not fit this version ({odd})", "Start the run anew")
    world = record(State())
    for name, value in values.items():
        setattr(world, name, value)
    return world
