"""Live discovery beside the standard sweep, on rigs with one hidden defect: `python -m tests.benchmark.live [SEEDS]`.

Both are on the same rig (`tests/hidden/rigs.py`, ten times the noise of a dwell). An answer is right that names the
defect's effect and no other cause. Rig time is that of the plans.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import dataclass
from statistics import median
from typing import Any

from calibrations.discovery.results import Discovery
from calibrations.effects.catalogue import catalogue
from calibrations.loop import discover
from calibrations.model.file import read_model
from drivers.world.config import WorldConfig
from rig.bench import read_bench
from rig.runs.live import STANDARD, Live, is_confirmed
from tests.hidden import rigs
from tests.hidden.defects import DEFECTS
from tests.hidden.quick_rig import QuickRig
from tests.hidden.test_hidden_defects import NAMES

TIMES_NOISE = 10.0


@dataclass(frozen=True)
class Case:
    """One rig, discovered both ways."""

    defect: str
    seed: int
    live: bool  # right
    stands: bool
    standard: bool  # right
    times_less: float
    causes: tuple[str, ...]


def compared(defect: str, seed: int) -> Case:
    """A rig with `defect`, discovered live and by the standard sweep."""
    bench, model, effects = read_bench(None), read_model("linear"), catalogue()
    config: WorldConfig = rigs.scaled(DEFECTS[defect], rigs.IDEAL, seed, TIMES_NOISE * rigs.noise_floor_v())
    live = Live(bench, None, model, effects, 0.0, QuickRig(config, seed, bench).measure)
    standard_s = live.planned(STANDARD).duration_s or 0.0
    live = Live(bench, None, model, effects, standard_s, live.measure)
    done = list(live.measurements())
    _, table = QuickRig(config, seed, bench).measure(STANDARD)
    found = done[-1].discovery
    standard = is_right(defect, discover(table, model, effects))
    return Case(
        defect, seed, is_right(defect, found), is_confirmed(done), standard, standard_s / done[-1].used_s, found.causes
    )


def is_right(defect: str, found: Discovery) -> bool:
    """One cause, an effect that describes the mechanism, or one that no data of this kind tells from it."""
    names = {name for cause in found.causes for name in (cause, *found.alternatives.get(cause, ()))}
    return len(found.causes) == 1 and bool(names & NAMES[defect])


def figures(cases: list[Case]) -> dict[str, Any]:
    """Shares of right answers, and how many times less rig time, where both are right."""
    both = [case.times_less for case in cases if case.live and case.standard]
    return {
        "cases": len(cases),
        "live_right": sum(case.live for case in cases) / len(cases),
        "standard_right": sum(case.standard for case in cases) / len(cases),
        "stands": sum(case.stands for case in cases) / len(cases),
        "times_less_rig_time": {"median": round(median(both), 2), "least": round(min(both), 2)},
        "wrong": [[case.defect, case.seed, list(case.causes)] for case in cases if not case.live],
    }


def main(seeds: int = 1) -> None:
    began = time.perf_counter()
    cases = [compared(defect, seed) for seed in range(1, seeds + 1) for defect in NAMES]
    print(json.dumps({"seconds": [time.perf_counter() - began], **figures(cases)}))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
