"""Kills at random moments that runs survived: `python -m tests.benchmark.kills [KILLS] [SEED]`.

A third of them come to a sweep, the rest to a soak and a motion, which are records without gaps, to a misalignment,
which chooses its poses by what it measured, to the procedures by hand, to imports, and to pushes to PostgreSQL.
Each of these is killed at least once, and reports its count on standard error when it has ended. Before the first kill
come the warm-up and two undisturbed runs of each procedure; on a busy machine these take minutes.

Each is checked as in tests/rig/test_kill.py; the first that costs more than the pose in flight ends it with an error.
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from rig.lab_url import lab_url
from rig.record.lab import prepare
from tests.rig.killing import FIELDS, MISALIGNMENT, MOTION, POSITIONS, RUN, SOAK, TURNS, many, undisturbed
from tests.rig.killing_transfers import kills_of_a_push, kills_of_imports
from tests.rig.nursery import Nursery
from tests.rig.postgres import serving

RUNS = (  # and shares of the kills
    (RUN, 0.32),
    (SOAK, 0.12),
    (MOTION, 0.12),
    (MISALIGNMENT, 0.12),
    (POSITIONS, 0.08),
    (FIELDS, 0.06),
    (TURNS, 0.06),
)
IMPORTS, PUSHES = 0.06, 0.06
A_PUSH = 6  # kills, until it is let through


def main(kills: int = 500, seed: int = 1000) -> None:
    with TemporaryDirectory() as temporary, Nursery() as nursery:
        folder, began, survived = Path(temporary), time.perf_counter(), dict[str, Counter[str]]()
        for words, share in RUNS:
            place = folder / words[1]
            whole = undisturbed(nursery, place, words)
            survived[words[1]] = many(nursery, place, whole, seed, number(share, kills))
            print(f"{words[1]}: {survived[words[1]].total()} kills", file=sys.stderr)
        survived["import"] = kills_of_imports(nursery, folder / "imports", seed, number(IMPORTS, kills))
        survived["push"] = pushes(nursery, folder / "pushes", seed, number(PUSHES, kills))
        seconds = time.perf_counter() - began
    kinds = sum(survived.values(), Counter[str]())
    counts = {name: count.total() for name, count in survived.items()}
    print(json.dumps({"seconds": [seconds], "kills": kinds.total(), "kinds": dict(kinds), "procedures": counts}))


def number(share: float, kills: int) -> int:
    """How many of the kills are this share: at least one."""
    return max(1, round(share * kills))


def pushes(nursery: Nursery, folder: Path, seed: int, kills: int) -> Counter[str]:
    """Kill pushes, to a new lab after every A_PUSH kills."""
    survived = Counter[str]()
    with serving() as server:
        while survived.total() < kills:
            url, round_seed = server.url(server.new_database()), seed + survived.total()
            prepare(lab_url(url))
            survived += kills_of_a_push(nursery, url, folder / str(round_seed), round_seed, A_PUSH)
    return survived


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
