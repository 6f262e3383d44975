"""Several sensors on one table: a world for each, with equal common parts.

Stages, room, oven, supply, carriage and level are the same in every world, since they have the same commands and the
same random numbers. Only the properties of the sensors differ. Inputs are named by sensor and output: `a1.vx`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from drivers.errors import did_you_mean
from drivers.world.config import WorldConfig
from drivers.world.errors import BadSetting, UnknownInput
from drivers.world.kernel import Floats
from drivers.world.positioner import Command
from drivers.world.stage import Trajectory
from drivers.world.world import World

SENSOR_PARTS = ("sensor", "noise", "magnetometer", "gyroscope")  # what may differ from sensor to sensor


class Batch:
    """Sensors by name on one table, each with its own changes to `config`. Has the interface of a `World`.

    Raises what `with_own` raises.
    """

    def __init__(self, config: WorldConfig, seed: int, sensors: Mapping[str, Mapping[str, Any]]) -> None:
        self._worlds = {
            name: World(with_own(config, name, changes), seed, place)
            for place, (name, changes) in enumerate(sensors.items())
        }
        self._first = next(iter(self._worlds.values()))

    @property
    def now_s(self) -> float:
        return self._first.now_s

    def advance(self, t_s: float) -> None:
        """Let time pass until `t_s`."""
        for world in self._worlds.values():
            world.advance(t_s)

    def move_stage(self, axis: str, trajectory: Trajectory) -> None:
        """Let the motor of `axis` follow `trajectory`."""
        for world in self._worlds.values():
            world.move_stage(axis, trajectory)

    def motor_angle_deg(self, axis: str) -> float:
        """The present angle of the motor of `axis`."""
        return self._first.motor_angle_deg(axis)

    def move_positioner(self, axis: str, command: Command) -> float:
        """Let the carriage, which carries all sensors, follow `command`; returns when it will be at rest."""
        return max(world.move_positioner(axis, command) for world in self._worlds.values())

    def positioner_um(self, axis: str, times_s: ArrayLike | None = None) -> Floats:
        """The reading of the position sensor of `axis`."""
        return self._first.positioner_um(axis, times_s)

    def mount_sensor(self, mount_deg: float = 0.0, flip: int = 0, up: str = "z") -> None:
        """Put the plate with all sensors on the table."""
        for world in self._worlds.values():
            world.mount_sensor(mount_deg, flip, up)

    def power(self, on: bool) -> None:
        """Switch the supply of all sensors."""
        for world in self._worlds.values():
            world.power(on)

    def powered_s(self) -> float:
        """Seconds since the sensors were powered."""
        return self._first.powered_s()

    def oven_set(self, set_point_c: float, running: bool) -> None:
        """Give the oven a set point, and run it or not."""
        for world in self._worlds.values():
            world.oven_set(set_point_c, running)

    def thermometer_c(self) -> float:
        """The reading of the thermocouple, which is on the first sensor."""
        return self._first.thermometer_c()

    def level_deg(self) -> tuple[float, float]:
        """The reading of a level on the turntable."""
        return self._first.level_deg()

    def adc_volts(self, inputs: Sequence[str], start_s: float, interval_s: float, n: int) -> Floats:
        """Volts at the converter's inputs, shape (n, len(inputs)), as `World.adc_volts`; all in turn in one scan.

        Raises UnknownInput for a sensor that is not there, and what the world raises.
        """
        places: dict[str, list[int]] = defaultdict(list)
        for place, name in enumerate(inputs):
            places[self._sensor(name)].append(place)
        volts = np.empty((n, len(inputs)))
        for sensor, world in self._worlds.items():
            own_places = places[sensor]
            outputs = [inputs[place].rpartition(".")[2] for place in own_places]
            volts[:, own_places] = world.adc_volts(outputs, start_s, interval_s, n, own_places)
        return volts

    def state(self) -> dict[str, Any]:
        """The state of the worlds, as JSON."""
        return {name: world.state() for name, world in self._worlds.items()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from a result of `state`."""
        for name, world in self._worlds.items():
            world.restore(state[name])

    def _sensor(self, wired: str) -> str:
        """The sensor whose output is connected to an input; the first sensor for inputs that belong to no sensor."""
        sensor, dot, _ = wired.partition(".")
        if dot and sensor not in self._worlds:
            raise UnknownInput(
                f"The table has no sensor {sensor!r} for the input {wired!r}", did_you_mean(sensor, self._worlds)
            )
        return sensor if dot else next(iter(self._worlds))


AnyWorld = World | Batch  # what simulated instruments act on: one sensor, or several on one table


def with_own(config: WorldConfig, name: str, changes: Mapping[str, Any]) -> WorldConfig:
    """The settings of one sensor's world. Raises BadSetting for a change of something that all sensors share."""
    if shared := [key for key in changes if key not in SENSOR_PARTS]:
        raise BadSetting(
            f"{', '.join(shared)} of sensor {name}'s world is shared by all", f"Change {' and '.join(SENSOR_PARTS)}"
        )
    return config.changed(changes)
