"""The world that the simulated instruments share: all of their physics.

It is deterministic by its seed; `state` and `restore` continue it sample by sample. Times are whole nanoseconds, so a
long acquisition gives the same samples for any division into blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers.errors import did_you_mean
from drivers.world import digital, gravity, heat, mechanics, positioner, sampling, stage, state, visit
from drivers.world.config import WorldConfig
from drivers.world.errors import TimeReversal, UnknownInput
from drivers.world.initial_state import individual, state_at_start
from drivers.world.kernel import Floats, record
from drivers.world.stage import Trajectory


class World:
    """A rig in simulated time, from `now_s` = 0 with both stages at motor angle 0.

    Worlds of one seed and different `place` are sensors on one table: the same rig, room and supply.
    """

    trims = digital.TRIMS  # of a digital sensor's outputs

    def __init__(self, config: WorldConfig, seed: int, place: int = 0) -> None:
        self.config = individual(config, seed, place)
        self._numbers = record(self.config)
        self._seed, self._number = seed, place
        place_key = [place] if place else []
        self._slow, self._fast, self._room = (
            np.random.Generator(np.random.PCG64(key))
            for key in ([seed, 1, *place_key], [seed, 2, *place_key], [seed, 3])
        )
        self._world = state_at_start(self.config, self._numbers, self._room, self._slow)

    @property
    def now_s(self) -> float:
        return float(1e-9 * self._world.now_ns)

    def advance(self, t_s: float) -> None:
        """Let time pass until `t_s`. Raises TimeReversal."""
        mechanics.run_to(self._world, self._numbers, self._later_ns(t_s), mechanics.STEP_NS, self._room, self._slow)

    def move_stage(self, axis: str, trajectory: Trajectory) -> None:
        """Let the motor of `axis` ("alpha" or "beta") follow `trajectory` from now on."""
        number = _place(axis, stage.AXES, "stage")
        self._world.pieces[number] = stage.motion(trajectory)
        self._world.rest_ns[number] = round(1e9 * trajectory.end_s)

    def motor_angle_deg(self, axis: str) -> float:
        """The present angle of the motor of `axis`."""
        return float(stage.motor_angle_deg(self._world.pieces[_place(axis, stage.AXES, "stage")], self.now_s))

    def move_positioner(self, axis: str, command: positioner.Command) -> float:
        """Let the carriage follow `command` along the table's `axis` ("x", "y", "z") from now on.

        Its acceleration adds to the specific force of the sensor, which is mounted on it. Gives the time in s
        at which it will be at rest.
        """
        number, numbers = _place(axis, positioner.AXES, "axis of the positioner"), self._numbers
        mechanics.interrupt(self._world, numbers)
        pieces, rest_s = positioner.follow_command(numbers.positioner, self._world.carriage[number], command)
        self._world.carriage[number] = pieces
        self._world.carriage_rest_ns[number] = round(1e9 * rest_s)
        mechanics.update(self._world, numbers, int(self._world.now_ns))
        return rest_s

    def positioner_um(self, axis: str, times_s: ArrayLike | None = None) -> Floats:
        """Reading of the position sensor of `axis`, now or at `times_s` within its present motion; no time passes."""
        number = _place(axis, positioner.AXES, "axis of the positioner")
        times = self.now_s if times_s is None else times_s
        salt = self._seed * len(positioner.AXES) + number
        return positioner.read_um(self._numbers.positioner, self._world.carriage[number], times, salt)

    def mount_sensor(self, mount_deg: float = 0.0, flip: int = 0, up: str = "z") -> None:
        """Put the sensor on the table turned by `mount_deg` about its normal, face down if `flip`; see seating.

        `up` is the edge of the board along the normal, see `gravity.mounting`.

        Like `power`, it shows in the outputs from the next tick on, within 0.1 s.
        """
        tilt, grip_nm = gravity.seat_mounting(self.config.seating, self._seed, self._number, int(self._world.now_ns))
        self._world.mount = gravity.mounting(self.config.sensor.package, mount_deg, flip, up) @ tilt
        self._world.board = gravity.mounting(gravity.Package(), mount_deg, flip, up) @ tilt
        self._world.grip_nm = grip_nm

    def power(self, on: bool) -> None:
        """Switch the sensor's supply. Without it the outputs fall to 0 V and the sensor cools."""
        if on and not self._world.powered:
            self._world.powered_ns = self._world.now_ns
        self._world.powered = int(on)

    def powered_s(self) -> float:
        """Seconds since the sensor was powered; 0 while it is not."""
        return float(1e-9 * (self._world.now_ns - self._world.powered_ns) * self._world.powered)

    def oven_set(self, set_point_c: float, running: bool) -> None:
        """Give the oven's controller a set point, and run it or not."""
        self._world.warmth.oven_set_c = set_point_c
        self._world.warmth.oven_running = int(running)

    def thermometer_c(self) -> float:
        """The present reading of the thermocouple on the sensor's package."""
        return float(self._world.warmth.thermocouple_c)

    def die_c(self) -> float:
        """The present reading of a thermometer on the sensor's chip."""
        return float(heat.die_c(self._world.warmth))

    def level_deg(self) -> tuple[float, float]:
        """The present reading of a level on the turntable: elevation of the positive ends of its x and y axis, deg."""
        angles_rad = mechanics.true_angles_rad(self._world, self._numbers.stages)
        inclined_deg = gravity.inclination_deg(self._world.up, *angles_rad)
        return gravity.shown_deg(self.config.level, inclined_deg, self._seed, int(self._world.now_ns))

    def adc_volts(
        self, inputs: Sequence[str], start_s: float, interval_s: float, n: int, places: Sequence[int] | None = None
    ) -> Floats:
        """Volts at the converter's inputs, shape (n, len(inputs)), before rounding to codes.

        Scan i begins at `start_s + i * interval_s`; an input follows as many times the converter's skew later as its
        place in the scan says, which are 0, 1, .. unless given. The world is at the last scan afterwards. Inputs:
        vx, vy, vz, supply, thermistor, ground, d63, mx, my, mz of the magnetometer, gx, gy, gz of the gyroscope.

        Raises:
            UnknownInput: an input of another name.
            TimeReversal: `start_s` has passed.
        """
        channels = np.array([_place(name, sampling.INPUTS, "converter input") for name in inputs], dtype=np.int64)
        start_ns = self._later_ns(start_s)
        times_ns = start_ns + np.rint(1e9 * interval_s * np.arange(n)).astype(np.int64)
        order = np.arange(len(channels)) if places is None else np.array(places, dtype=np.int64)
        late_ns = order * round(1e9 * self.config.converter.skew_s)
        volts, chance = np.empty((n, len(channels))), (self._room, self._slow, self._fast)
        sampling.sample(self._world, self._numbers, channels, late_ns, times_ns, *chance, volts)
        return volts

    def sensed(self, outputs: Sequence[str], start_s: float, interval_s: float, n: int) -> Floats:
        """Outputs of a digital sensor in g, deg/s, uT and V, shape (n, len(outputs)), all sampled at once.

        Outputs: those of `trims`. Raises as `adc_volts`.
        """
        trims = digital.trims(outputs, self.trims)
        volts = self.adc_volts([trim.analog for trim in trims], start_s, interval_s, n, [0] * len(trims))
        return digital.trim_outputs(volts, trims)

    def dwell_mean(
        self,
        alpha_deg: ArrayLike,
        beta_deg: ArrayLike,
        *,
        direction: ArrayLike | None = None,
        mount_deg: ArrayLike = 0.0,
        flip: ArrayLike = 0,
        noise_free: bool = False,
        **timing: float,
    ) -> dict[str, NDArray[Any]]:
        """Visit poses in order (arrays or scalars) and hold each: the columns of a table of poses.

        `timing` are the fields of `visit.Timing`: dwell_s, interval_s, settle_s, speed_deg_s, acceleration_deg_s2.
        t_s is the middle of the dwell, in seconds since the sensor was powered. `noise_free` leaves out the
        noise of sensor and converter, not the wander of room and supply. The world is at the end of the
        last dwell afterwards.
        """
        poses, pace = visit.poses(alpha_deg, beta_deg, direction, mount_deg, flip), visit.Timing(**timing)
        motors = self.motor_angle_deg("alpha"), self.motor_angle_deg("beta")
        plan = visit.plan(poses, pace, self.config.sensor.package, self.now_s, motors)
        motions = plan.motions, plan.rest_ns, plan.dwell_ns, plan.mounts
        means = visit.visit(self._world, self._numbers, *motions, self._room, self._slow)
        middle_s = 1e-9 * plan.dwell_ns.mean(axis=1)
        random = None if noise_free else self._fast
        measured = visit.columns(means, middle_s, self.config, pace, random)
        return vars(poses) | measured | {"t_s": middle_s - 1e-9 * self._world.powered_ns}

    def state(self) -> dict[str, state.JSON]:
        """The state of the world, as JSON: restored, it continues sample for sample."""
        generators: Any = [g.bit_generator.state for g in (self._slow, self._fast, self._room)]
        return {"world": state.to_json(self._world), "generators": generators}

    def restore(self, saved: dict[str, Any]) -> None:
        """Continue from what `state` gave, in a world of the same configuration and seed.

        Raises:
            BadSetting: the state is of another version.
        """
        self._world = state.from_json(saved["world"])
        for generator, generator_state in zip((self._slow, self._fast, self._room), saved["generators"], strict=True):
            generator.bit_generator.state = generator_state

    def _later_ns(self, t_s: float) -> int:
        """`t_s` in ns; a nanosecond of rounding is forgiven."""
        t_ns, now_ns = round(1e9 * t_s), int(self._world.now_ns)
        if t_ns < now_ns - 1:
            raise TimeReversal(f"The world is at {self.now_s:.9f} s, past {t_s:.9f} s", "Ask for a later time")
        return max(t_ns, now_ns)


def _place(name: str, names: tuple[str, ...], kind: str) -> int:
    if name not in names:
        raise UnknownInput(f"The simulated world has no {kind} {name!r}", did_you_mean(name, names))
    return names.index(name)
