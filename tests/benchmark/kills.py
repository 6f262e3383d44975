"""Kills at random moments that runs survived: `python -m tests.benchmark.kills [KILLS] [SEED]`; 500 take some minutes.

A third of them come to a sweep, the rest to a soak and a motion, which are records without gaps, to a misalignment,
which chooses its poses by what it measured, and to positions by hand.

Each is checked as in tests/rig/test_kill.py; the first that costs more than the pose in flight ends it with an error.
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.rig.killing import HANDS, MISALIGNMENT, MOTION, RUN, SOAK, many, undisturbed
from tests.rig.nursery import Nursery


def main(kills: int = 500, seed: int = 1000) -> None:
    with TemporaryDirectory() as folder, Nursery() as nursery:
        began, kinds, procedures = time.perf_counter(), Counter[str](), {}
        for words, share in ((RUN, 0.36), (SOAK, 0.16), (MOTION, 0.16), (MISALIGNMENT, 0.16), (HANDS, 0.16)):
            place = Path(folder) / words[1]
            survived = many(nursery, place, undisturbed(nursery, place, words), seed, round(share * kills))
            procedures[words[1]] = survived.total()
            kinds += survived
        seconds = time.perf_counter() - began
    print(json.dumps({"seconds": [seconds], "kills": kinds.total(), "kinds": dict(kinds), "procedures": procedures}))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
