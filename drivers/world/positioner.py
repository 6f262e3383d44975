"""The carriage of the nano-positioner: its motion after a command of the servo, in um along each axis.

The carriage is on the turning table and carries the sensor's mount. Its axes x, y, z are those of the table, and at
mount 0 those of the sensor. A closed loop around a piezo on its flexure is a lag of second order,

    x'' + 2 d w x' + w^2 x = w^2 u(t)        w = 2 pi servo_hz, d the damping, u the command

and all commands are straight lines and sinusoids. So the motion has a closed form for all times: the settled response
of the loop, and an exponential by its initial state. It needs no time steps, and a carriage at rest no computation.
`Positioner` is passed as its record (see kernel).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers.world.errors import BadSetting
from drivers.world.kernel import Floats, Ints, kernel

Bits = NDArray[np.uint64]

AXES = ("x", "y", "z")
PIECES = 2  # a command, and standing where it ended
TERMS = 8  # of a piece: start, place, rate, amplitude, angular frequency, phase, and both parts of the exponential
FOREVER_S = 1e9
SETTLING_TIMES = 25.0  # time constants after which 1e-11 of the initial deviation remains


@dataclass(frozen=True)
class Positioner:
    """Flexure stage and servo loop of one axis; the travel and the speed are the controller's."""

    servo_hz: float = 120.0  # natural frequency of the closed loop
    damping_fraction: float = 0.8  # relative to critical; below 1
    noise_nm: float = 1.0  # rms of one reading of the position sensor

    def __post_init__(self) -> None:
        if not (self.servo_hz > 0 and 0 < self.damping_fraction < 1):
            raise BadSetting(
                f"No servo loop has {self}", "Give a positive servo_hz and a damping_fraction between 0 and 1"
            )


@dataclass(frozen=True)
class Command:
    """The commanded position from `start_s` to `end_s`, then the position reached.

    at_um + rate_um_s t + amplitude_um sin(2 pi frequency_hz t + phase_rad), with t from `start_s` on.
    """

    start_s: float
    at_um: float
    rate_um_s: float = 0.0
    amplitude_um: float = 0.0
    frequency_hz: float = 0.0
    phase_rad: float = 0.0
    end_s: float = FOREVER_S

    def um(self, t_s: float) -> float:
        """The commanded place at `t_s`."""
        t = min(max(t_s, self.start_s), self.end_s) - self.start_s
        swing = self.amplitude_um * math.sin(2 * math.pi * self.frequency_hz * t + self.phase_rad)
        return self.at_um + self.rate_um_s * t + swing

    def moving(self, t_s: float) -> bool:
        """Whether the commanded place changes at `t_s`."""
        return self.start_s <= t_s < self.end_s and (self.rate_um_s != 0 or self.amplitude_um != 0)


def hold_command(at_um: float, since_s: float = 0.0) -> Command:
    """The command to be at one place."""
    return Command(since_s, at_um, end_s=since_s)


def follow_command(positioner: Positioner, pieces: Floats, command: Command) -> tuple[Floats, float]:
    """The motion from the command's start on, given the motion until then; and when it has decayed, in s."""
    new = np.zeros((PIECES, TERMS))
    new[0, :6] = _settled_response(positioner, command)
    _begin(positioner, new[0], pieces)
    new[1, :2] = command.end_s, command.um(command.end_s)
    _begin(positioner, new[1], new[:1])
    return new, command.end_s + SETTLING_TIMES / (2 * math.pi * positioner.servo_hz * positioner.damping_fraction)


def _settled_response(positioner: Positioner, command: Command) -> tuple[float, ...]:
    """The settled response of the loop to a command: delayed, weaker, shifted in phase."""
    natural, driven = 2 * math.pi * positioner.servo_hz, 2 * math.pi * command.frequency_hz
    answer = natural**2 / complex(natural**2 - driven**2, 2 * positioner.damping_fraction * natural * driven)
    late_s = 2 * positioner.damping_fraction / natural
    phase = command.phase_rad + math.atan2(answer.imag, answer.real)
    place = command.at_um - late_s * command.rate_um_s
    return command.start_s, place, command.rate_um_s, command.amplitude_um * abs(answer), driven, phase


def _begin(positioner: Positioner, piece: Floats, earlier: Floats) -> None:
    """Set the exponential of `piece` so that position and speed are continuous with `earlier` at its start."""
    decay, swing = _poles(positioner)
    before_move, new_move = (motion(positioner, pieces, piece[0]) for pieces in (earlier, piece[None, :]))
    piece[6] = before_move[0] - new_move[0]
    piece[7] = (before_move[1] - new_move[1] + decay * piece[6]) / swing


@kernel
def _poles(positioner: Positioner) -> tuple[float, float]:
    """Decay rate and angular frequency of the free motion of the loop, 1/s."""
    natural = 2 * math.pi * positioner.servo_hz
    return positioner.damping_fraction * natural, natural * math.sqrt(1 - positioner.damping_fraction**2)


@kernel
def motion(positioner: Positioner, pieces: Floats, t_s: float) -> tuple[float, float, float]:
    """Place in um, speed in um/s and acceleration in um/s^2 of a carriage at `t_s`."""
    k = len(pieces) - 1
    while k > 0 and t_s < pieces[k, 0]:
        k -= 1
    start, place, rate, amplitude, driven, phase, a, b = pieces[k]
    decay, swing = _poles(positioner)
    t = max(0.0, t_s - start)
    turned = driven * t + phase
    decayed = math.exp(-decay * t)
    c, s = decayed * math.cos(swing * t), decayed * math.sin(swing * t)
    a1, b1 = swing * b - decay * a, -swing * a - decay * b  # of the first derivative of a c + b s
    a2, b2 = swing * b1 - decay * a1, -swing * a1 - decay * b1
    return (
        place + rate * t + amplitude * math.sin(turned) + a * c + b * s,
        rate + amplitude * driven * math.cos(turned) + a1 * c + b1 * s,
        -amplitude * driven**2 * math.sin(turned) + a2 * c + b2 * s,
    )


@kernel
def places_um(positioner: Positioner, pieces: Floats, times_s: Floats) -> Floats:
    """Places at many times."""
    places = np.empty(len(times_s))
    for i in range(len(times_s)):
        places[i] = motion(positioner, pieces, times_s[i])[0]
    return places


def read_um(positioner: Positioner, pieces: Floats, times_s: ArrayLike, salt: int) -> Floats:
    """Reading of the position sensor at `times_s`: the position, and noise that depends on time and `salt` only."""
    times = np.atleast_1d(np.asarray(times_s, dtype=np.float64))
    noise = normal_at(np.rint(1e9 * times).astype(np.int64), salt)
    position_um: Floats = places_um(positioner, pieces, times) + 1e-3 * positioner.noise_nm * noise
    return position_um


def normal_at(times_ns: Ints, salt: int) -> Floats:
    """Standard normal numbers as a function of the time: equal times give equal numbers. Box-Muller on mixed bits."""
    words = times_ns.astype(np.uint64) * np.uint64(2) + _mix_bits(np.array([salt], dtype=np.uint64))
    first, second = (1.0 - _mix_bits(words + np.uint64(k)) / 2.0**64 for k in range(2))
    return np.asarray(np.sqrt(-2 * np.log(first)) * np.cos(2 * math.pi * second))


def _mix_bits(words: Bits) -> Bits:
    """SplitMix64 (Steele, Lea and Flood 2014): neighbouring numbers become unrelated ones."""
    words = words + np.uint64(0x9E3779B97F4A7C15)
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mixed: Bits = words ^ (words >> np.uint64(31))
    return mixed
