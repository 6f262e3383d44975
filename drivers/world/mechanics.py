"""The mechanisms together: the changes at an event, and the next event.

Slow processes (heat, supply, flicker) advance in ticks of 0.1 s on an absolute grid of time. The mechanics are updated
at every tick and, while a stage turns or the carriage moves, at finer steps. Between events only the filter changes,
exactly. So no result depends on the division of time into calls.

A moving carriage shakes the sensor at frequencies that pass the filter. Each step has the acceleration of its middle:
the steps of a sinusoid then keep the phase, and the amplitude but for (w step)^2 / 24, 1e-5 at 10 Hz.
"""

from __future__ import annotations

import math

from numpy.random import Generator

from drivers.world import accelerometer, disturbances, gravity, heat, noise, positioner, stage, turned_sensors
from drivers.world.config import SensingAxis, Stages, WorldConfig
from drivers.world.kernel import Floats, follow_lag, kernel
from drivers.world.pickup import acceleration_g, low_pass, shakes
from drivers.world.state import State

TICK_NS = 100_000_000
TICK_S = 1e-9 * TICK_NS
STEP_NS = 2_000_000  # of the mechanics while a stage turns
SHAKE_NS = 250_000  # of the mechanics while the carriage moves
UM_PER_G = 1e6 * accelerometer.STANDARD_GRAVITY_M_S2  # um/s^2 in 1 g
REFERENCE_C = 25.0  # at which the factory trimmed the sensor


@kernel
def run_to(world: State, config: WorldConfig, t_ns: int, step_ns: int, room: Generator, slow: Generator) -> None:
    """Advance to `t_ns`. Random numbers of ticks are from `room` for common parts, else from `slow`."""
    event_ns = next_event_ns(world, step_ns)
    while event_ns <= t_ns:
        charge(world, config, event_ns)
        if event_ns == (world.ticks + 1) * TICK_NS:
            world.ticks += 1
            tick(world, config, room, slow)
        update(world, config, event_ns)
        event_ns = next_event_ns(world, step_ns)
    world.now_ns = max(t_ns, world.now_ns)


