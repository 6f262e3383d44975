"""Runs that are killed again and again at moments drawn by a seeded generator, and what must hold after each kill."""

from __future__ import annotations

import math
import random
import shutil
import sqlite3
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rig.record import Kept, Record
from rig.record.measured import table_of
from tests.rig.nursery import Ended, Harm, Nursery

RUN = ("run", "sweep", "--unattended", "--json", "--step-deg", "90", "--dwell-s", "0.2", "--inclinations-deg", "90")
POSES = 10  # of it
KINDS = ("clock", "sql", "wire", "disk")
MOST_IN_A_ROW = 5
WAL = "record.db-wal"
LEAST_BYTES = 33_000  # the log's index alone has 32 KiB


@dataclass(frozen=True)
class Measured:
    """All that a run measured: its table's digest, and every pose with its samples."""

    digest: str
    poses: tuple[tuple[Any, ...], ...]


@dataclass(frozen=True)
class Undisturbed:
    """A run to which nothing happened, and how far each kind of harm can reach into one."""

    measured: Measured
    reach: dict[str, float]  # seconds, points, bytes of the log

    def drawn(self, luck: random.Random, left: float, log_bytes: int) -> Harm:
        """Harm somewhere in the share of a run that is `left`, or just beyond it; `log_bytes` are written already."""
        kind = luck.choice(KINDS)
        at = luck.random() * left * self.reach[kind]
        if kind == "disk":
            return Harm(kind, max(LEAST_BYTES, log_bytes) + math.ceil(at))
        return Harm(kind, at if kind == "clock" else math.ceil(at))


@dataclass(frozen=True)
class Seen:
    """What the record held: the run, if there is one yet, and its poses."""

    run: str | None = None
    state: str = ""
    poses: int = 0


@dataclass
class Story:
    """What happened to one run; told when something does not hold."""

    kills: list[Harm] = field(default_factory=list)
    seen: list[Seen] = field(default_factory=lambda: [Seen()])


def measured(record: Record, run: str) -> Measured:
    return Measured(table_of(record, run).digest, tuple(_pose(kept) for kept in record.kept(run)))


def _pose(kept: Kept) -> tuple[Any, ...]:
    samples = kept.samples
    return kept.pose, kept.t_s, kept.temperature_c, samples.start_s, samples.rate_hz, samples.volts.tobytes()


def undisturbed(nursery: Nursery, folder: Path) -> Undisturbed:
    """Run to the end without harm, and see how long that takes."""
    whole, short = folder / "whole", folder / "short"
    ended = nursery.run(whole, *RUN)
    assert ended.status == 0, ended.said
    last = nursery.run(short, *RUN, harm=Harm("sql", ended.points["sql"] - 1))  # the log goes with the last commit
    assert last.status < 0, last.said
    log = (short / WAL).stat().st_size - LEAST_BYTES
    with Record(whole) as record:
        found = measured(record, record.runs()[0].run)
    return Undisturbed(found, {"clock": ended.seconds, "disk": log, **ended.points})


def tormented(nursery: Nursery, home: Path, whole: Undisturbed, luck: random.Random) -> list[Harm]:
    """Kill one run up to MOST_IN_A_ROW times, let it finish, and compare it with `whole`; the kills."""
    story, log = Story(), home / WAL
    for _ in range(luck.randint(1, MOST_IN_A_ROW)):
        seen = story.seen[-1]
        left = 1 - seen.poses / (POSES + 1)
        harm = whole.drawn(luck, left, log.stat().st_size if log.exists() else 0)
        ended = nursery.run(home, *_words(seen), harm=harm)
        story.seen.append(inspected(home, whole.measured))
        _check(story, ended)
        if ended.status >= 0:
            break  # it was through before its time
        story.kills.append(harm)
    finished(nursery, home, whole, story)
    return story.kills


def finished(nursery: Nursery, home: Path, whole: Undisturbed, story: Story) -> None:
    """Go on with the run, to the end: it is the same as if nothing had happened."""
    ended = nursery.run(home, *_words(story.seen[-1]))
    assert ended.status == 0, (story, ended.said)
    with Record(home) as record:
        (run,) = record.runs()
        assert run.state == "complete", story
        assert measured(record, run.run) == whole.measured, story


def _words(seen: Seen) -> tuple[str, ...]:
    return ("resume", seen.run, "--unattended", "--json") if seen.run else RUN


def _check(story: Story, ended: Ended) -> None:
    """What was committed is there; beside it at most the pose whose commit the process did not live to know of."""
    before, now = story.seen[-2:]
    assert before.poses + ended.kept <= now.poses <= before.poses + ended.kept + 1, (story, ended)
    assert before.run in (None, now.run), story


def inspected(home: Path, whole: Measured) -> Seen:
    """The record as it was left: it opens, is sound, and holds the first poses of `whole` and nothing else.

    Looks at a copy, so that what goes on with the run finds the file as the kill left it.
    """
    copy = home.with_name(f"{home.name}-copy")
    shutil.rmtree(copy, ignore_errors=True)
    copy.mkdir()
    for file in home.glob("record.db*"):
        shutil.copy(file, copy)
    with Record(copy) as record:
        runs = record.runs()
        assert len(runs) <= 1
        seen = Seen(runs[0].run, runs[0].state, runs[0].rows) if runs else Seen()
        found = tuple(_pose(kept) for kept in record.kept(seen.run)) if seen.run else ()
    assert found == whole.poses[: seen.poses]
    assert seen.state in ("", "stopped", "complete")
    with sqlite3.connect(copy / "record.db") as file:
        assert file.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    file.close()
    return seen


def many(nursery: Nursery, folder: Path, whole: Undisturbed, seed: int, kills: int) -> Counter[str]:
    """Torment runs until so many kills have been survived; how many of each kind."""
    luck, survived = random.Random(seed), Counter[str]()
    while survived.total() < kills:
        home = folder / f"run-{seed}"
        survived.update(harm.kind for harm in tormented(nursery, home, whole, luck))
        shutil.rmtree(home)
    return survived
