"""Wall time of a call, again and again in one process."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any


def seconds(call: Callable[[], Any], repeats: int) -> list[float]:
    """Time of each repeat. Call it once before, so that nothing is imported or compiled in the first."""
    taken = []
    for _ in range(repeats):
        began = time.perf_counter()
        call()
        taken.append(time.perf_counter() - began)
    return taken