@kernel
def next_event_ns(world: State, step_ns: int) -> int:
    """The next tick, or the next step of a stage or carriage that moves, or the moment at which it comes to rest."""
    event = (world.ticks + 1) * TICK_NS
    for axis in range(2):
        rest_ns = world.rest_ns[axis]
        if world.mechanics_ns < rest_ns:
            event = min(event, rest_ns, (world.mechanics_ns // step_ns + 1) * step_ns)
    for axis in range(3):
        rest_ns = world.carriage_rest_ns[axis]
        if world.mechanics_ns < rest_ns:
            event = min(event, rest_ns, (world.mechanics_ns // SHAKE_NS + 1) * SHAKE_NS)
    return event


@kernel
def interrupt(world: State, config: WorldConfig) -> None:
    """Advance the filters to the present time, before the carriage gets another motion."""
    charge(world, config, world.now_ns)


@kernel
def charge(world: State, config: WorldConfig, t_ns: int) -> None:
    """Advance the filters of both outputs to `t_ns` with their present inputs."""
    noise.charge(world.x, config.noise.x, world.volts[0], t_ns)
    noise.charge(world.y, config.noise.y, world.volts[1], t_ns)


@kernel
def tick(world: State, config: WorldConfig, room: Generator, slow: Generator) -> None:
    """Advance the slow processes to the present tick."""
    t_s = world.ticks * TICK_S
    heat.tick(world.warmth, config.heat, config.oven, world.powered, t_s, TICK_S, room.standard_normal())
    disturbances.supply_tick(world, config.supply, t_s, TICK_S, room.standard_normal())
    world.charged = follow_lag(world.charged, world.powered, TICK_S, config.sensor.charging_s)
    disturbances.oddities_tick(world, config.oddities, TICK_S, slow.standard_normal())
    noise.tick(world.x, world.y, config.noise, t_s, TICK_S, slow)


@kernel
def update(world: State, config: WorldConfig, t_ns: int) -> None:
    """Update the world at `t_ns`, from the motors' angles to the voltages at the filter's input."""
    world.mechanics_ns = t_ns
    gx, gy, gz = load_g(world, config, t_ns)
    disturbances.rock(world, config.oddities, gx, gy)
    x, y, sag = displaced_nm(world, config, gx, gy, gz, 1e-9 * t_ns)
    on, sx, sy = world.powered, config.sensor.x, config.sensor.y
    world.volts[0] = on * accelerometer.read_v(sx.plates, sx.springs.resonance_hz, x, y, sag, world.supply_v)
    world.volts[1] = on * accelerometer.read_v(sy.plates, sy.springs.resonance_hz, y, x, sag, world.supply_v)
    update_turned(world, config, t_ns, heat.die_c(world.warmth) - REFERENCE_C)
    if shakes(config.floor):
        shake(world, config)


@kernel
def load_g(world: State, config: WorldConfig, t_ns: int) -> tuple[float, float, float]:
    """Specific force along both sensing beams and out of their plane."""
    t_s = 1e-9 * t_ns
    a_motor = stage.motor_angle_deg(world.pieces[0], t_s)
    b_motor = stage.motor_angle_deg(world.pieces[1], t_s)
    world.table_deg[0] = stage.engaged_deg(config.stages.alpha, world.table_deg[0], a_motor)
    world.table_deg[1] = stage.engaged_deg(config.stages.beta, world.table_deg[1], b_motor)
    gx, gy, gz = force_g(world, config, t_ns)
    return gx, gravity.along_y(config.sensor.package, gx, gy), gz


@kernel
def force_g(world: State, config: WorldConfig, t_ns: int) -> tuple[float, float, float]:
    """Specific force in the frame of the package at the present angles of the tables."""
    alpha, beta = true_angles_rad(world, config.stages)
    gx, gy, gz = gravity.felt_g(world.up, world.mount, alpha, beta)
    for axis in range(3):
        if t_ns < world.carriage_rest_ns[axis]:
            shake_g = shaken_g(world, config.positioner, axis, t_ns)
            gx += world.mount[0, axis] * shake_g
            gy += world.mount[1, axis] * shake_g
            gz += world.mount[2, axis] * shake_g
    return gx, gy, gz


@kernel
def out_of_plane_v(world: State, config: WorldConfig) -> float:
    """Output of the third axis since the last event, without noise."""
    sensor = config.sensor
    _, _, gz = force_g(world, config, world.mechanics_ns)
    stress_k = world.warmth.glue_c - REFERENCE_C
    sag = gz * accelerometer.per_g_nm(sensor.sag_resonance_hz) + 1e-3 * sensor.z.stress_pm_per_k * stress_k
    volts = accelerometer.read_v(sensor.z.plates, sensor.sag_resonance_hz, sag, 0.0, 0.0, world.supply_v)
    return world.powered * volts


@kernel
def true_angles_rad(world: State, stages: Stages) -> tuple[float, float]:
    """True angles of alpha and beta."""
    alpha = stage.true_angle_rad(stages.alpha, world.table_deg[0])
    return alpha, stage.true_angle_rad(stages.beta, world.table_deg[1])


@kernel
def shake(world: State, config: WorldConfig) -> None:
    """Floor vibration at both outputs, at the present orientation of the sensor."""
    alpha, beta = true_angles_rad(world, config.stages)
    gx, gy, _ = gravity.felt_g(acceleration_g(config.floor), world.mount, alpha, beta)
    gain_x, _ = low_pass(config.floor, noise.filter_s(config.noise.x))
    gain_y, _ = low_pass(config.floor, noise.filter_s(config.noise.y))
    world.pickup_x.shaken_v = world.powered * gain_x * config.sensor.x.plates.sensitivity_v_per_g * gx
    world.pickup_y.shaken_v = world.powered * gain_y * config.sensor.y.plates.sensitivity_v_per_g * gy


@kernel
def shaken_g(world: State, loop: positioner.Positioner, axis: int, t_ns: int) -> float:
    """Acceleration of the carriage in the middle of the step that begins at `t_ns`."""
    middle_s = 0.5e-9 * (t_ns + (t_ns // SHAKE_NS + 1) * SHAKE_NS)
    return positioner.motion(loop, world.carriage[axis], middle_s)[2] / UM_PER_G


@kernel
def displaced_nm(
    world: State, config: WorldConfig, gx: float, gy: float, gz: float, t_s: float
) -> tuple[float, float, float]:
    """Displacements of the proof mass in x, y and z."""
    sx, sy, odd = config.sensor.x, config.sensor.y, config.oddities
    x, y = accelerometer.balanced_nm(sx.springs, sy.springs, gx, gy, heat.die_c(world.warmth) - REFERENCE_C)
    sag = gz * accelerometer.per_g_nm(config.sensor.sag_resonance_hz)
    fault = disturbances.displacement_nm(world, odd, world.table_deg[1], t_s)
    moved_x = fault + world.grip_nm[0] + moved_nm(world, sx, odd, world.seats_nm[0], x, y, gy, sag)
    moved_y = fault + world.grip_nm[1] + moved_nm(world, sy, odd, world.seats_nm[1], y, x, gx, sag)
    return moved_x, moved_y, sag


@kernel
def moved_nm(
    world: State,
    axis: SensingAxis,
    odd: disturbances.Oddities,
    seats_nm: Floats,
    own_nm: float,
    neighbour_nm: float,
    neighbour_g: float,
    sag_nm: float,
) -> float:
    """Displacement of a finger; `own_nm` and `neighbour_nm` are those where the springs alone balance the loads."""
    stuck = accelerometer.drag_nm(axis.friction, seats_nm, own_nm, neighbour_g)
    attraction_nm = accelerometer.shift_nm(axis.springs, neighbour_nm, sag_nm, world.warmth.glue_c - REFERENCE_C)
    charged = 1e-3 * axis.plates.charging_pm * world.charged
    return own_nm - stuck + attraction_nm + charged + disturbances.stopped_nm(odd, own_nm)


# A magnetometer and a gyroscope on one board, which turn with the table.
#
# Angular rate of the board in its own frame: the table's, that of its inclination, and the earth's. Vectors of the base
# go Ry(alpha), then Rz(beta); so a table whose angle grows turns the other way about its own normal.


@kernel
def update_turned(world: State, config: WorldConfig, t_ns: int, warmer_k: float) -> None:
    """Volts of both sensors at the angles of the tables at `t_ns`, without noise."""
    alpha, beta = true_angles_rad(world, config.stages)
    fx, fy, fz = gravity.felt_g(world.field_ut, world.board, alpha, beta)
    turned_sensors.magnetometer_v(config.magnetometer, world.plates, fx, fy, fz, warmer_k, world.field_v)
    lx, ly, lz = gravity.felt_g(world.up, world.board, alpha, beta)
    rx, ry, rz = rate_deg_s(world, alpha, beta, t_ns)
    rate, load = gravity.across(world.die, rx, ry, rz), gravity.across(world.die, lx, ly, lz)
    turned_sensors.gyroscope_v(config.gyroscope, rate, load, warmer_k, world.rate_v)


@kernel
def rate_deg_s(world: State, alpha: float, beta: float, t_ns: int) -> tuple[float, float, float]:
    """Mean angular rate of the board since the last step, in its own frame, deg/s."""
    x, y, z = gravity.felt_g(world.earth_deg_s, world.board, alpha, beta)
    if t_ns > world.turned_ns:
        per_s = 1e9 / (t_ns - world.turned_ns)
        leaning = math.degrees(alpha - world.turned_rad[0]) * per_s
        turning = math.degrees(beta - world.turned_rad[1]) * per_s
        sb, cb = math.sin(beta), math.cos(beta)
        own_x, own_y, own_z = gravity.across(world.board, -leaning * sb, leaning * cb, turning)
        x, y, z = x - own_x, y - own_y, z - own_z
    world.turned_rad[0], world.turned_rad[1], world.turned_ns = alpha, beta, t_ns
    return x, y, z
