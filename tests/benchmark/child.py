"""A program in a process of its own: how long it took, on the clock and of the processor, and its peak of memory.

This process stays small, since a child's peak counts the parent that it was forked from.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
RIG = Path(sys.executable).with_name("rig")


@dataclass(frozen=True)
class Ended:
    """A program that has ended well: wall time, processor time, peak of resident memory, what it printed."""

    seconds: float
    processor_s: float
    peak_mb: float
    out: str


def run(folder: Path, *words: str, threads: int = 1) -> Ended:
    """Run a program in `folder`, with its record there. Raises RuntimeError where it fails."""
    places = {"RIG_HOME": str(folder), "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": str(threads)}
    with (folder / "out").open("w+") as out, (folder / "err").open("w+") as err:
        began = time.perf_counter()
        process = subprocess.Popen(words, cwd=folder, env={**os.environ, **places}, stdout=out, stderr=err)
        _, status, used = os.wait4(process.pid, 0)
        seconds = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode:
            err.seek(0)
            raise RuntimeError(f"{' '.join(words)}: exit status {process.returncode}\n{err.read()}")
        out.seek(0)
        return Ended(seconds, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, out.read())


def rig(folder: Path, *words: str) -> Ended:
    """One command of the application."""
    return run(folder, str(RIG), *words)


def subject(folder: Path, name: str, *words: str, threads: int = 1) -> Ended:
    """A module beside this one, which prints a JSON document."""
    return run(folder, sys.executable, "-m", f"tests.benchmark.{name}", *words, threads=threads)
