"""Causes that no effect of the catalogue describes, each with the words that its residual's description should hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.benchmark.discovery.layouts import Array
from tests.benchmark.discovery.mechanisms import Pair
from tests.benchmark.discovery.rig import Mechanism, Run, Stand


def worm(s: Stand, run: Run, size: Array) -> Stand:
    """A worm that runs out of true: five waves in a turn."""
    return replace(s, beta=s.beta + size[0] * np.sin(5 * s.beta + run.draw("worm").uniform(0, 2 * np.pi)))


def slipped_once(s: Stand, run: Run, size: Array) -> Stand:
    """The alpha stage slipped and was set right again: one inclination, or a tenth of the poses, is off."""
    values = np.unique(s.alpha)
    if len(values) > 20:
        off = np.abs(run.u - run.draw("slip").uniform(0.2, 0.8)) < 0.05
    else:
        off = s.alpha == run.draw("slip").choice(values[np.abs(np.sin(values)) > 0.3])
    return replace(s, alpha=s.alpha + size[0] * off)


def seesaw(s: Stand, run: Run, size: Array) -> Stand:
    """The table rocks from one seat of its bearing to the other as gravity passes over."""
    return replace(s, alpha=s.alpha + size[0] * np.sign(np.sin(s.beta - run.draw("seat").uniform(0, 2 * np.pi))))


def arrived_charge(v: Array, run: Run, size: Array) -> Array:
    """Charge arrives at one moment and stays."""
    return v + np.outer(run.u > run.draw("moment").uniform(0.25, 0.75), size)


def lid(v: Array, run: Run, size: Array) -> Array:
    """A lid that pops in and out, now and then."""
    r = run.draw("lid")
    times = np.sort(r.random(int(r.integers(6, 14))))
    return v + np.outer(np.searchsorted(times, run.u) % 2, size)


def stick_slip(v: Array, run: Run, size: Array) -> Array:
    """Cable and clamp hold until the table has gone on by some angle, then let go, again and again."""
    period = np.radians(run.draw("clamp").uniform(65, 110))
    travelled = np.cumsum(np.abs(np.diff(run.stand.beta, prepend=0.0)))
    return v + np.outer(travelled / period % 1.0, size)


def cable(v: Array, run: Run, size: Array) -> Array:
    """A cable that is taut in one sector of beta, and slack elsewhere."""
    centre = run.draw("cable").uniform(0, 2 * np.pi)
    taut = np.maximum(0.0, np.cos(run.stand.beta - centre) - np.cos(np.radians(35)))
    return v + np.outer(taut, size)


def mains_beat(v: Array, run: Run, size: Array) -> Array:
    """Mains, aliased by a dwell that is no whole number of its periods: a slow beat."""
    r = run.draw("mains")
    waves = r.uniform(14, 26)
    return v + np.outer(np.sin(2 * np.pi * waves * run.u + r.uniform(0, 2 * np.pi)), size)


def sparks(v: Array, run: Run, size: Array) -> Array:
    """A relay beside the rig: every so many poses one is off."""
    every = int(run.draw("relay").integers(11, 23))
    return v + np.outer(np.arange(len(v)) % every == every // 2, size)


def magnet(v: Array, run: Run, size: Array) -> Array:
    """The field of the alpha stage's motor, picked up alike at every beta."""
    return v + np.outer(np.sin(2 * run.stand.alpha), size)


def heater(v: Array, run: Run, size: Array) -> Array:
    """A heater on the board that its thermostat switches."""
    c = run.temperature_c
    return v + np.outer(c > np.quantile(c, run.draw("heater").uniform(0.35, 0.65)), size)


def grain(x: Pair, run: Run, size: Array) -> Pair:
    """A grain of dust between the fingers: beyond one displacement the spring is stiffer, one axis, one side."""
    at = run.draw("grain").uniform(0.2, 0.5)
    soft = np.maximum(0, x[0][:, 0] - at) * np.maximum(0, x[0][:, 2])
    return x[0], x[1] - np.outer(soft, size)


def _m(place: str, change: object, structure: str) -> Mechanism:
    return Mechanism(place, change, frozenset(), structure=structure)


OUTSIDE: dict[str, Mechanism] = {
    "worm": _m("stage", worm, r"5th harmonic of .*beta"),
    "slipped once": _m("stage", slipped_once, r"alpha|stands? out"),
    "seesaw": _m("stage", seesaw, r"harmonic of .*(alpha|beta)|sector of beta|step at beta"),
    "arrived charge": _m("volts", arrived_charge, r"step at t"),
    "lid": _m("volts", lid, r"two levels|jump|telegraph|step at t"),
    "stick-slip": _m("volts", stick_slip, r"saw|beta|stick"),
    "cable": _m("volts", cable, r"sector of beta"),
    "mains beat": _m("volts", mains_beat, r"oscillat|period|waves|beat|Hz"),
    "sparks": _m("volts", sparks, r"stands? out|outlier|spike|every"),
    "magnet": _m("volts", magnet, r"harmonic of .*alpha|inclination"),
    "heater": _m("volts", heater, r"temperature"),
    "grain": _m("transducer", grain, r"alpha|beta"),
}
