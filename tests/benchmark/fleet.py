"""A fleet's diagnosis: time and memory for so many sensors of 60 poses, with one worker and with two.

    python -m tests.benchmark.fleet [--sensors 10000] [--odd 0.02] [--workers 1,2]

Four rigs, of which one is off; ten batches, of which one has an effect that no sensor shows alone; and a share of odd
sensors. Printed are wall and processor time, the largest memory of any worker and of the command, and what was found.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import threading
import time
from pathlib import Path

import psutil

from calibrations.model_file import dump_model, read_model
from calibrations.reading.read_csv import write_csv
from rig.fleet.asked import Fleet
from rig.fleet.crew import crew
from rig.fleet.discover import discover_fleet
from rig.fleet.members import fleet_of
from rig.record import Record
from tests.calibrations.fleets import Flaw, Rig, sensor

BATCHES, RIGS = 10, {"a": Rig(), "b": Rig(wave=0.05), "c": Rig(), "d": Rig()}
ODD = (Flaw(warmth=1e-3), Flaw(bend=2e-3), Flaw(askew=0.5))


def main() -> None:
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--sensors", type=int, default=10_000)
    asked.add_argument("--odd", type=float, default=0.02)
    asked.add_argument("--workers", default="1,2")
    said = asked.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        make(Path(folder), said.sensors, said.odd)
        for workers in map(int, said.workers.split(",")):
            print(json.dumps(measured(Path(folder), workers)), flush=True)


def make(folder: Path, count: int, odd: float) -> None:
    """The files of the fleet, and its index."""
    every, lines = round(1 / odd), ["sensor,batch,rig,file"]
    for k in range(count):
        batch, rig = k * BATCHES // count, "abcd"[k % 4]
        flaw = ODD[k // every % 3] if k % every == 0 else Flaw(bend=30e-6 * (batch == 3))
        write_csv(sensor(k, flaw, RIGS[rig]), folder / f"{k}.csv")
        lines.append(f"S{k},L{batch},{rig},{k}.csv")
    (folder / "fleet.csv").write_text("\n".join(lines) + "\n")


def measured(folder: Path, workers: int) -> dict[str, object]:
    """One discovery into a record of its own."""
    memory = Memory()
    with tempfile.TemporaryDirectory() as home, Record(Path(home)) as record, crew(None, workers) as client, memory:
        began, own_s = time.perf_counter(), time.process_time()
        found = discover_fleet(
            Fleet(client, record, lambda *_: None), fleet_of([str(folder)]), dump_model(read_model("linear"))
        )
        wall_s, own_s = time.perf_counter() - began, time.process_time() - own_s
    return {
        "sensors": len(found.sensors),
        "workers": workers,
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
    """Looks twice a second at this process and its children: their memory, and the processor time they used."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.worker_mb, self.own_mb, self.cpu_s = 0, 0, 0.0
        self._ended = threading.Event()

    def run(self) -> None:
        own = psutil.Process(os.getpid())
        began = self._used(own)
        while not self._ended.wait(0.5):
            children = own.children(recursive=True)
            self.own_mb = max(self.own_mb, own.memory_info().rss >> 20)
            self.worker_mb = max([self.worker_mb, *(child.memory_info().rss >> 20 for child in children)])
            self.cpu_s = max(self.cpu_s, self._used(own) - began)

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
