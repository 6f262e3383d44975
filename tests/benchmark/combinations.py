"""Discovery on random combinations: `python -m tests.benchmark.combinations [SETS] [PROCESSES] [FIRST]`.

Else 2,000 sets from seed 0 on two processes. A set has up to eight causes of 1 to 300 times the noise of a mean, on any
layout of poses; columns, constants and rows are missing at random. Each ends in an answer that can be written as JSON,
or in a refusal of the library: else the set's seed and the error are printed, and the exit code is 1.
"""

from __future__ import annotations

import json
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np

import calibrations as cal
from calibrations.errors import CalibrationError
from calibrations.table import Table
from tests.benchmark.discovery.cases import MECHANISMS, measured
from tests.benchmark.discovery.layouts import LAYOUTS
from tests.benchmark.discovery.outside import OUTSIDE
from tests.benchmark.discovery.rig import Mechanism, NotShown, Run

SETS, PROCESSES, FIRST = 2_000, 2, 0
MOST_CAUSES = 8
OPTIONAL = (("t_s",), ("temperature_c",), ("vx_std_v", "vy_std_v"), ("n",), ("direction",), ("supply_v",))
MISSING = 0.2  # chance of each column and constant


@dataclass(frozen=True)
class Ended:
    """How one set ended: its verdict, the class of its refusal, or "error" with what was raised."""

    seed: int
    outcome: str
    took_s: float
    error: str = ""


def combination(seed: int) -> Table:
    """The table of one seed."""
    random = np.random.default_rng([seed, 81])
    every = MECHANISMS | OUTSIDE
    while True:
        names = [str(n) for n in random.choice(list(every), random.integers(MOST_CAUSES + 1), replace=False)]
        found: dict[str, Mechanism] = {name: every[name] for name in names}
        run = Run(str(random.choice(list(LAYOUTS))), int(random.integers(2**31)), any(m.cold for m in found.values()))
        try:
            table, _ = measured(
                run, found, float(10 ** random.uniform(0.0, 2.5)), float(random.choice([0.0, 0.5, 1.0]))
            )
        except NotShown:  # one of them has no such size on this layout
            continue
        return _with_gaps(table, random)


def _with_gaps(table: Table, random: np.random.Generator) -> Table:
    """The table without some of its rows, columns and constants."""
    columns = {name: np.array(values) for name, values in table.columns.items()}
    for names in OPTIONAL:
        if random.random() < MISSING:
            columns = {name: values for name, values in columns.items() if name not in names}
    if random.random() < MISSING:
        columns = {name: values for name, values in columns.items() if not name.startswith("vy_")}
    if random.random() < MISSING:
        name = str(random.choice([name for name in columns if not name.startswith("v")]))
        columns[name] = np.full(table.n, columns[name][0])
    rows = np.arange(table.n)
    if random.random() < MISSING:
        rows = np.sort(random.choice(table.n, int(random.integers(3, table.n + 1)), replace=False))
    constants = {name: value for name, value in table.constants.items() if random.random() > MISSING}
    return Table.from_columns("poses", {k: v[rows] for k, v in columns.items()}, constants, table.source)


def ended(seed: int) -> Ended:
    """The search on one set."""
    table, began = combination(seed), time.process_time()

    def took_s() -> float:
        return time.process_time() - began

    try:
        found = cal.discover(table, "linear")
        json.dumps(found.to_dict(), allow_nan=False)
    except CalibrationError as error:
        return Ended(seed, type(error).__name__, took_s(), str(error))
    except Exception:
        return Ended(seed, "error", took_s(), traceback.format_exc())
    return Ended(seed, str(found.verdict), took_s())


def tried(seeds: Iterable[int], processes: int, told: Callable[[Ended], None]) -> list[Ended]:
    """All seeds; `told` hears of each as it ends."""
    found = []
    with ProcessPoolExecutor(processes) as pool:
        for each in pool.map(ended, seeds):
            told(each)
            found.append(each)
    return found


def _told(each: Ended) -> None:
    if each.outcome == "error":
        print(f"seed {each.seed}: {each.error}", flush=True)


def main() -> None:
    sets, processes, first = (int(a) for a in [*sys.argv[1:], *map(str, (SETS, PROCESSES, FIRST)[len(sys.argv) - 1 :])])
    found = tried(range(first, first + sets), processes, _told)
    for outcome, count in Counter(each.outcome for each in found).most_common():
        print(f"{count:6} {outcome}")
    for refused in {each.error for each in found if each.error and each.outcome != "error"}:
        print(refused)
    seconds = sorted(each.took_s for each in found)
    print(f"median {seconds[len(seconds) // 2]:.1f} s of processor time, longest {seconds[-1]:.1f} s")
    sys.exit(any(each.outcome == "error" for each in found))


if __name__ == "__main__":
    main()
