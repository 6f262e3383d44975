"""Discovery on records of motion with a hidden cause: `python -m tests.benchmark.motion_discovery [SEEDS] [PROCESSES]`.

Else three seeds of each cause on two processes. A line a kind, as `tests.benchmark.hidden` prints it, and a line for
each wrong answer.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import calibrations as cal
from calibrations.table import Table
from tests.benchmark.hidden import Answer, Score, score, summary, timed
from tests.benchmark.shaking import LAYOUTS, MECHANISMS, OUTSIDE, UNKNOWN, measured, size_for

SEEDS, PROCESSES, LIMIT_S = 3, 2, 200
TIMES = (10.0, 3.0, 30.0)  # noise floors that the linear model leaves

Case = tuple[str, str, float, int]  # name, layout, noise floors, seed


def cases(seeds: int) -> Iterator[Case]:
    """Every cause with each seed; layouts and sizes in turn."""
    for seed in range(seeds):
        for name in (*MECHANISMS, *OUTSIDE, "null"):
            layout = list(LAYOUTS)[seed % 3]
            if name != "vibration-rectification" or layout == "rests and levels":  # else it is a bias
                yield name, layout, TIMES[(seed // 3 + seed) % 3], seed


def kind_of(case: Case) -> str:
    """As the sets of poses are called."""
    return "null" if case[0] == "null" else "unknown" if case[0] in OUTSIDE else "single"


def answered(case: Case) -> Score:
    """The answer of the search on one case."""
    name, layout, times, seed = case
    mechanism = {**MECHANISMS, **OUTSIDE}.get(name)
    acting = ((mechanism, size_for(mechanism, times, layout, seed)),) if mechanism else ()
    table: Table = measured(acting, layout, seed)

    def search(_: Path) -> Answer:
        found = cal.discover(table, "linear")
        return Answer(str(found.verdict), found.causes, found.alternatives, found.end.held_out_excess)

    truth = [mechanism.cause] if mechanism and mechanism.cause != UNKNOWN else []
    return score(f"{name}, {layout}, {times:g}, {seed}", truth, *timed(search, Path(table.source), LIMIT_S))


def main() -> None:
    seeds, processes = (int(a) for a in [*sys.argv[1:], *map(str, (SEEDS, PROCESSES)[len(sys.argv) - 1 :])])
    every = list(cases(seeds))
    by_kind: dict[str, list[Score]] = {}
    with ProcessPoolExecutor(processes) as pool:
        for case, each in zip(every, pool.map(answered, every), strict=True):
            by_kind.setdefault(kind_of(case), []).append(each)
            if not each.is_good(kind_of(case)):
                print(f"{each.name}: {each.answer}", flush=True)
    for kind, scores in by_kind.items():
        print(summary(kind, scores))


if __name__ == "__main__":
    main()
