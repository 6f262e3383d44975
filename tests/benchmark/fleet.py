"""A fleet's diagnosis: time and memory for so many sensors of 60 poses; and for a part of them, one worker beside two.

    python -m tests.benchmark.fleet [--sensors 10000] [--part 2000] [--odd 0.02]

Four rigs, of which one is off; ten batches, of which one has an effect that no sensor shows alone; and a share of odd
sensors. Printed are wall and processor time, the largest memory of any worker and of the command, and what was found;
at the end what two workers gain over one, and what more sensors add to the memory. Workers have imported the program
before the clock starts, which is told as `start_s`: it is the same for any fleet.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import psutil

from calibrations.effects.catalogue import catalogue
from calibrations.importing.foreign import write_csv
from calibrations.model.file import dump_model, read_model
from rig.fleet.cluster import connect_workers
from rig.fleet.discover import discover_fleet
from rig.fleet.members import fleet_of
from rig.fleet.questions import Fleet
from rig.fleet.worker import Question
from rig.record import Record
from tests.calibrations.fleets import Flaw, Rig, sensor

LINEAR = dump_model(read_model("linear"))
BATCHES, RIGS = 10, {"a": Rig(), "b": Rig(wave=0.05), "c": Rig(), "d": Rig()}
ODD = (Flaw(warmth=1e-3), Flaw(bend=2e-3), Flaw(askew=0.5))


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--sensors", type=int, default=10_000)
    asked.add_argument("--part", type=int, default=2_000)
    asked.add_argument("--odd", type=float, default=0.02)
    said = asked.parse_args()
    runs = []
    for count, workers in ((said.part, 1), (said.part, 2), (said.sensors, 2)):
        with tempfile.TemporaryDirectory() as folder:
            make(Path(folder), count, said.odd)
            runs.append(measured(Path(folder), workers))
        print(json.dumps(runs[-1]), flush=True)
    one, two, all_ = runs
    told = {
        "two_over_one": round(one["wall_s"] / two["wall_s"], 2),
        "command_mb_more": all_["command_mb"] - two["command_mb"],
        "worker_mb_more": all_["largest_worker_mb"] - two["largest_worker_mb"],
        "cpu_s_a_sensor": round((all_["cpu_s_command"] + all_["cpu_s_workers"]) / said.sensors, 4),
    }
    print(json.dumps(told))


def make(folder: Path, count: int, odd: float) -> None:
    """The files of the fleet, and its index."""
    every, lines = round(1 / odd), ["sensor,batch,rig,file"]
    for k in range(count):
        batch, rig = k * BATCHES // count, "abcd"[k % 4]
        flaw = ODD[k // every % 3] if k % every == 0 else Flaw(bend=30e-6 * (batch == 3))
        write_csv(sensor(k, flaw, RIGS[rig]), folder / f"{k}.csv")
        lines.append(f"S{k},L{batch},{rig},{k}.csv")
    (folder / "fleet.csv").write_text("\n".join(lines) + "\n")


def measured(folder: Path, workers: int) -> dict[str, Any]:
    """One discovery into a record of its own."""
    memory, began = Memory(), time.perf_counter()
    with tempfile.TemporaryDirectory() as home, Record(Path(home)) as record, connect_workers(None, workers) as client:
        client.run(catalogue)
        start_s, began, own_s = time.perf_counter() - began, time.perf_counter(), time.process_time()
        with memory:
            members = fleet_of([str(folder)])
            found = discover_fleet(Fleet(client, record, lambda *_: None), members, Question("look", LINEAR))
            wall_s, own_s = time.perf_counter() - began, time.process_time() - own_s - memory.watching_s
    return {
        "sensors": len(found.sensors),
        "workers": workers,
        "start_s": round(start_s, 1),
        "wall_s": round(wall_s, 1),
        "cpu_s_command": round(own_s, 1),
        "cpu_s_workers": round(memory.cpu_s, 1),
        "largest_worker_mb": memory.worker_mb,
        "command_mb": memory.own_mb,
        "in_full": sum(each.judged == "in full" for each in found.sensors),
        "verdicts": dict(found.verdicts),
        "batches": {b.batch: [e.effect for e in b.effects] for b in found.batches if b.effects},
        "rigs": [(e.rig, e.effect, e.parameter, round(e.value, 4)) for e in found.rigs if e.beyond],
    }


class Memory(threading.Thread):
    """Looks every second at this process and its children: their memory, and the processor time they used.

    `watching_s`: what that took itself.
    """

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.worker_mb, self.own_mb, self.cpu_s, self.watching_s = 0, 0, 0.0, 0.0
        self._ended = threading.Event()

    def run(self) -> None:
        own = psutil.Process(os.getpid())
        began = self._used(own)
        while not self._ended.wait(1.0):
            children = own.children(recursive=True)
            self.own_mb = max(self.own_mb, own.memory_info().rss >> 20)
            self.worker_mb = max([self.worker_mb, *(child.memory_info().rss >> 20 for child in children)])
            self.cpu_s = max(self.cpu_s, self._used(own) - began)
            self.watching_s = time.thread_time()

    @staticmethod
    def _used(own: psutil.Process) -> float:
        return sum(sum(child.cpu_times()[:2]) for child in own.children(recursive=True))

    def __enter__(self) -> None:
        self.start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self.join()


if __name__ == "__main__":
    main()
