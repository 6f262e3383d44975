"""Kills at random moments that runs survived: `python -m tests.benchmark.kills [KILLS] [SEED]`; 500 take two minutes.

Each is checked as in tests/rig/test_kill.py; the first that costs more than the pose in flight ends it with an error.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.rig.killing import many, undisturbed
from tests.rig.nursery import Nursery


def main(kills: int = 500, seed: int = 1000) -> None:
    with TemporaryDirectory() as folder, Nursery() as nursery:
        whole = undisturbed(nursery, Path(folder))
        began = time.perf_counter()
        survived = many(nursery, Path(folder), whole, seed, kills)
        seconds = time.perf_counter() - began
    print(json.dumps({"seconds": [seconds], "kills": survived.total(), "kinds": dict(survived)}))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
