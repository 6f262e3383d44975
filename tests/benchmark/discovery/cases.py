"""Any set of the benchmark again: `case(name, strength, seed)` gives its table and what is true of it.

clean/white  clean/slow            nothing is hidden; slow noise equal to white
own/NAME  world/NAME  sampled/NAME one cause, by this folder's rigs or one of the other two generators
pair  triple                       two or three of this folder's
outside/NAME  world/NAME           what no effect describes
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calibrations.table import Table
from tests.benchmark.discovery import noises
from tests.benchmark.discovery.inseparable import INSEPARABLE
from tests.benchmark.discovery.layouts import Array
from tests.benchmark.discovery.mechanisms import MECHANISMS, few_bits, rounded
from tests.benchmark.discovery.outside import OUTSIDE
from tests.benchmark.discovery.rig import Built, Mechanism, Run, layout_of, sized, unabsorbed, volts

STRENGTHS = {"faint": 0.3, "weak": 3.0, "medium": 10.0, "strong": 30.0}
SLOW = (0.0, 0.0, 0.5, 1.0)  # of the white noise, in turn


@dataclass(frozen=True)
class Truth:
    """What is true of a table: causes (names that describe each), the noise, and the output without noise.

    `clean_v` (n, 2) at the table's rows; `parts` (n, 2) what each cause adds there, beyond bias and scale factor.
    `fresh`: the outputs without noise at all visits, the table's rows and others in between; None where only the
    table's own poses are known.
    """

    causes: tuple[frozenset[str], ...]
    floor_v: float
    slow: float = 0.0
    covariance: Array | None = None  # of the slow noise, of unit variance
    clean_v: Array | None = None
    parts: tuple[Array, ...] = ()
    fresh: Table | None = None
    outside: bool = False
    structure: str = ""
    experiment: str = ""  # a regular expression: what would tell the cause from the names it is taken for
    layout: str = ""
    run: Run | None = None
    built: tuple[tuple[str, Built], ...] = ()

    @cached_property
    def root(self) -> Array:
        """Cholesky factor of the noise of one axis, shape (n, n)."""
        n = len(self.clean_v) if self.clean_v is not None else 0
        slow = 0.0 if self.covariance is None else self.slow**2 * self.covariance
        return np.asarray(np.linalg.cholesky(self.floor_v**2 * (np.eye(n) + slow)))


def case(name: str, strength: float = 0.0, seed: int = 0) -> tuple[Table, Truth]:
    """The table and the truth of one set; `strength` in noise floors."""
    kind, _, which = name.partition("/")
    if kind in ("world", "sampled"):
        from tests.benchmark.discovery import others  # made of this file's Truth

        return others.case(kind, which, strength, seed)
    if kind == "inseparable":
        question = INSEPARABLE[which]
        run = Run(question.layout or layout_of(seed), seed, question.mechanism.cold, question.room)
        table, truth = measured(run, {which: question.mechanism}, strength, 0.0)
        return table, replace(truth, experiment=question.experiment)
    if kind == "clean":
        return measured(Run(layout_of(seed), seed), {}, 0.0, 1.0 if which == "slow" else 0.0)
    slow = SLOW[(seed // 4 + seed) % len(SLOW)]
    names = [which] if which else several(kind, seed)
    found = {one: (MECHANISMS | OUTSIDE)[one] for one in names}
    run = Run(layout_of(seed), seed, cold=any(m.cold for m in found.values()))
    return measured(run, found, strength, slow)


def several(kind: str, seed: int) -> list[str]:
    """Names of two or three causes of different effects, none of which can take the place of another by itself."""
    random = np.random.default_rng([seed, 2 if kind == "pair" else 3])
    while True:
        names = [str(name) for name in random.choice(list(MECHANISMS), 2 if kind == "pair" else 3, replace=False)]
        effects = {next(iter(MECHANISMS[name].names)) for name in names}
        if len(effects) == len(names) and not any(len(effects & group) > 1 for group in TOO_LIKE):
            return names


TOO_LIKE = (  # two of one group are a question for another experiment
    {"axis-misalignment", "stage-zero-offset", "base-tilt", "axis-nonorthogonality"},
    {"quadratic-nonlinearity", "cross-axis-bias", "z-axis-bias", "adc-nonlinearity"},
    {"warm-up-bias", "bias-drift", "temperature-bias", "temperature-hysteresis"},
    {"cubic-nonlinearity", "odd-quadratic-nonlinearity", "adc-nonlinearity", "saturation"},
    {"warm-up-scale", "temperature-scale"},
)


def measured(run: Run, found: dict[str, Mechanism], strength: float, slow: float) -> tuple[Table, Truth]:
    """What the rig gives with these mechanisms, each of `strength` noise floors."""
    built = tuple((name, sized(run, name, m, strength * run.floor_v)) for name, m in found.items())
    given, every = run.visits.given, [b for _, b in built]
    clean = volts(run, every)
    parts = [unabsorbed(run, clean - volts(run, [b for b in every if b is not one])) for one in every]
    noise = _slow(run, slow)
    random = run.draw("white")
    noisy = clean + run.floor_v * (slow * noise.values + random.standard_normal(clean.shape))
    std = _std(run, every, clean)
    outside = any(not m.names for m in found.values())
    truth = Truth(
        causes=tuple(m.names for m in found.values() if m.names),
        floor_v=run.floor_v,
        slow=slow,
        covariance=noise.covariance[np.ix_(given, given)],
        clean_v=clean[given],
        parts=tuple(part[given] for part in parts),
        fresh=_table(run, every, clean, std),
        outside=outside,
        structure=next((m.structure for m in found.values() if m.structure), ""),
        layout=run.layout,
        run=run,
        built=built,
    )
    return _table(run, every, noisy, std).rows(given), truth


def _slow(run: Run, slow: float) -> noises.Slow:
    random = run.draw("slow")
    make = noises.KINDS[int(random.integers(len(noises.KINDS)))] if slow else noises.none
    return make(run.t_s, random)


def _std(run: Run, built: Sequence[Built], clean: Array) -> Array:
    """Standard deviation of the samples of each dwell, as a technician's script would write it, shape (n, 2)."""
    std = np.full(clean.shape, run.noise_of_sample_v)
    for b in built:
        if b.mechanism.change is few_bits:
            std = rounded(volts(run, [o for o in built if o is not b]), run, b.size)[1]
    n = run.sampling[2]
    return std * (1 + run.draw("std").standard_normal(std.shape) / np.sqrt(n / 8))


