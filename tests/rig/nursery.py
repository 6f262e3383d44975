"""A warm process that forks commands and lets them come to harm: what a new interpreter costs is paid once.

`python -m tests.rig.nursery` reads orders, a line of JSON each, and answers each with another; `Nursery` is its client.
It has one thread and holds no file of the record and no wire when it forks. A child leads a process group of its own.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import resource
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections import Counter
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Self

ROOT = Path(__file__).parents[2]
LONGEST_S = 600.0  # what hangs is killed; a command takes a second, and a minute on a machine with much else to do
WARMING = ("run", "sweep", "--unattended", "--step-deg", "90", "--dwell-s", "0.2", "--inclinations-deg", "90")


@dataclass(frozen=True)
class Harm:
    """What a command comes to, and when.

    clock               SIGKILL after `at` seconds
    sql                 SIGKILL at point `at` of the record: before and after a statement, before and after a commit
    INSERT INTO table   SIGKILL at insert `at` into that table
    wire                SIGKILL at request `at` to an instrument
    disk                no file grows beyond `at` bytes: death by SIGXFSZ, with a write half done
    """

    kind: str = "none"
    at: float = 0


@dataclass(frozen=True)
class Ended:
    """How it ended: status (negative: the signal), wall time, what it printed, poses that it knew committed, points."""

    status: int
    seconds: float
    said: str
    kept: int
    points: dict[str, int]


class Nursery:
    """A running nursery. A context manager."""

    def __enter__(self) -> Self:
        places = {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.rig.nursery"],
            env={**os.environ, **places}, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        return self

    def __exit__(self, *_: object) -> None:
        self._process.communicate()

    def run(self, home: Path, *words: str, harm: Harm = Harm()) -> Ended:
        """Call a command with its record in `home`."""
        assert self._process.stdin
        assert self._process.stdout
        home.mkdir(parents=True, exist_ok=True)
        print(
            json.dumps({"home": str(home), "words": words, "harm": asdict(harm)}), file=self._process.stdin, flush=True
        )
        return Ended(**json.loads(self._process.stdout.readline()))


def serve() -> None:
    """Warm up, then carry out orders until there are no more."""
    with tempfile.TemporaryDirectory() as folder, (Path(folder) / "said").open("w") as said:
        os.environ["RIG_HOME"] = folder
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), contextlib.suppress(SystemExit):
            call(WARMING)
    gc.freeze()  # children share what is here
    assert threading.active_count() == 1, "who forks must be alone"
    for line in sys.stdin:
        print(json.dumps(asdict(carry_out(**json.loads(line)))), flush=True)


def call(words: tuple[str, ...]) -> None:
    from rig.cli import main

    main(words)


def carry_out(home: str, words: list[str], harm: dict[str, Any]) -> Ended:
    """Fork a child for one order, and wait for its end, or for the time to kill it."""
    with tempfile.TemporaryDirectory() as folder:
        place, what, began = Path(folder), Harm(**harm), time.perf_counter()
        for name in ("said", "kept"):
            (place / name).touch()
        (place / "points").write_text("{}")
        alive, own = os.pipe()  # the child's end closes when it ends
        pid = os.fork()
        if pid == 0:
            child(place, home, words, what)
        os.close(own)
        with contextlib.suppress(PermissionError, ProcessLookupError):  # the child does so too: who comes first
            os.setpgid(pid, pid)
        if not select.select([alive], [], [], what.at if what.kind == "clock" else LONGEST_S)[0]:
            os.killpg(pid, signal.SIGKILL)
        _, status = os.waitpid(pid, 0)
        os.close(alive)
        seconds, points = time.perf_counter() - began, json.loads((place / "points").read_text())
        kept = (place / "kept").stat().st_size
        return Ended(os.waitstatus_to_exitcode(status), seconds, (place / "said").read_text(), kept, points)


def child(place: Path, home: str, words: list[str], harm: Harm) -> None:
    """The command itself; does not return."""
    os.setpgid(0, 0)
    said = os.open(place / "said", os.O_WRONLY | os.O_APPEND)
    os.dup2(said, 1)
    os.dup2(said, 2)
    os.environ["RIG_HOME"] = home
    points, status = Points(harm), 70
    try:
        points.watch(os.open(place / "kept", os.O_WRONLY | os.O_APPEND))
        call(tuple(words))
    except SystemExit as ended:
        status = int(ended.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        (place / "points").write_text(json.dumps(points.counts))
        os._exit(status)


class Points:
    """Counts the points of harm that a command passes, and does it harm at its own."""

    def __init__(self, harm: Harm) -> None:
        self.counts: Counter[str] = Counter()
        self._harm = harm

    def watch(self, kept: int) -> None:
        """Be told of every statement, commit and request; write a byte into the file `kept` for a committed pose."""
        from sqlalchemy import Engine, event

        from drivers.transport.link import Link
        from rig.record import Record

        for name in ("before_cursor_execute", "after_cursor_execute", "commit"):
            event.listen(Engine, name, lambda *_: self._pass("sql"))
        event.listen(Engine, "before_cursor_execute", lambda *of: self._pass(" ".join(of[2].split()[:3])))
        write, keep = Link.write, Record.keep

        def written(link: Link, data: bytes) -> None:
            self._pass("wire")
            write(link, data)

        def committed(record: Record, *what: Any) -> None:
            keep(record, *what)
            self._pass("sql")
            os.write(kept, b".")

        Link.write, Record.keep = written, committed
        if self._harm.kind == "disk":
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            resource.setrlimit(resource.RLIMIT_FSIZE, (int(self._harm.at), int(self._harm.at)))
            signal.signal(signal.SIGXFSZ, signal.SIG_DFL)

    def _pass(self, kind: str) -> None:
        self.counts[kind] += 1
        if (kind, self.counts[kind]) == (self._harm.kind, self._harm.at):
            os.killpg(os.getpgrp(), signal.SIGKILL)


if __name__ == "__main__":
    serve()
