"""Inputs tried on every decoder and reader: `python -m tests.benchmark.fuzz [INPUTS] [PROCESSES]`; else ten million.

Each target gets its share by weight, heavy ones less. An error that is not documented, an input that takes longer than
LONGEST_S, or a process beyond MOST_BYTES ends it with the input that did it.
"""

from __future__ import annotations

import atexit
import json
import os
import resource
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass

from tests.fuzz.files import remove
from tests.fuzz.mutation import mutated
from tests.fuzz.targets import TARGETS

AT_ONCE = 20_000  # inputs of one task
LONGEST_S = 5.0  # of processor time for one input
MOST_BYTES = 4 << 30


@dataclass(frozen=True)
class Tried:
    """What became of some inputs of one target."""

    name: str
    inputs: int
    taken: int
    longest_s: float


def tried(name: str, seed: int, count: int) -> Tried:
    """Try so many inputs; raises what is not documented, with the input."""
    warnings.simplefilter("error")
    resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    atexit.register(remove)
    target, taken, longest_s = TARGETS[name], 0, 0.0
    for data in mutated(target.seeds, seed, count):
        began = time.process_time()
        try:
            target.take(data)
            taken += 1
        except target.errors:
            pass
        except BaseException as error:
            raise AssertionError(f"{name}, {data!r}: {type(error).__name__}: {error}") from error
        longest_s = max(longest_s, time.process_time() - began)
        if longest_s > LONGEST_S:
            raise AssertionError(f"{name}, {data!r}: takes {longest_s:.1f} s")
    return Tried(name, count, taken, longest_s)


def tasks(inputs: int) -> list[tuple[str, int, int]]:
    """(target, seed, inputs) for all of them, in pieces."""
    whole = sum(target.weight for target in TARGETS.values())
    shares = {name: max(1, round(inputs * target.weight / whole)) for name, target in TARGETS.items()}
    return [
        (name, 1 + first // AT_ONCE, min(AT_ONCE, share - first))
        for name, share in shares.items()
        for first in range(0, share, AT_ONCE)
    ]


def main(inputs: int = 10_000_000, processes: int = os.cpu_count() or 1) -> None:
    began, done = time.perf_counter(), []
    with ProcessPoolExecutor(processes) as pool:
        for future in as_completed([pool.submit(tried, *task) for task in tasks(inputs)]):
            done.append(future.result())
    targets = {
        name: {
            "inputs": sum(each.inputs for each in done if each.name == name),
            "taken": sum(each.taken for each in done if each.name == name),
            "longest_ms": round(1e3 * max(each.longest_s for each in done if each.name == name), 1),
        }
        for name in TARGETS
    }
    total = sum(target["inputs"] for target in targets.values())
    seconds = round(time.perf_counter() - began, 1)
    print(json.dumps({"inputs": total, "seconds": seconds, "undocumented": 0, "targets": targets}, indent=1))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
