"""From a request to stop a run to rest and to the end of its process: `python -m tests.benchmark.stop_times`.

With names of procedures, only these. Each procedure that needs a stage runs in a process of its own, in real time, on
twins that this process serves. The request comes at a random moment, as Ctrl-C and SIGTERM to a run in a terminal, and
as the stop of the page Run. The time of rest is when the last stage or positioner stands still; what is at rest already
needs none. The procedures by hand run in simulated time, and move nothing. All kernels are compiled first: in a fresh
environment this takes minutes.
"""

from __future__ import annotations

import json
import os
import random
import signal
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

from drivers.clock import WallClock, serve_forever
from drivers.world.batch import AnyWorld
from procedures.catalogue import paths
from rig.bench import DEFAULT, read_bench
from rig.bench.file import HAND
from rig.instruments.wiring import serve, world_of
from rig.runs.background.control import begin, latest, stop
from rig.warm import main as compile_all
from tests.rig.misbehaving import SHORT
from tests.rig.rigging import ON_STAGES

WAYS = ("Ctrl-C", "SIGTERM", "page Run")
SIGNALS = {"Ctrl-C": signal.SIGINT, "SIGTERM": signal.SIGTERM}
ANSWERS = {"mounting": "yes"}
LATEST_S, HAND_S = 12.0, 1.0  # until the request, after the run has begun
LONGEST_S = 120.0  # until a run has begun, or has ended
WATCH_S = 0.01
STILL_UM = 0.1  # between two looks at the positioner, whose sensor has noise
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Stop:
    """One stop: seconds from the request to rest (None: nothing moved) and to the end of the process."""

    procedure: str
    way: str
    rest_s: float | None
    end_s: float


@dataclass(frozen=True)
class Places:
    """Angles of the stages, deg, and positions of the carriage, um."""

    stages: Sequence[float]
    carriage: Sequence[float]


class Watch:
    """A peer of the served twins that notes when something moves."""

    def __init__(self, world: AnyWorld) -> None:
        self._world, self._looked_s = world, 0.0
        self._places = self._now()
        self.moved_s: list[float] = []

    def filenos(self) -> Sequence[int]:
        return ()

    def receive(self, fileno: int, now_s: float) -> None:
        """Nobody talks to it."""

    def emit(self, now_s: float) -> None:
        """It says nothing."""

    def due_s(self) -> float:
        return self._looked_s + WATCH_S

    def progress(self, key: str) -> None:
        """It has no connection."""

    def advance(self, now_s: float) -> None:
        if now_s < self.due_s():
            return
        self._world.advance(now_s)
        before, self._places, self._looked_s = self._places, self._now(), now_s
        if _way(before.stages, self._places.stages) > 0 or _way(before.carriage, self._places.carriage) > STILL_UM:
            self.moved_s.append(now_s)

    def _now(self) -> Places:
        stages = [self._world.motor_angle_deg(name) for name in ("alpha", "beta")]
        return Places(stages, [float(self._world.positioner_um(name)[0]) for name in AXES])


def _way(before: Sequence[float], now: Sequence[float]) -> float:
    """The longest way of an axis between two looks."""
    return max(abs(a - b) for a, b in zip(before, now, strict=True))


@contextmanager
def served(folder: Path) -> Iterator[tuple[Path, WallClock, Watch]]:
    """A bench file of twins in real time, their clock, and the watch."""
    bench, clock, ended = read_bench(), WallClock(), threading.Event()
    world = world_of(bench)
    servers = list(serve(bench, world).values())
    watch = Watch(world)
    document = yaml.safe_load(DEFAULT.read_text(encoding="utf-8"))
    for server in servers:
        for role, address in server.addresses.items():
            document["instruments"][role] |= {k: v for k, v in vars(address).items() if v is not None}
    document["folders"] = {}
    path = folder / "served.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    thread = threading.Thread(target=serve_forever, args=([*servers, watch], ended.is_set, clock), daemon=True)
    thread.start()
    try:
        yield path, clock, watch
    finally:
        ended.set()
        thread.join()
        for server in servers:
            server.close()


def stopped(procedure: str, way: str, luck: random.Random) -> Stop | None:
    """One stop; None where the run had ended by itself."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["RIG_HOME"] = str(folder / "home")
        if procedure.startswith("hand-"):
            return _stopped(procedure, way, HAND, luck.uniform(0.0, HAND_S), time.monotonic, list)
        with served(folder) as (bench, clock, watch):
            return _stopped(procedure, way, bench, luck.uniform(0.0, LATEST_S), clock.now, lambda: watch.moved_s)


def _stopped(
    procedure: str, way: str, bench: Path, after_s: float, now: Callable[[], float], moved: Callable[[], list[float]]
) -> Stop | None:
    settings = SHORT.get(procedure, {})
    process = None if way == "page Run" else _in_terminal(procedure, settings, bench)
    if process is None:
        begin(procedure, settings, bench, attended=False, answers=ANSWERS)
    _until(lambda: (found := latest()) is not None and found.phase != "starting")
    time.sleep(after_s)
    status = latest()
    assert status
    if status.phase == "ended":
        assert status.state in ("complete", "stopped"), status.error
        return None
    asked_s = now()
    if process is None:
        stop(status)
        _until(lambda: latest() is not None and not Path(f"/proc/{status.pid}").exists())  # `latest` collects it
    else:
        process.send_signal(SIGNALS[way])
        assert process.wait(LONGEST_S) == 4, process.args
    ended_s = now()
    later = [each - asked_s for each in moved() if each > asked_s]
    return Stop(procedure, way, max(later, default=None), ended_s - asked_s)


def _in_terminal(procedure: str, settings: dict[str, str], bench: Path) -> subprocess.Popen[bytes]:
    answers = Path(os.environ["RIG_HOME"]).parent / "answers.yaml"
    answers.write_text(yaml.safe_dump(ANSWERS), encoding="utf-8")
    words = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    command = [sys.executable, "-m", "rig", "run", procedure, *words, "--bench", str(bench), "--unattended"]
    return subprocess.Popen([*command, "--answers", str(answers)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _until(holds: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + LONGEST_S
    while not holds():
        assert time.monotonic() < deadline_s
        time.sleep(0.005)


def summary(stops: Sequence[Stop]) -> dict[str, float | None]:
    """Medians and longest times, s, over all ways."""
    rests, ends = [stop.rest_s for stop in stops if stop.rest_s is not None], [stop.end_s for stop in stops]
    times = {"rest": rests, "end": ends}
    medians = {f"{name}_median_s": round(statistics.median(of), 2) if of else None for name, of in times.items()}
    longest = {f"{name}_longest_s": round(max(of), 2) if of else None for name, of in times.items()}
    return {"stops": len(stops), "moving": len(rests), **medians, **longest}


def main(*procedures: str) -> None:
    """Print a line of JSON for each stop, and one for each procedure."""
    compile_all()  # else the first exchange with a twin runs out of time
    luck = random.Random(1)
    for procedure in procedures or (*ON_STAGES, *sorted(set(paths()) - set(ON_STAGES))):
        stops = []
        for way in WAYS:
            while (found := stopped(procedure, way, luck)) is None:
                """It had ended before the request."""
            stops.append(found)
            print(json.dumps(vars(found)), file=sys.stderr, flush=True)
        print(json.dumps({"procedure": procedure, "load": os.getloadavg()[0], **summary(stops)}), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
