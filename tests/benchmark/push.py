"""1,000 pushes from 8 rigs at once into one server, over wires that are cut: `python -m tests.benchmark.push [RUNS]`.

Each rig is a process with a record of its own, and pushes one run at a time until it is there. Its wire is cut after a
random number of bytes; meanwhile the server itself ends a random connection every QUARREL_S. In the end every run in
the lab is compared, row for row, with the rig's own: none may be lost, there twice, or other than it was.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

from sqlalchemy import event

from rig.errors import LabAway
from rig.lab_url import lab_url
from rig.record import Record
from rig.record import push as pushing
from rig.record.lab import prepare
from rig.record.push import push, unsent, verify
from tests.rig.cutting import at_random, wire
from tests.rig.postgres import Server, serving
from tests.rig.pushing import a_run, held

RIGS = 8
POSES = 6
LONGEST_WIRE = 120_000  # bytes, of which a run takes about 45,000 and a connection's beginning 5,000
BATCH = 10_000
QUARREL_S = 1.0
DATABASE = "lab"
END_ONE = """SELECT count(pg_terminate_backend(pid)) FROM
    (SELECT pid FROM pg_stat_activity WHERE datname = 'lab' ORDER BY random() LIMIT 1) AS chosen"""


def one_rig(number: int, runs: int, folder: Path, port: int) -> Counter[str]:
    """Measure, so to say, and push; how many pushes it took, and how many of them were cut."""
    pushing.MOST_BYTES = BATCH
    with Record(folder / str(number)) as own, wire(port, at_random(number, LONGEST_WIRE)) as cut:
        event.listen(own.engine, "connect", lambda made, _: made.execute("PRAGMA synchronous = OFF"))
        names = [a_run(own, 1000 * number + k, poses=POSES) for k in range(runs)]
        return sum((until_there(own, run, Server(port).url(DATABASE, port=cut.port)) for run in names), Counter())


def until_there(own: Record, run: str, url: str) -> Counter[str]:
    """Push a run again and again until somebody says that it is there."""
    count = Counter[str]()
    while True:
        count["pushes"] += 1
        try:
            with Record(lab_url(url)) as lab:
                return count + Counter({push(own, lab, run).how: 1})
        except LabAway:
            count["cut"] += 1


@contextmanager
def quarrelling(server: Server) -> Iterator[Counter[str]]:
    """The server ends connections, one at a time."""
    ended, over = Counter[str](), threading.Event()

    def end_some() -> None:
        while not over.wait(QUARREL_S):
            ended["ended_by_the_server"] += server.sql(END_ONE)[0][0]

    thread = threading.Thread(target=end_some)
    thread.start()
    try:
        yield ended
    finally:
        over.set()
        thread.join()


def compared(folder: Path, server: Server) -> Counter[str]:
    """Every run of every rig beside the lab's."""
    count = Counter[str]({"lost": 0, "different": 0})
    with Record(lab_url(server.url(DATABASE))) as lab:
        at = {run.uid: run.run for run in lab.runs()}
        for number in range(RIGS):
            with Record(folder / str(number)) as own:
                count["unsent"] += len(unsent(own, lab))
                for run in own.runs():
                    count["runs"] += 1
                    if run.uid not in at:
                        count["lost"] += 1
                    elif held(lab, at[run.uid]) != held(own, run.run):
                        count["different"] += 1
        count["in_the_lab"] = len(lab.runs())
        count["proved_by_the_lab"] = len(verify(lab).sound)
    count["twice"] = count["in_the_lab"] - (count["runs"] - count["lost"])
    return count


def main(runs: int = 1000) -> None:
    with TemporaryDirectory() as temporary, serving() as server:
        folder = Path(temporary)
        server.sql(f"CREATE DATABASE {DATABASE}")
        prepare(lab_url(server.url(DATABASE)))
        began = time.perf_counter()
        with ProcessPoolExecutor(RIGS, mp_context=get_context("spawn")) as rigs, quarrelling(server) as ended:
            waiting = [rigs.submit(one_rig, k, runs // RIGS, folder, server.port) for k in range(RIGS)]
            count = sum((each.result() for each in waiting), Counter())
        seconds = time.perf_counter() - began
        found = compared(folder, server)
    met = found["runs"] == found["proved_by_the_lab"] == runs and not any(
        found[k] for k in ("lost", "twice", "different")
    )
    print(json.dumps({"seconds": [seconds], "rigs": RIGS, **count, **ended, **found, "met": met}))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