def _table(run: Run, built: Sequence[Built], v: Array, std: Array) -> Table:
    rate_hz, corner_hz, n = run.sampling
    random, visits = run.draw("columns"), run.visits
    columns: dict[str, NDArray[np.float64]] = {
        "alpha_deg": visits.alpha_deg,
        "beta_deg": visits.beta_deg,
        "direction": visits.direction,
        "t_s": run.t_s,
        "temperature_c": _thermometer(run),
        "vx_v": v[:, 0],
        "vy_v": v[:, 1],
        "vx_std_v": std[:, 0],
        "vy_std_v": std[:, 1],
        "n": np.full(len(v), float(n)),
    }
    if random.random() < 0.4 or any(b.mechanism.supply for b in built):
        columns["supply_v"] = np.round(run.supply_v + 5e-5 * random.standard_normal(len(v)), 4)
    constants = {"sample_rate_hz": rate_hz, "filter_corner_hz": corner_hz}
    return Table.from_columns("poses", columns, constants, f"{run.layout} {run.seed}")


def _thermometer(run: Run) -> Array:
    """A thermometer beside the sensor: it lags by a few seconds, and has noise and a resolution."""
    r, c = run.draw("thermometer"), run.temperature_c
    lagged = np.interp(run.t_s - r.uniform(2, 8), run.t_s, c)
    return np.round(lagged + 0.005 * r.standard_normal(len(c)), 3)
