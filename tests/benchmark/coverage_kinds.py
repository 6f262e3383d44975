"""How often 95 % intervals hold the truth: `python -m tests.benchmark.coverage_kinds [INTERVALS]`, else 200 of each.

Bias and scale factor of every kind of data, under flicker of 0, 0.7 and 1.7 times the white noise of a mean (of motion:
of the mean of a stretch); of poses also after a discovery has chosen the model, from the linear one, for a sensor with
one hidden cause. A still record has neither; `tests.benchmark.noise` has the intervals of its coefficients. Sensors are
drawn from plain laws written out here or in `tests`; none of their formulas is the library's.

The truth after a discovery is what the chosen model has on the same data without noise: the meaning of a bias depends
on the model that it is in. Where these data tell it less exactly than the answer claims, there is no truth: the bias
beside a warm-up that was chosen for a straight drift is that of a time without end.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from calibrations.effects.catalogue import catalogue
from calibrations.fitting.fit import Fit, fit
from calibrations.loop import discover
from calibrations.model.file import read_model
from calibrations.table import Array, Table
from tests.benchmark import shaking
from tests.hidden import sampled
from tests.hidden.intervals import EVERY, FLOOR_V, SLOW, SUFFICIENT

TIMES_WHITE = (0.0, 0.7, 1.7)
LEAST, MOST = 0.92, 0.98
DWELL_S, PERIOD_S, SAMPLES = 5.0, 12.0, 500
STRETCH_S = 2.0  # of a record of motion: the fit takes the means of its four quarters
WANTED = {"bias", "scale-factor", "gyro-bias", "gyro-scale-factor", "hard-iron", "field-strength"}
Made = tuple[Fit, dict[tuple[str, str], float]]  # a fit, and the truth by effect and axis


@dataclass(frozen=True)
class Share:
    """The intervals of one kind under one noise that hold the truth."""

    kind: str
    times_white: float
    share: float
    intervals: int

    @property
    def met(self) -> bool:
        """Whether the demand is met."""
        return LEAST <= self.share <= MOST


def _noise(times: float, t_s: Array, white: float, random: np.random.Generator) -> Array:
    """White noise and flicker of three outputs, shape (n, 3)."""
    slow = np.hstack([SLOW["flicker"](t_s, random), SLOW["flicker"](t_s, random)])[:, :3]
    return white * (random.standard_normal((len(t_s), 3)) + times * slow)


def _columns(names: str, outputs: Array, white: float, t_s: Array) -> dict[str, Array]:
    """Means, with the scatter of their samples, which are independent."""
    columns = dict(zip(names.split(), outputs.T, strict=True)) | {"t_s": t_s, "n": np.full(len(t_s), float(SAMPLES))}
    return columns | {f"{name}_std": np.full(len(t_s), white * np.sqrt(SAMPLES)) for name in names.split()}


def positions(seed: int, times: float) -> Made:
    """An accelerometer that a person turned to 48 positions: three biases, three scale factors."""
    random, t_s = np.random.default_rng([seed, 1]), PERIOD_S * np.arange(48)
    bias, scale, white = random.normal(0, 0.02, 3), random.normal(1, 0.01, 3), 3e-4
    outputs = bias + scale * Rotation.random(48, rng=random).as_matrix()[:, 2] + _noise(times, t_s, white, random)
    table = Table.from_columns("positions", _columns("ax ay az", outputs, white, t_s), {"unit": "g"}, "drawn")
    model = read_model("common-scale").with_effect(catalogue()["scale-factor"])
    truth = {("bias", a): float(b) for a, b in zip("xyz", bias, strict=True)}
    return fit(model, table), truth | {("scale-factor", a): float(k) for a, k in zip("xyz", scale, strict=True)}


def rates(seed: int, times: float) -> Made:
    """A gyroscope on a rate table: six faces at nine rates."""
    random = np.random.default_rng([seed, 2])
    up = np.repeat(np.vstack([np.eye(3), -np.eye(3)]), 9, axis=0)
    rate = np.tile([0.0, 20.0, -20.0, 50.0, -50.0, 90.0, -90.0, 140.0, -140.0], 6)
    t_s, white = PERIOD_S * np.arange(len(rate)), 0.02
    bias, scale = random.normal(0, 5, 3), random.normal(16, 0.3, 3)
    outputs = bias + scale * rate[:, None] * up + _noise(times, t_s, white, random)
    columns = _columns("gx gy gz", outputs, white, t_s) | dict(zip(("ax", "ay", "az"), up.T, strict=True))
    truth = {("gyro-bias", a): float(b) for a, b in zip("xyz", bias, strict=True)}
    truth |= {("gyro-scale-factor", a): float(k) for a, k in zip("xyz", scale, strict=True)}
    table = Table.from_columns("rates", columns | {"rate_deg_s": rate}, {"latitude_deg": 0.0}, "drawn")
    return fit(read_model("gyroscope"), table), truth


def fields(seed: int, times: float) -> Made:
    """A magnetometer beside a magnet, in 60 directions of a field of 48 uT: its offset and the field's strength."""
    random, t_s = np.random.default_rng([seed, 3]), PERIOD_S * np.arange(60)
    hard, strength, white = random.normal(0, 15, 3), random.normal(48, 1), 0.05
    outputs = hard + strength * Rotation.random(60, rng=random).as_matrix()[:, 2] + _noise(times, t_s, white, random)
    table = Table.from_columns("positions", _columns("mx my mz", outputs, white, t_s), {"unit": "uT"}, "drawn")
    truth = {("hard-iron", a): float(b) for a, b in zip("xyz", hard, strict=True)}
    model = read_model("field").with_effect(catalogue()["hard-iron"])
    return fit(model, table), truth | {("field-strength", ""): float(strength)}


