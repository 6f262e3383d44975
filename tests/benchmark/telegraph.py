"""Random telegraph noise in records: `python -m tests.benchmark.telegraph 20 200`.

Share of records (first number: of each kind) whose levels are recognised, and with the right number of them, by their
distance in standard deviations of the white noise and by the mean time at a level in samples; and records of other
noise (second number: of each kind) in which levels are named, which is false.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from calibrations.noise.analysis import analyse
from calibrations.noise.record import Samples, reduce_record
from calibrations.noise.telegraph import Telegraph
from tests.calibrations.hidden_noise import (
    RATE_HZ,
    SAMPLES,
    Array,
    Random,
    fractional,
    levels,
    relaxing,
    room,
    telegraph,
    traps,
    walk,
    white,
)

K = np.arange(SAMPLES)
STEPS, STAYS = (0.5, 1.0, 2.0, 4.0), (20.0, 60.0, 200.0, 600.0, 2000.0)
JUMPING: Mapping[str, tuple[Callable[[Random, float, float], Array], int]] = {  # (record, its levels)
    "two levels": (lambda r, step, stay: step * levels(r, SAMPLES, stay, 2), 2),
    "three levels": (lambda r, step, stay: step * levels(r, SAMPLES, stay, 3), 3),
    "four levels": (lambda r, step, stay: step * levels(r, SAMPLES, stay, 4), 4),
    "two traps": (
        lambda r, step, stay: step / 2 * (telegraph(r, SAMPLES, 2 * stay) + 2 * telegraph(r, SAMPLES, 2 * stay)), 4
    ),
}  # fmt: skip
OTHERS: Mapping[str, Callable[[Random], Array]] = {
    "white": white,
    "flicker of traps": lambda r: white(r) + r.uniform(0.2, 3.0) * traps(r),
    "flicker of differences": lambda r: white(r) + r.uniform(0.2, 3.0) * fractional(r),
    "random walk": lambda r: white(r) + 10 ** r.uniform(-2.5, -0.5) * np.cumsum(r.standard_normal(SAMPLES)),
    "random walk of rare steps": lambda r: white(r) + 10 ** r.uniform(-2.5, -0.5) * walk(r),
    "Gauss-Markov": lambda r: white(r) + 10 ** r.uniform(-0.5, 1.0) * relaxing(r, SAMPLES, 10 ** r.uniform(1.0, 3.3)),
    "Gauss-Markov and flicker": lambda r: white(r) + relaxing(r, SAMPLES, 10 ** r.uniform(1.0, 3.0)) + traps(r),
    "drift with temperature": lambda r: white(r) + r.uniform(0.3, 5.0) * room(r),
    "a few steps": lambda r: white(r) + _steps(r, 4),
    "many steps": lambda r: white(r) + _steps(r, 30),
    "steps and Gauss-Markov": lambda r: white(r) + _steps(r, 4) + relaxing(r, SAMPLES, 100.0),
    "hum and random walk": lambda r: white(r) + np.sin(0.03 * K) + 0.02 * walk(r),
}


def _steps(random: Random, most: int) -> Array:
    """Up to so many steps, of normal heights."""
    at = random.integers(0, SAMPLES, random.integers(1, most + 1))
    return np.sum([random.normal(0.0, 2.0) * (each < K) for each in at], axis=0)


def found(samples: Array) -> Telegraph | None:
    record = reduce_record([Samples("x", [samples], RATE_HZ, "V")], "made")
    return next(iter(analyse(record).search.telegraphs), None)


def figures(seeds: int, other_seeds: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """(kind of record, figures), one after another."""
    for name, (make, count) in JUMPING.items():
        for step in STEPS:
            for stay in STAYS:
                answers = [_jumping(make, step, stay, seed) for seed in range(seeds)]
                named = [len(answer.levels) for answer in answers if answer is not None]
                shares = {"recognised": len(named) / seeds, "right": named.count(count) / seeds}
                yield f"{name}, {step:g} apart, {stay:g} samples", {"records": seeds, **shares}
    for name, of in OTHERS.items():
        answers = [found(of(np.random.default_rng(seed))) for seed in range(other_seeds)]
        yield name, {"records": other_seeds, "false": other_seeds - answers.count(None)}


def _jumping(make: Callable[[Random, float, float], Array], step: float, stay: float, seed: int) -> Telegraph | None:
    random = np.random.default_rng(seed)
    return found(white(random) + make(random, step, stay))


def main() -> None:
    seeds, other_seeds = (*map(int, sys.argv[1:3]), *(20, 200)[len(sys.argv) - 1 :])
    said = {}
    for name, figure in figures(seeds, other_seeds):
        print(name, figure, file=sys.stderr, flush=True)
        said[name] = figure
    print(json.dumps({"schema": "rig.telegraph-benchmark/1", "records": said}, indent=1))


if __name__ == "__main__":
    main()
