"""Inputs tried on every decoder and reader: `python -m tests.benchmark.fuzz [INPUTS] [PROCESSES] [FILE]`.

Else ten million, on all processors. Each target gets its share by weight, heavy ones less. An error that is not
documented, an input that takes longer than LONGEST_S, or a process beyond MOST_BYTES ends it with the input that did
it. With a file, what was tried is kept there, and another run goes on from it.
"""

from __future__ import annotations

import atexit
import json
import os
import resource
import sys
import time
import warnings
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile

from tests.fuzz.files import remove
from tests.fuzz.mutation import mutated
from tests.fuzz.targets import TARGETS

AT_ONCE = 20_000  # inputs of one task
LONGEST_S = 5.0  # of processor time for one input
MOST_BYTES = 4 << 30
SHOWN_BYTES = 200


@dataclass(frozen=True)
class Tried:
    """What became of the inputs of one target that a seed gives."""

    name: str
    seed: int
    inputs: int
    taken: int
    longest_s: float

    @property
    def task(self) -> tuple[str, int, int]:
        return self.name, self.seed, self.inputs


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
            raise AssertionError(f"{_kept(name, data)}: {type(error).__name__}: {error}") from error
        longest_s = max(longest_s, time.process_time() - began)
        if longest_s > LONGEST_S:
            raise AssertionError(f"{_kept(name, data)}: takes {longest_s:.1f} s")
    return Tried(name, seed, count, taken, longest_s)


def _kept(name: str, data: bytes) -> str:
    """What an input is called: its beginning, and the file that has all of it."""
    with NamedTemporaryFile(prefix=f"{name}-", delete=False) as file:
        file.write(data)
    return f"{name}, {data[:SHOWN_BYTES]!r}, all of it in {file.name}"


def tasks(inputs: int) -> list[tuple[str, int, int]]:
    """(target, seed, inputs) for all of them, in pieces."""
    whole = sum(target.weight for target in TARGETS.values())
    shares = {name: max(1, round(inputs * target.weight / whole)) for name, target in TARGETS.items()}
    return [
        (name, 1 + first // AT_ONCE, min(AT_ONCE, share - first))
        for name, share in shares.items()
        for first in range(0, share, AT_ONCE)
    ]


def kept(file: Path | None) -> list[Tried]:
    """What earlier runs have tried."""
    return [Tried(**json.loads(line)) for line in file.read_text().splitlines()] if file and file.exists() else []


def main(inputs: int, processes: int, file: Path | None) -> None:
    began, wanted = time.perf_counter(), tasks(inputs)
    done = [each for each in kept(file) if each.task in wanted]
    known = {each.task for each in done}
    with ProcessPoolExecutor(processes) as pool:
        for future in as_completed([pool.submit(tried, *task) for task in wanted if task not in known]):
            done.append(future.result())
            if file:
                with file.open("a") as lines:
                    lines.write(json.dumps(asdict(done[-1])) + "\n")
    targets = {name: summed([each for each in done if each.name == name]) for name in TARGETS}
    total = sum(target["inputs"] for target in targets.values())
    seconds = round(time.perf_counter() - began, 1)
    print(json.dumps({"inputs": total, "seconds": seconds, "undocumented": 0, "targets": targets}, indent=1))


def summed(done: Sequence[Tried]) -> dict[str, float]:
    """One target's."""
    return {
        "inputs": sum(each.inputs for each in done),
        "taken": sum(each.taken for each in done),
        "longest_ms": round(1e3 * max(each.longest_s for each in done), 1),
    }


if __name__ == "__main__":
    asked = dict(enumerate(sys.argv[1:]))
    main(int(asked.get(0, 10_000_000)), int(asked.get(1, os.cpu_count() or 1)), Path(asked[2]) if 2 in asked else None)
