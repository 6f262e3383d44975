"""Disturbances behind the filter of an output, sample by sample: fast noise, hum, pulses, and vibration of the floor.

The floor vibrates at one frequency, as from a machine in the next room. Its effect is of first order: the component
along a sensing beam times the sensitivity, behind the output filter. The motion of the carriage, which is large, goes
through the whole mechanics (see mechanics).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from drivers.world.kernel import Floats, kernel, mean_variance, share_with_kernels, zeros
from drivers.world.noise import TICK_MEMORY_S, Noise, filter_s, trap_v


@dataclass(frozen=True)
class Floor:
    """Amplitudes of its acceleration in g, in the frame of the base."""

    shaking_up_g: float = 0.0
    shaking_along_g: float = 0.0  # along the base's x axis
    shaking_hz: float = 24.0


@kernel
def acceleration_g(floor: Floor) -> Floats:
    """Amplitude in the frame of the base, shape (3,)."""
    return np.array([floor.shaking_along_g, 0.0, floor.shaking_up_g])


@kernel
def shakes(floor: Floor) -> bool:
    """Whether the floor vibrates."""
    return floor.shaking_up_g != 0 or floor.shaking_along_g != 0


@share_with_kernels
def low_pass(floor: Floor, filter_s: float) -> tuple[float, float]:
    """Gain of a low-pass of time constant `filter_s` at the floor's frequency, and its lag, rad."""
    turn = 2 * math.pi * floor.shaking_hz * filter_s
    return 1 / math.hypot(1.0, turn), math.atan(turn)


# Disturbances of an output behind its filter.
#
# fast traps      of the buffer: the decades of flicker noise above the slow ones (see noise)
# fast wander     with a correlation time of less than a few ticks
# hum             of the leads
# shaking         of the floor
# pulses          of an output with charge balance: the whole pulses since the last sample. The rest of a pulse stays on
#                 the integrator, so the rounding of one sample is corrected in the next.

FAST_S = (0.01, 0.1)  # release times of the buffer's traps
FAST = len(FAST_S) + 1  # and the wander


@dataclass
class Pickup:
    """State of the disturbances that one output picks up. Times in ns of world time."""

    is_any: int = 0  # 1 where anything of this is on
    t_ns: int = 0  # of the last sample
    fast_v: Floats = field(default_factory=zeros(FAST))
    left_v_s: float = 0.0  # on the integrator
    shaken_v: float = 0.0  # amplitude of the effect of the floor
    gap_ns: int = 0  # the last step of the fast processes, and its answers
    kept: Floats = field(default_factory=zeros(FAST))
    fresh_v: Floats = field(default_factory=zeros(FAST))


@share_with_kernels
def process(noise: Noise, k: int) -> tuple[float, float]:
    """Rms in V and correlation time in s of the `k`-th fast process; 0 V where it is off."""
    if k < len(FAST_S):
        return trap_v(noise, FAST_S[k]), FAST_S[k]
    return noise.wander_v if noise.wander_s < TICK_MEMORY_S else 0.0, noise.wander_s


def begin(state: Pickup, noise: Noise, shaking: Floor, random: Generator) -> None:
    """Draw the state at time 0; draws nothing for disturbances that are off."""
    amplitudes_v = [process(noise, k)[0] for k in range(FAST)]
    state.fast_v = np.array([rms * random.standard_normal() if rms else 0.0 for rms in amplitudes_v])
    state.left_v_s = noise.pulse_v_s * random.random() if noise.pulse_v_s else 0.0
    state.is_any = int(any(amplitudes_v) or noise.hum_v != 0 or noise.pulse_v_s != 0 or shakes(shaking))