def _swept(seed: int, times: float, cause: sampled.Cause | None = None) -> tuple[Table, Table]:
    """A sweep of 104 poses, and the same without noise."""
    exact = Table.from_columns("poses", _every(sampled.measured(seed, cause, noise_v=0.0)), KNOWN, "exact")

    def with_flicker(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
        before = v if cause is None else cause(v, poses, random)
        return before + times * FLOOR_V * SLOW["flicker"](poses.t_s, np.random.default_rng([seed, 5]))

    return Table.from_columns("poses", _every(sampled.measured(seed, with_flicker)), KNOWN, "drawn"), exact


def _every(table: Table) -> dict[str, Array]:
    return {name: values[::EVERY] for name, values in table.columns.items()}


def _values(found: Fit) -> dict[tuple[str, str], float]:
    return {(term.name, e.axis): e.value for term in found.model.terms for e in term.estimates if term.name in WANTED}


def _stds(found: Fit) -> dict[tuple[str, str], float]:
    return {
        (term.name, e.axis): e.std or np.inf
        for term in found.model.terms
        for e in term.estimates
        if term.name in WANTED
    }


def poses(seed: int, times: float) -> Made:
    """A linear sensor."""
    table, exact = _swept(seed, times)
    return fit(read_model("linear"), table), _values(fit(read_model("linear"), exact))


def motion(seed: int, times: float) -> Made:
    """A linear sensor on a shaker, in six attitudes, each with a rest."""
    table = shaking.measured((), "rests and levels", seed)
    grid_s = np.arange(table.column("t_s")[0], table.column("t_s")[-1] + 0.1, 0.1)
    slow = shaking.NOISE_V / np.sqrt(2 * STRETCH_S) * times * SLOW["flicker"](grid_s, np.random.default_rng([seed, 6]))
    added = {f"v{axis}_v": np.interp(table.column("t_s"), grid_s, slow[:, k]) for k, axis in enumerate("xy")}
    columns = {name: values + added.get(name, 0.0) for name, values in table.columns.items()}
    truth = {("bias", "x"): 2.51, ("bias", "y"): 2.48, ("scale-factor", "x"): 1.0, ("scale-factor", "y"): 1.02}
    return fit(read_model("linear"), replace(table, columns=columns)), truth


def _bent(v: Array, poses: sampled.Sweep, random: np.random.Generator) -> Array:
    """Each axis bends by 3 mV at 1 g, and hears the square of the other one."""
    return v + 3e-3 * poses.a**2 * np.array([1.0, -1.0]) + 2e-3 * poses.a[:, ::-1] ** 2


CAUSES = (None, _bent, sampled.ramp(1e-3))


def bent_in_flicker(seed: int) -> Table:
    """A bent sensor in flicker of 1.7 times the white noise."""
    return _swept(seed, 1.7, _bent)[0]


def ramp_in_flicker(seed: int) -> Table:
    """A sensor that drifts in a straight line, in flicker of 0.7 times the white noise."""
    return _swept(seed, 0.7, CAUSES[2])[0]


def discovered(seed: int, times: float) -> Made:
    """A sensor with no hidden cause, a bent one and a drifting one, in turn, by the model that a discovery chose."""
    table, exact = _swept(seed, times, CAUSES[seed % len(CAUSES)])
    end = discover(table, read_model("linear")).end
    without_noise = fit(end.model, exact)
    claimed, known = _stds(end), _stds(without_noise)
    return end, {key: value for key, value in _values(without_noise).items() if known[key] < claimed.get(key, 0.0)}


KINDS: dict[str, Callable[[int, float], Made]] = {
    "poses": poses,
    "positions": positions,
    "rates": rates,
    "fields": fields,
    "motion": motion,
    "poses, discovered": discovered,
}


def intervals(made: Made) -> Iterator[bool]:
    """Whether each interval holds the truth; of the parameters that the data determine."""
    found, truth = made
    for term in found.model.terms:
        for e in term.estimates:
            if e.identified and e.std and (term.name, e.axis) in truth:
                yield abs(e.value - truth[term.name, e.axis]) < SUFFICIENT * e.std


def measured(kind: str, times: float, count: int, first: int = 0) -> Share:
    """The share of at least `count` intervals."""
    held, seed = list[bool](), first
    while len(held) < count:
        held += intervals(KINDS[kind](seed, times))
        seed += 1
    return Share(kind, times, round(float(np.mean(held)), 4), len(held))


def main(count: int = 200, *kinds: str) -> None:
    """Print a line of JSON for each, and whether all are met."""
    each = []
    for kind in kinds or KINDS:
        for times in TIMES_WHITE:
            each.append(measured(kind, times, count))
            print(json.dumps({**each[-1].__dict__, "met": each[-1].met}), flush=True)
    print(json.dumps({"target": [LEAST, MOST], "met": all(one.met for one in each)}))


KNOWN = {"sample_rate_hz": sampled.RATE_HZ, "filter_corner_hz": sampled.CORNER_HZ}
if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 200, *sys.argv[2:])
