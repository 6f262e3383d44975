"""A process that is killed loses the pose in flight and nothing else; a signal leaves a run that can be resumed.

Kills at random moments are drawn by seeds; `python -m tests.benchmark.kills` survives hundreds.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from rig.record import Record
from rig.runs.signals import stop_source
from tests.benchmark.kills import number
from tests.rig.killing import (
    FIELDS,
    MOTION,
    RUN,
    SOAK,
    TURNS,
    Story,
    Undisturbed,
    finished,
    inspected,
    many,
    measured,
    undisturbed,
)
from tests.rig.killing_transfers import kills_of_a_push, kills_of_imports
from tests.rig.nursery import Harm, Nursery
from tests.rig.postgres import Server
from tests.rig.rigging import in_own_process, signal_at
from tests.slow import first_fast

pytestmark = pytest.mark.sockets
KILLS = 10  # of each seed


@pytest.fixture(scope="module")
def nursery() -> Iterator[Nursery]:
    with Nursery() as warm:
        yield warm


@pytest.fixture(scope="module")
def whole(nursery: Nursery, tmp_path_factory: pytest.TempPathFactory) -> Undisturbed:
    return undisturbed(nursery, tmp_path_factory.mktemp("undisturbed"))


@pytest.mark.parametrize(("kills", "expected"), [(1, 1), (10, 1), (50, 7), (500, 70)])
def test_the_benchmark_kills_each_procedure_at_least_once(kills: int, expected: int) -> None:
    assert number(0.14, kills) == expected


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_kills_at_random_moments(nursery: Nursery, whole: Undisturbed, tmp_path: Path, seed: int) -> None:
    survived = many(nursery, tmp_path, whole, seed, KILLS)
    assert survived.total() >= KILLS


@pytest.mark.slow
@pytest.mark.parametrize("words", [SOAK, MOTION, FIELDS, TURNS], ids=lambda words: words[1])
def test_kills_of_other_procedures(nursery: Nursery, tmp_path: Path, words: tuple[str, ...]) -> None:
    survived = many(nursery, tmp_path, undisturbed(nursery, tmp_path / "undisturbed", words), 7, 3)
    assert survived.total() >= 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("table", "number", "poses"),
    first_fast(
        [("blocks", 9, 8), ("blocks", 1, 0), ("states", 1, 0), ("events", 1, 0), ("readings", 2, 0), ("readings", 4, 0)]
    ),
)
def test_a_kill_inside_a_transaction(
    nursery: Nursery, whole: Undisturbed, rig_home: Path, table: str, number: int, poses: int
) -> None:
    killed = nursery.run(rig_home, *RUN, harm=Harm(f"INSERT INTO {table}", number))
    assert killed.status == -signal.SIGKILL
    seen = inspected(rig_home, whole)
    assert (seen.state, seen.poses) == ("stopped", poses)
    finished(nursery, rig_home, whole, Story(seen=[seen]))


@pytest.mark.slow
def test_processes_are_killed_during_their_start(nursery: Nursery, whole: Undisturbed, rig_home: Path) -> None:
    luck, seen = random.Random(1), Story().seen[-1]
    for _ in range(3):
        words = ("resume", seen.run, "--unattended") if seen.run else RUN
        process = subprocess.Popen(
            [sys.executable, "-m", "rig", *words],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(luck.uniform(0.05, 0.6))
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        seen = inspected(rig_home, whole)
    finished(nursery, rig_home, whole, Story(seen=[seen]))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_a_signal_ends_the_process_with_status_4_and_resume_finishes_the_run(
    name: str, nursery: Nursery, whole: Undisturbed, rig_home: Path
) -> None:
    stopped = in_own_process(*RUN, harm=signal_at("blocks", 5, name))
    document = json.loads(stopped.stdout)
    assert (stopped.returncode, document["state"]) == (4, "stopped")
    assert f"{stop_source(name)}; `rig resume {document['run']}` continues the run" in stopped.stderr
    assert "Traceback" not in stopped.stderr
    resumed = nursery.run(rig_home, "resume", document["run"], "--unattended", "--json")
    assert resumed.status == 0, resumed.said
    with Record() as record:
        assert measured(record, document["run"]) == whole.measured


@pytest.mark.slow
def test_kills_of_an_import(nursery: Nursery, tmp_path: Path) -> None:
    assert kills_of_imports(nursery, tmp_path, 5, 12).total() >= 12


@pytest.mark.slow
def test_kills_of_a_push(nursery: Nursery, server: Server, database: str, tmp_path: Path) -> None:
    assert kills_of_a_push(nursery, server.url(database), tmp_path, 6, 6).total() >= 6