@kernel
def with_pickup_v(state: Pickup, noise: Noise, shaking: Floor, volts: float, t_ns: int, random: Generator) -> float:
    """`volts` behind the filter at `t_ns`, with all that is picked up there."""
    gap_ns = t_ns - state.t_ns
    if gap_ns > 0:
        state.t_ns = t_ns
        stir(state, noise, gap_ns, random)
    total_v = volts + state.fast_v.sum() + hum_v(noise, t_ns) + shaken_v(state, noise, shaking, t_ns)
    return pulsed_v(state, noise, total_v, gap_ns)


@kernel
def stir(state: Pickup, noise: Noise, gap_ns: int, random: Generator) -> None:
    """Let `gap_ns` pass for the fast processes."""
    if gap_ns != state.gap_ns:
        state.gap_ns = gap_ns
        for k in range(FAST):
            rms, time_s = process(noise, k)
            state.kept[k] = math.exp(-1e-9 * gap_ns / time_s)
            state.fresh_v[k] = rms * math.sqrt(1 - state.kept[k] ** 2)
    for k in range(FAST):
        if state.fresh_v[k] > 0:
            state.fast_v[k] = state.kept[k] * state.fast_v[k] + state.fresh_v[k] * random.standard_normal()


@kernel
def hum_v(noise: Noise, t_ns: int) -> float:
    """Hum of the leads, V."""
    return noise.hum_v * math.sin(2 * math.pi * noise.hum_hz * 1e-9 * t_ns)


@kernel
def shaken_v(state: Pickup, noise: Noise, shaking: Floor, t_ns: int) -> float:
    """Effect of the floor's shaking on the output."""
    if state.shaken_v == 0:
        return 0.0
    lag = low_pass(shaking, filter_s(noise))[1]
    return state.shaken_v * math.sin(2 * math.pi * shaking.shaking_hz * 1e-9 * t_ns - lag)


@kernel
def pulsed_v(state: Pickup, noise: Noise, volts: float, gap_ns: int) -> float:
    """`volts` in whole pulses since the last sample, `gap_ns` ago; unchanged without pulses."""
    if noise.pulse_v_s == 0 or gap_ns <= 0:
        return volts
    state.left_v_s += 1e-9 * gap_ns * volts
    pulses_v_s = math.floor(state.left_v_s / noise.pulse_v_s) * noise.pulse_v_s
    state.left_v_s -= pulses_v_s
    return pulses_v_s / (1e-9 * gap_ns)


def sinusoid_mean(hz: float, lag: float, middle_s: Floats, interval_s: float, n: int) -> Floats:
    """Mean of sin(2 pi hz t - lag) over `n` samples around each time of `middle_s`."""
    phase = math.pi * hz * interval_s
    share = 1.0 if math.sin(phase) == 0 else math.sin(n * phase) / (n * math.sin(phase))
    return np.asarray(share * np.sin(2 * math.pi * hz * middle_s - lag))


def sinusoid_variance(hz: float, lag: float, middle_s: Floats, interval_s: float, n: int) -> Floats:
    """Variance of the samples about their mean; of a slow sinusoid it is only a part."""
    square = (1 - sinusoid_mean(2 * hz, 2 * lag - math.pi / 2, middle_s, interval_s, n)) / 2
    return np.maximum(square - sinusoid_mean(hz, lag, middle_s, interval_s, n) ** 2, 0.0)


def random_variance(noise: Noise, interval_s: float) -> float:
    """Variance of single samples, V^2: fast processes, and the pulses left on the integrator before and after each."""
    return sum(process(noise, k)[0] ** 2 for k in range(FAST)) + noise.pulse_v_s**2 / 6 / interval_s**2


def random_mean_variance(noise: Noise, interval_s: float, n: int) -> float:
    """Variance of the mean of `n` samples, V^2: fast processes, and the pulses left on the integrator at both ends."""
    processes = (process(noise, k) for k in range(FAST))
    ends = noise.pulse_v_s**2 / 6 / (n * interval_s) ** 2
    return sum(mean_variance(rms, time_s, interval_s, n) for rms, time_s in processes) + ends
