"""What may be wrong with a rig or a sensor, as mechanisms; the names by which the catalogue may call each.

Size 1 is far beyond what a sensor shows. `size` has one entry for each axis; a stage takes the first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from tests.benchmark.discovery.layouts import Array
from tests.benchmark.discovery.memory import bouc_wen, preisach, trailing
from tests.benchmark.discovery.rig import Change, Mechanism, Run, Stand

Pair = tuple[Array, Array]  # specific force (n, 3), and what the transducer makes of it (n, 2)


def _turn(x: float, y: float, z: float) -> Array:
    """Rotation about three axes in turn."""
    X = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    Y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    Z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    return Z @ Y @ X


def slipped_mark(s: Stand, run: Run, size: Array) -> Stand:
    """The marks of both scales have slipped."""
    by = run.draw("mark").uniform(0.5, 1, 2) * run.draw("sign").choice([-1, 1], 2)
    return replace(s, alpha=s.alpha + by[0] * size[0], beta=s.beta + by[1] * size[0])


def off_centre(s: Stand, run: Run, size: Array) -> Stand:
    """A scale's centre beside the axis, and an oval bearing."""
    p, q = run.draw("centre").uniform(0, 2 * np.pi, 2)
    e = size[0]
    first = np.arctan2(e * np.sin(s.beta - p), 1 + e * np.cos(s.beta - p))
    return replace(s, beta=s.beta + first + 0.03 * e * np.sin(2 * s.beta - q))


def loose_gear(s: Stand, run: Run, size: Array) -> Stand:
    """The table stays until the tooth has gone through its play."""
    return replace(s, beta=trailing(s.beta, size[0], 0.0))


def sunk_foot(s: Stand, run: Run, size: Array) -> Stand:
    """One foot of the base stands lower."""
    r = run.draw("foot").uniform(0, 2 * np.pi)
    return replace(s, up=_turn(size[0] * np.cos(r), size[0] * np.sin(r), 0.0) @ s.up)


def skew_solder(a: Array, run: Run, size: Array) -> Array:
    """The package was soldered askew."""
    return a @ _turn(*(size[0] * run.draw("solder").uniform(0.4, 1, 3) * run.draw("side").choice([-1, 1], 3))).T


def skew_beam(a: Array, run: Run, size: Array) -> Array:
    """The y beam is not at right angles to the x beam."""
    e = size[0]
    return np.column_stack([a[:, 0], np.cos(e) * a[:, 1] + np.sin(e) * a[:, 0], a[:, 2]])


def _own(law: Callable[[Array, Array], Array]) -> Change:
    """A law of an axis's own response."""
    return lambda x, run, size: (x[0], law(x[1], size))


def _hardened(g: Array, k: Array) -> Array:
    """The displacement x of a spring that hardens: x + k x^3 = g."""
    x = g.copy()
    for _ in range(30):
        x = x - (x + k * x**3 - g) / (1 + 3 * k * x**2)
    return x


def _stuck(g: Array, w: Array) -> Array:
    """Stiction: what is below a threshold is not seen; the edge is rounded."""
    w = np.abs(w)
    soft = 0.15 * w
    return np.sign(g) * (soft * np.logaddexp(0, (np.abs(g) - w) / soft) - soft * np.logaddexp(0, -w / soft))


def _other(g: Array) -> Array:
    return g[:, [1, 0]]


def _across(law: Callable[[Array, Array, Array, Array], Array]) -> Change:
    """A law of the response, the other axis's force and the third's."""
    return lambda x, run, size: (x[0], law(x[1], x[0][:, [1, 0]], x[0][:, 2:], size))


def _friction(model: Callable[[Array, np.random.Generator], Array]) -> Change:
    def change(x: Pair, run: Run, size: Array) -> Pair:
        return x[0], x[1] + size * remembered(run, model)

    return change


_LOOPS: dict[Any, Array] = {}


def remembered(run: Run, model: Callable[[Array, np.random.Generator], Array]) -> Array:
    """The loop of unit height does not depend on the size: walked through once for a record."""
    key = (run, model.__name__)
    if key not in _LOOPS:
        _LOOPS.clear()
        _LOOPS[key] = model(run.way[:, :, :2], run.draw("friction"))
    return _LOOPS[key]


def stressed_package(v: Array, run: Run, size: Array) -> Array:
    """A measured curve, not quite straight, of a die that the thermometer follows with a lag."""
    warmer = run.temperature_c - run.temperature_c.mean()
    return v + np.outer(warmer + 0.012 * warmer**2, size)


def softened_beams(x: Pair, run: Run, size: Array) -> Pair:
    warmer = run.temperature_c - run.temperature_c.mean()
    return x[0], x[1] * np.exp(np.outer(warmer, size))


def creeping_glue(v: Array, run: Run, size: Array) -> Array:
    """Glue that follows the temperature through plays of several widths."""
    c, range_k = run.temperature_c, float(np.ptp(run.temperature_c))
    behind = np.mean([trailing(c, w * range_k, c[0]) for w in (0.06, 0.11, 0.15, 0.2)], axis=0)
    return v + np.outer(behind - behind.mean(), size)


def _cooling(run: Run) -> Array:
    """Die and board warm up: two thermal masses."""
    span, r = run.since_s[-1], run.draw("masses")
    board = r.uniform(0.12, 0.4) * span
    return 0.85 * np.exp(-run.since_s / board) + 0.15 * np.exp(-run.since_s / (board / 5))


