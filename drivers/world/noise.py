"""Noise of one output in front of its filter, a resistor and a capacitor.

    white noise     of air and amplifier: behind the filter an Ornstein-Uhlenbeck process, exact over any interval
    traps           that catch and release charge, one kind per decade of release time: together flicker noise, whose
                    one-sided spectrum is flicker_v^2 / (f ln 10)
    walk            the sum of small independent steps
    wander          an Ornstein-Uhlenbeck process
    ramp            a leak or creep at a constant rate

All but the white noise is slow, and advances in ticks (see mechanics). Faster noise, and the noise of the leads, is
added behind the filter (see pickup). A wander that is off draws no random numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from drivers.world.kernel import Floats, kernel, share_with_kernels, step_wander, zeros

FLICKER_S = (1.0, 10.0, 100.0, 1e3, 1e4)  # release times of traps
TICK_MEMORY_S = 0.5  # a wander of a longer memory advances in ticks
TIME_MARGIN = 1 - 1e-9  # of a time that is compared
HOUR_S = 3600.0


@dataclass(frozen=True)
class Noise:
    """Amplitudes at one output, in V; each is off where it is 0."""

    white_v: float = 0.775e-3  # rms behind the filter
    flicker_v: float = 0.0  # rms of each decade of traps
    flicker_fastest_s: float = 1.0  # release time of the fastest traps, 0.01 at the least
    walk_v_per_sqrt_h: float = 0.0  # random walk of the output
    wander_v: float = 0.0  # rms
    wander_s: float = 300.0  # its correlation time
    ramp_v_per_h: float = 0.0
    hum_v: float = 0.0  # amplitude of a sinusoid picked up by the leads
    hum_hz: float = 50.0
    pulse_v_s: float = 0.0  # size of a pulse of the output
    filter_ohm: float = 32e3
    filter_farad: float = 0.33e-6


@dataclass(frozen=True)
class Noises:
    """Noise of both outputs. A bench file sets both, `white_v: 1e-3`, or one by its name, `x: {white_v: 1e-3}`."""

    x: Noise = field(default_factory=Noise)
    y: Noise = field(default_factory=Noise)


@dataclass
class Fluctuation:
    """State of the noise of one output and of its filter. Times in ns of world time."""

    flicker_v: Floats = field(default_factory=zeros(len(FLICKER_S)))
    walk_v: float = 0.0
    wander_v: float = 0.0
    slow_v: float = 0.0  # sum of these and the ramp
    filtered_v: float = 0.0  # on the capacitor, without white noise
    filtered_ns: int = 0
    white: float = 0.0  # behind the filter, in units of its rms
    white_ns: int = 0
    kept_ns: int = 0  # the filter's last step, and its answers
    kept: float = 1.0  # share of the old
    fresh: float = 0.0  # share of new white noise, in rms


@share_with_kernels
def filter_s(noise: Noise) -> float:
    """Time constant of the filter."""
    return noise.filter_ohm * noise.filter_farad


@share_with_kernels
def trap_v(noise: Noise, release_s: float) -> float:
    """Rms of the traps of one release time."""
    return noise.flicker_v if release_s > TIME_MARGIN * noise.flicker_fastest_s else 0.0


@share_with_kernels
def ticked_rms_v(noise: Noise) -> float:
    """Rms of the wander if it advances in ticks, else 0, V."""
    return noise.wander_v if noise.wander_s >= TICK_MEMORY_S else 0.0


def begin(state: Fluctuation, noise: Noise, random: Generator) -> None:
    """Draw the state of traps and wander; white noise is drawn separately."""
    traps_v = np.array([trap_v(noise, release_s) for release_s in FLICKER_S])
    state.flicker_v = traps_v * random.standard_normal(len(FLICKER_S))
    if ticked_rms_v(noise):
        state.wander_v = ticked_rms_v(noise) * random.standard_normal()
    settle(state, noise, 0.0)


@kernel
def tick(x: Fluctuation, y: Fluctuation, noise: Noises, t_s: float, step_s: float, random: Generator) -> None:
    """Advance the slow noise of both outputs by one tick that ends at `t_s`."""
    release(x, noise.x, step_s, random)
    release(y, noise.y, step_s, random)
    stray(x, noise.x, step_s, random)
    stray(y, noise.y, step_s, random)
    settle(x, noise.x, t_s)
    settle(y, noise.y, t_s)


@kernel
def release(state: Fluctuation, noise: Noise, step_s: float, random: Generator) -> None:
    """Advance the slow traps by one step."""
    for k in range(len(FLICKER_S)):
        rms, release_s = trap_v(noise, FLICKER_S[k]), FLICKER_S[k]
        state.flicker_v[k] = step_wander(state.flicker_v[k], rms, release_s, step_s, random.standard_normal())


@kernel
def stray(state: Fluctuation, noise: Noise, step_s: float, random: Generator) -> None:
    """Advance the random walk and the wander by one step."""
    state.walk_v += noise.walk_v_per_sqrt_h * math.sqrt(step_s / HOUR_S) * random.standard_normal()
    if ticked_rms_v(noise) != 0:
        state.wander_v = step_wander(state.wander_v, noise.wander_v, noise.wander_s, step_s, random.standard_normal())


@kernel
def settle(state: Fluctuation, noise: Noise, t_s: float) -> None:
    """Add up the slow noise at `t_s`."""
    state.slow_v = state.flicker_v.sum() + state.walk_v + state.wander_v + noise.ramp_v_per_h * t_s / HOUR_S


@kernel
def remember(state: Fluctuation, noise: Noise, gap_ns: int) -> None:
    """Compute the decay of the filter over `gap_ns`, unless it is known from the last call."""
    if gap_ns != state.kept_ns:
        state.kept_ns = gap_ns
        state.kept = math.exp(-1e-9 * gap_ns / filter_s(noise))
        state.fresh = math.sqrt(1 - state.kept * state.kept)


@kernel
def charge(state: Fluctuation, noise: Noise, volts: float, t_ns: int) -> None:
    """Charge the capacitor until `t_ns` by `volts` and the slow noise at its input."""
    gap_ns = t_ns - state.filtered_ns
    if gap_ns > 0:
        remember(state, noise, gap_ns)
        target = volts + state.slow_v
        state.filtered_v = target + state.kept * (state.filtered_v - target)
        state.filtered_ns = t_ns


@kernel
def output_v(state: Fluctuation, noise: Noise, volts: float, t_ns: int, normal: float) -> float:
    """Voltage of the capacitor at `t_ns`, noise included, after `volts` at the input of the filter."""
    charge(state, noise, volts, t_ns)
    gap_ns = t_ns - state.white_ns
    if gap_ns > 0:
        remember(state, noise, gap_ns)
        state.white = state.kept * state.white + state.fresh * normal
        state.white_ns = t_ns
    output: float = state.filtered_v + noise.white_v * state.white
    return output
