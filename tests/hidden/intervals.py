"""95 % intervals of rigs whose truth is known, with slow noise of several kinds and an effect just added.

A rig of the simulated world has one defect; the truth is what the same rig, room and supply give without the noise of
sensor and converter. A rig of `sampled` has its truth from the draws of its own laws. Slow noise is made here by laws
that the analysis does not have: flicker by its spectrum, a random walk as a sum, an autoregressive process. The rms
of flicker and of a walk about the record's mean, or the process's standard deviation, is so many times the white noise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit, refit
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.hidden import rigs, sampled
from tests.hidden.defects import DEFECTS
from tests.hidden.test_hidden_defects import NAMES

SUFFICIENT = 1.96  # standard uncertainties either side: 95 %
EVERY = 5  # of the poses of a sweep: 104 rows are enough
TIMES_NOISE = 10
ASKEW = {"package": {"turn_x_deg": 0.4, "turn_y_deg": -0.3, "turn_z_deg": 0.2, "beams_off_square_deg": 0.1}}
GEOMETRY = ("axis-misalignment", "axis-nonorthogonality")
RAMP_V_PER_H, WIDTH_G, SLOPE_V_PER_K = 1e-3, 0.003, np.array([2e-4, -1.5e-4])
Key = tuple[str, str, str]  # effect, parameter, axis


@dataclass(frozen=True)
class Interval:
    """One parameter of one rig; `error` in standard uncertainties."""

    effect: str
    error: float
    added: bool

    @property
    def holds(self) -> bool:
        """Whether the interval holds the truth."""
        return abs(self.error) < SUFFICIENT


def share(found: list[Interval]) -> float:
    """Of the intervals that hold the truth."""
    return float(np.mean([interval.holds for interval in found]))


def of_rigs(count: int, noise: str, times: float) -> list[Interval]:
    """Every second rig is of either generator."""
    makers = (of_world, of_sampled)
    return [interval for seed in range(count) for interval in makers[seed % 2](seed // 2, noise, times)]


def of_world(seed: int, noise: str, times: float) -> Iterator[Interval]:
    """Intervals of a rig with one of the world's defects, after the effect that describes it was added."""
    defect = list(NAMES)[seed % len(NAMES)]
    effect, floor_v = sorted(NAMES[defect])[-1], rigs.noise_floor_v()
    config = rigs.IDEAL.changed({"sensor": ASKEW})
    config = rigs.scaled(DEFECTS[defect], config, seed, TIMES_NOISE * floor_v)
    truth, measured = (_chosen(rigs.swept(config, seed, noise_free=free)) for free in (True, False))
    slow_v = times * floor_v * SLOW[noise](measured["t_s"], np.random.default_rng([seed, 5]))
    measured |= {name: measured[name] + slow_v[:, k] for k, name in enumerate(("vx_v", "vy_v"))}
    known = {"sample_rate_hz": 1000.0, "filter_corner_hz": 15.07}
    exact, found = (_with(effect, Table.from_columns("poses", c, known), GEOMETRY) for c in (truth, measured))
    yield from _intervals(found, dict(_values(exact)), effect)


