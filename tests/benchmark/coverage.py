"""How often 95 % intervals hold the truth, over 200 rigs of two generators, with an effect just added."""

from __future__ import annotations

import json
import sys
from typing import Any

from tests.hidden.intervals import of_rigs, share

NOISE = (
    ("flicker", 0.0),
    ("flicker", 0.7),
    ("flicker", 1.0),
    ("flicker", 1.7),
    ("Gauss-Markov", 1.0),
    ("random walk", 1.0),
)
LEAST, MOST = 0.92, 0.98  # of the intervals, pooled over parameters


def measured(rigs: int, noise: str, times: float) -> dict[str, Any]:
    """The share of the intervals that hold the truth, of all and of the effects just added."""
    found = of_rigs(rigs, noise, times)
    held, added = share(found), share([interval for interval in found if interval.added])
    numbers = {"share": round(held, 4), "share_of_added": round(added, 4), "intervals": len(found)}
    return {"noise": noise, "times_white": times, **numbers, "target": [LEAST, MOST], "met": LEAST <= held <= MOST}


def main(rigs: int) -> None:
    each = [measured(rigs, noise, times) for noise, times in NOISE]
    print(json.dumps({"rigs": rigs, "each": each, "met": all(one["met"] for one in each)}))


if __name__ == "__main__":
    main(int(sys.argv[1]))
