"""`python -m tests.benchmark.examiner FOLDER [--seed N]`: 186 sensors with hidden causes, in a folder.

Then `python -m tests.benchmark.hidden --folder FOLDER` scores the shipped search on them. The sets: each form of each
cause once, 30 sensors without a cause, each unknown mechanism twice, 30 pairs, 24 triples, 16 sensors with five causes,
8 with eight.
"""

from __future__ import annotations

import argparse
import gzip
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from tests.benchmark.examiner import electronics, loops, responses, slow, stages, unknown
from tests.benchmark.examiner.cause import Cause
from tests.benchmark.examiner.sets import draw_set

STRENGTHS = (3.0, 10.0, 30.0)  # white noise of a mean
CATALOGUE = (*stages.CAUSES, *responses.CAUSES, *loops.CAUSES, *slow.CAUSES, *electronics.CAUSES)
NAMES = tuple(dict.fromkeys(cause.name for cause in CATALOGUE))
Pairs = frozenset[frozenset[str]]

OVERLAPPING = frozenset(
    frozenset(pair)
    for pair in (
        ("base-tilt", "stage-zero-offset"),
        ("temperature-bias", "temperature-hysteresis"),
        ("warm-up-bias", "bias-drift"),
    )
)  # pairs that are never in a pair or a triple together: the same contribution or the same driver
COARSE = frozenset(
    frozenset(("quantisation", name)) for name in ("stage-backlash", "hysteresis", "vibration-rectification")
)  # the converter hides the other
COARSE_AMONG_MANY = COARSE | {
    frozenset(("quantisation", name)) for name in ("temperature-hysteresis", "stage-eccentricity")
}

Wanted = tuple[str, Sequence[Cause], float | None]  # kind, causes, strength


def wanted(random: np.random.Generator) -> Iterator[Wanted]:
    """Kind, causes and strength of every set."""
    strengths = random.permutation(np.repeat(STRENGTHS, len(CATALOGUE) // 3))
    for cause, strength in zip(CATALOGUE, strengths, strict=True):
        yield "single", [cause], float(strength)
    for _ in range(30):
        yield "null", [], 3.0
    for _ in range(2):
        strengths = random.permutation(np.repeat(STRENGTHS, len(unknown.CAUSES) // 3))
        for cause, strength in zip(unknown.CAUSES, strengths, strict=True):
            yield "unknown", [cause], float(strength)
    for kind, count, sets in (("pair", 2, 30), ("triple", 3, 24)):
        for i, causes in enumerate(combinations(random, sets, count, OVERLAPPING | COARSE)):
            yield kind, causes, STRENGTHS[i % len(STRENGTHS)]
    for kind, count, sets in (("many5", 5, 16), ("many8", 8, 8)):
        for causes in combinations(random, sets, count, COARSE_AMONG_MANY):
            yield kind, causes, None


def combinations(random: np.random.Generator, sets: int, count: int, apart: Pairs) -> Iterator[list[Cause]]:
    """Causes of different names in random forms, without the pairs `apart`.

    The names are a pack of cards from which each set takes the first that go together; a shuffled pack is added below
    when too few are left. So each name is about as frequent as the others.
    """
    pack: list[str] = []
    for _ in range(sets):
        while len(names := _first(pack, count, apart)) < count:
            pack += random.permutation(NAMES).tolist()
        for name in names:
            pack.remove(name)
        forms = [[cause for cause in CATALOGUE if cause.name == name] for name in names]
        yield [choice[int(random.integers(len(choice)))] for choice in forms]


def _first(pack: Sequence[str], count: int, apart: Pairs) -> list[str]:
    """The first `count` different names of the pack that may be together, or fewer if it has no more."""
    names: list[str] = []
    for name in pack:
        if name not in names and not any(frozenset((name, other)) in apart for other in names):
            names.append(name)
        if len(names) == count:
            break
    return names


def write(folder: Path, sets: Sequence[Wanted], random: np.random.Generator) -> None:
    """`sets/KIND-NUMBER.csv.gz` and `truth.json`, each set with a seed from `random`."""
    (folder / "sets").mkdir(parents=True, exist_ok=True)
    truth = {}
    for number, (kind, causes, strength) in enumerate(sets):
        name = f"{kind}-{number:03d}"
        text, truth[name] = draw_set(kind, causes, strength, int(random.integers(1 << 31)))
        (folder / "sets" / f"{name}.csv.gz").write_bytes(gzip.compress(text.encode(), mtime=0))
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))


def main() -> None:
    """Write sets and truth."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=20261)
    options = parser.parse_args()
    random = np.random.default_rng(options.seed)
    write(options.folder, list(wanted(random)), random)


if __name__ == "__main__":
    main()