def of_sampled(seed: int, noise: str, times: float) -> Iterator[Interval]:
    """Intervals of a rig of `sampled` with one of its causes, after the effect that describes it was added."""
    effect, cause = list(CAUSES.items())[seed % len(CAUSES)]
    truth: dict[Key, float] = {}

    def caused(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
        truth.update(cause.truth(v, poses))
        slow = SLOW[noise](poses.t_s, np.random.default_rng([seed, 5]))
        return cause.law(v, poses, random) + times * FLOOR_V * slow

    yield from _intervals(_with(effect, sampled.measured(seed, caused)), truth, effect)


def _with(effect: str, table: Table, others: tuple[str, ...] = ()) -> Fit:
    """The linear model fitted, then `effect` added."""
    model = read_model("linear")
    for name in others:
        model = model.with_effect(catalogue()[name])
    before = fit(model, table)
    return before if model.holds(effect) else refit(before, before.model.with_effect(catalogue()[effect]))


def _values(found: Fit) -> Iterator[tuple[Key, float]]:
    for term in found.model.terms:
        yield from (((term.name, e.name, e.axis), e.value) for e in term.estimates)


def _intervals(found: Fit, truth: dict[Key, float], added: str) -> Iterator[Interval]:
    """Of the parameters that are identified, and whose truth is known."""
    for term in found.model.terms:
        for e in term.estimates:
            key = (term.name, e.name, e.axis)
            if e.identified and e.std and key in truth:
                yield Interval(term.name, (e.value - truth[key]) / e.std, term.name == added)


def _chosen(columns: rigs.Table) -> dict[str, Array]:
    return {name: values[::EVERY] for name, values in columns.items() if values.dtype.kind in "fi"}


@dataclass(frozen=True)
class Cause:
    """A law of `sampled`, and the truth of the parameters that mean the same in the catalogue."""

    law: sampled.Cause
    truth: Callable[[Array, sampled.Sweep], dict[Key, float]]


def _linear(v: Array, poses: sampled.Sweep, more_v: Array | float = 0.0) -> dict[Key, float]:
    """Bias (with `more_v`) and scale factor, from outputs without noise."""
    found: dict[Key, float] = {}
    for k, axis in enumerate("xy"):
        scale, bias = np.polyfit(poses.a[:, k], v[:, k], 1)
        added = float(np.broadcast_to(more_v, 2)[k])
        found |= {("bias", "bias", axis): float(bias) + added, ("scale-factor", "scale", axis): float(scale)}
    return found


def _drifting(v: Array, poses: sampled.Sweep) -> dict[Key, float]:
    rates = RAMP_V_PER_H * np.array([1.0, -0.7])
    middle_h = np.ptp(poses.t_s) / 2 / 3600
    return _linear(v, poses, rates * middle_h) | {
        ("bias-drift", "slope", a): float(r) for a, r in zip("xy", rates, strict=True)
    }


def _stuck(v: Array, poses: sampled.Sweep) -> dict[Key, float]:
    return _linear(v, poses) | {("dead-zone", "width", axis): WIDTH_G for axis in "xy"}


def _warm(v: Array, poses: sampled.Sweep) -> dict[Key, float]:
    mean_k = float(np.mean(poses.temperature_c)) - 24
    slopes = {("temperature-bias", "slope", a): float(s) for a, s in zip("xy", SLOPE_V_PER_K, strict=True)}
    return _linear(v, poses, SLOPE_V_PER_K * mean_k) | slopes


def _by_warmth(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    return v + np.outer(poses.temperature_c - 24, SLOPE_V_PER_K)


CAUSES = {
    "bias-drift": Cause(sampled.ramp(RAMP_V_PER_H), _drifting),
    "temperature-bias": Cause(_by_warmth, _warm),
    "z-axis-bias": Cause(lambda v, poses, random: v, _linear),  # none: what was not missing
}
KEPT = float(np.exp(-2 * np.pi * sampled.CORNER_HZ / sampled.RATE_HZ))
FLOOR_V = sampled.NOISE_V * np.sqrt((1 + KEPT) / (1 - KEPT) / sampled.SAMPLES)


def _flicker(t_s: Array, random: np.random.Generator) -> Array:
    """1/f down to a sixteenth of the record's lowest frequency."""
    n, times = len(t_s), 16
    f = np.fft.rfftfreq(times * n, float(np.median(np.diff(t_s))))[1:]
    shape = np.concatenate([[0.0], 1 / np.sqrt(f)])
    inside = np.concatenate([[False], f >= 1 / np.ptp(t_s)])
    waves = shape * (random.standard_normal((2, len(shape))) + 1j * random.standard_normal((2, len(shape))))
    rms = np.sqrt(4 * np.sum(shape[inside] ** 2)) / (times * n)
    return np.asarray(np.fft.irfft(waves, times * n)[:, 5 * n : 6 * n].T / rms)


def _walk(t_s: Array, random: np.random.Generator) -> Array:
    """From zero at the beginning: the bias is that of the beginning."""
    return np.asarray(np.cumsum(random.standard_normal((len(t_s), 2)), axis=0) / np.sqrt(len(t_s) / 6))


def _autoregressive(t_s: Array, random: np.random.Generator) -> Array:
    """Gauss and Markov's, with a time constant of a twentieth to a third of the record."""
    kept = np.exp(-np.median(np.diff(t_s)) / (np.ptp(t_s) * np.exp(random.uniform(np.log(1 / 20), np.log(1 / 3)))))
    x = np.empty((len(t_s), 2))
    x[0] = random.standard_normal(2)
    for k in range(1, len(x)):
        x[k] = kept * x[k - 1] + np.sqrt(1 - kept**2) * random.standard_normal(2)
    return x


SLOW = {"flicker": _flicker, "random walk": _walk, "Gauss-Markov": _autoregressive}
