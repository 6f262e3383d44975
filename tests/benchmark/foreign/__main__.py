"""`python -m tests.benchmark.foreign FOLDER [--seed N] [--sets K]`: sensors with hidden causes, in a folder.

Then `python -m tests.benchmark.hidden --folder FOLDER` scores the shipped search on them. `--sets` is the number of
each kind but `single`, which has each form of each cause at three sizes.
"""

from __future__ import annotations

import argparse
import gzip
import json
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import numpy as np

from tests.benchmark.foreign.causes import CATALOGUE, UNKNOWN, Cause
from tests.benchmark.foreign.sensor import table

STRENGTHS = (3.0, 10.0, 30.0)  # noise of a mean
MANY = {"pair": 2, "triple": 3, "many5": 5, "many8": 8}


def wanted(random: np.random.Generator, sets: int) -> Iterator[tuple[str, list[Cause], list[float]]]:
    """Kind, causes and sizes of every set."""
    for strength, cause in product(STRENGTHS, CATALOGUE):
        yield "single", [cause], [strength]
    for _ in range(sets):
        yield "null", [], []
    for i in range(sets):
        yield "unknown", [UNKNOWN[i % len(UNKNOWN)]], [STRENGTHS[i // len(UNKNOWN) % 3]]
    names = sorted({c.name for c in CATALOGUE})
    for kind, count in MANY.items():
        for i in range(sets):
            chosen = random.choice(names, count, replace=False)
            forms = [random.choice([j for j, c in enumerate(CATALOGUE) if c.name == name]) for name in chosen]
            sizes = np.exp(random.uniform(np.log(3), np.log(300), count)) if count > 3 else [STRENGTHS[i % 3]] * count
            yield kind, [CATALOGUE[j] for j in forms], [float(s) for s in sizes]


def main() -> None:
    """Write sets and truth."""
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folder", type=Path)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--sets", type=int, default=24)
    given = asked.parse_args()
    (given.folder / "sets").mkdir(parents=True, exist_ok=True)
    truth = {}
    for number, (kind, causes, sizes) in enumerate(wanted(np.random.default_rng(given.seed), given.sets)):
        random = np.random.default_rng([given.seed, number])
        slow = float(random.uniform(0.0, 0.6))
        name = f"{kind}-{number:03d}"
        with gzip.open(given.folder / "sets" / f"{name}.csv.gz", "wt") as file:
            file.write(table(random, causes, sizes, slow))
        names = [c.name for c in causes] if kind != "unknown" else ["not in the catalogue"]
        truth[name] = {"kind": kind, "causes": names, "sizes": sizes, "slow_over_white": slow,
                       "forms": [(CATALOGUE + UNKNOWN).index(c) for c in causes]}  # fmt: skip
    (given.folder / "truth.json").write_text(json.dumps(truth, indent=1))


if __name__ == "__main__":
    main()