def warming_die(v: Array, run: Run, size: Array) -> Array:
    return v + np.outer(_cooling(run), size)


def warming_beams(x: Pair, run: Run, size: Array) -> Pair:
    return x[0], x[1] * (1 + np.outer(_cooling(run), size))


def ageing(v: Array, run: Run, size: Array) -> Array:
    """A reference that ages, a little more slowly with time."""
    return v + np.outer(run.u - 0.06 * run.u**2, size)


def wandering(v: Array, run: Run, size: Array) -> Array:
    """White noise, integrated."""
    walk = np.cumsum(run.draw("walk").standard_normal(v.shape) * np.sqrt(np.diff(run.u, prepend=0.0))[:, None], axis=0)
    return v + size * walk


def ratiometric(v: Array, run: Run, size: Array) -> Array:
    """Output over a reference that holds only a part of the supply's changes off."""
    return v * np.exp(np.log(run.supply_v / run.supply_v.mean())[:, None] * np.abs(size))


def _rail(v: Array, run: Run, size: Array) -> Array:
    """The output stage bends softly into its upper rail."""
    depth = np.abs(size)
    rail, soft = v.max(axis=0) - depth, 0.12 * depth
    return rail - soft * np.logaddexp(0, (rail - v) / soft)


def bent_ladder(v: Array, run: Run, size: Array) -> Array:
    """The converter's ladder: its resistors differ along it, for every channel alike."""
    u = (v - 2.5) / 1.2
    return v + size[0] * (0.6 * u**2 / (1 + 0.1 * u) + 1.5 * (u - np.tanh(0.9 * u) / 0.9))


def few_bits(v: Array, run: Run, size: Array) -> Array:
    """Samples rounded by a converter whose codes are not all equally wide: their mean over the noise."""
    return rounded(v, run, size)[0]


def rounded(v: Array, run: Run, size: Array) -> tuple[Array, Array]:
    """Mean and standard deviation of rounded samples."""
    step, r = abs(float(size[0])), run.draw("codes")
    shift, uneven = r.random() * step, 0.04 * step * r.standard_normal(4096)
    z = np.linspace(-5, 5, 161)
    weight = np.exp(-(z**2) / 2) / np.sum(np.exp(-(z**2) / 2))
    samples = v[..., None] + run.noise_of_sample_v * z
    code = np.round((samples - shift) / step)
    code = np.round((samples - shift + uneven[code.astype(int) % 4096]) / step)
    out = code * step + shift
    mean = out @ weight
    return mean, np.sqrt(np.maximum((out - mean[..., None]) ** 2 @ weight, 0))


def _m(place: str, change: Change, *names: str, **more: Any) -> Mechanism:
    return Mechanism(place, change, frozenset(names), **more)


MECHANISMS: dict[str, Mechanism] = {
    "slipped marks": _m("stage", slipped_mark, "stage-zero-offset"),
    "scale off centre": _m("stage", off_centre, "stage-eccentricity"),
    "loose gear": _m("stage", loose_gear, "stage-backlash"),
    "sunk foot": _m("stage", sunk_foot, "base-tilt"),
    "skew solder": _m("body", skew_solder, "axis-misalignment"),
    "skew beam": _m("body", skew_beam, "axis-nonorthogonality"),
    "tilted plates": _m("transducer", _own(lambda g, k: g / (1 - k * g)), "quadratic-nonlinearity"),
    "hard springs": _m("transducer", _own(_hardened), "cubic-nonlinearity"),
    "two amplifiers": _m(
        "transducer",
        _own(lambda g, k: g + k * 0.02 * (np.logaddexp(0, g / 0.02) + np.logaddexp(0, -g / 0.02))),
        "scale-factor-asymmetry",
    ),
    "drag": _m("transducer", _own(lambda g, k: g + k * g * np.sqrt(g**2 + 1e-4)), "odd-quadratic-nonlinearity"),
    "stiction": _m("transducer", _own(_stuck), "dead-zone"),
    "friction by Bouc and Wen": _m("transducer", _friction(bouc_wen), "hysteresis"),
    "friction by Preisach": _m("transducer", _friction(preisach), "hysteresis"),
    "drawn-in beams": _m("transducer", _across(lambda g, o, z, k: g + k * (1 - np.cos(0.7 * o))), "cross-axis-bias"),
    "sliding plates": _m("transducer", _across(lambda g, o, z, k: g / (1 + k * o)), "cross-axis-scale"),
    "sagging mass": _m("transducer", _across(lambda g, o, z, k: g + k * (1 - np.cos(0.7 * z))), "z-axis-bias"),
    "sagging plates": _m("transducer", _across(lambda g, o, z, k: g / (1 + k * z)), "z-axis-scale"),
    "stressed package": _m("volts", stressed_package, "temperature-bias"),
    "softened beams": _m("transducer", softened_beams, "temperature-scale"),
    "creeping glue": _m("volts", creeping_glue, "temperature-hysteresis"),
    "warming die": _m("volts", warming_die, "warm-up-bias", cold=True),
    "warming beams": _m("transducer", warming_beams, "warm-up-scale", cold=True),
    "ageing reference": _m("volts", ageing, "bias-drift"),
    "wandering reference": _m("volts", wandering, "bias-drift"),
    "ratiometric output": _m("volts", ratiometric, "supply-sensitivity", supply=True),
    "soft rail": _m("volts", _rail, "saturation"),
    "bent ladder": _m("volts", bent_ladder, "adc-nonlinearity"),
    "few bits": _m("volts", few_bits, "quantisation"),
}
