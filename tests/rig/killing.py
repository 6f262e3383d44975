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

import numpy as np

from rig.record import KeptPose, Record
from rig.record.measured import table_of
from tests.rig.misbehaving import STRETCHES
from tests.rig.nursery import Ended, Harm, Nursery

RUN = ("run", "sweep", "--unattended", "--json", "--step-deg", "90", "--dwell-s", "0.2", "--inclinations-deg", "90")
SOAK = (
    "run", "soak", "--unattended", "--json", "--duration-s", "100", "--interval-s", "50", "--block-s", "20",
    "--dwell-s", "0.2", "--settle-s", "0.1", "--off-s", "0",
)  # fmt: skip
MOTION = (
    "run", "motion", "--unattended", "--json", "--duration-s", "2", "--still-s", "2", "--block-s", "1",
    "--dwell-s", "0.1", "--settle-s", "0",
)  # fmt: skip
HAND = str(Path(__file__).parents[2] / "rig" / "bench" / "hand.yaml")
POSITIONS, FIELDS, TURNS = (
    ("run", name, "--bench", HAND, "--unattended", "--json") for name in ("hand-positions", "hand-fields", "hand-turns")
)
MISALIGNMENT = ("run", "misalignment", "--unattended", "--json", "--dwell-s", "0.2", "--most-rounds", "1")
NEAR_V = 5e-3  # of a mean, where a record without gaps began anew: ten times its noise
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
    """A run to which nothing happened, its command, and how far each kind of harm can reach into one.

    `exact`: one that goes on measures the same samples. A record without gaps begins anew where it goes on. A
    person who turns a sensor by hand never does so twice alike: what was committed stays, and the rest is another.
    """

    words: tuple[str, ...]
    exact: bool
    measured: Measured
    reach: dict[str, float]  # seconds, points, bytes of the log

    @property
    def by_hand(self) -> bool:
        """Whether a person makes the positions."""
        return self.words[1].startswith("hand-")

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
    found: tuple[tuple[Any, ...], ...] = field(default=(), repr=False)


@dataclass
class Story:
    """What happened to one run; told when something does not hold."""

    kills: list[Harm] = field(default_factory=list)
    seen: list[Seen] = field(default_factory=lambda: [Seen()])


def measured(record: Record, run: str) -> Measured:
    return Measured(table_of(record, run).digest, tuple(_pose(kept) for kept in record.kept(run)))


def _pose(kept: KeptPose) -> tuple[Any, ...]:
    samples = kept.samples
    return kept.pose, kept.t_s, kept.temperature_c, samples.start_s, samples.rate_hz, samples.volts.tobytes()


def undisturbed(nursery: Nursery, folder: Path, words: tuple[str, ...] = RUN) -> Undisturbed:
    """Run to the end without harm, and see how long that takes."""
    whole, short = folder / "whole", folder / "short"
    ended = nursery.run(whole, *words)
    assert ended.status in (0, 1), ended.said  # 1: a result beyond its limit, of so short a run
    last = nursery.run(short, *words, harm=Harm("sql", ended.points["sql"] - 1))  # the log goes with the last commit
    assert last.status < 0, last.said
    log = (short / WAL).stat().st_size - LEAST_BYTES
    with Record(whole) as record:
        found = measured(record, record.runs()[0].run)
    return Undisturbed(words, words[1] not in STRETCHES, found, {"clock": ended.seconds, "disk": log, **ended.points})


def tormented(nursery: Nursery, home: Path, whole: Undisturbed, luck: random.Random) -> list[Harm]:
    """Kill one run up to MOST_IN_A_ROW times, let it finish, and compare it with `whole`; the kills."""
    story, log = Story(), home / WAL
    for _ in range(luck.randint(1, MOST_IN_A_ROW)):
        seen = story.seen[-1]
        left = 1 - seen.poses / (len(whole.measured.poses) + 1)
        harm = whole.drawn(luck, left, log.stat().st_size if log.exists() else 0)
        ended = nursery.run(home, *_words(seen, whole), harm=harm)
        story.seen.append(inspected(home, whole))
        _check(story, ended)
        if ended.status >= 0:
            break  # it was through before its time
        story.kills.append(harm)
    finished(nursery, home, whole, story)
    return story.kills


def finished(nursery: Nursery, home: Path, whole: Undisturbed, story: Story) -> None:
    """Go on with the run, to the end: it is the same as if nothing had happened."""
    ended = nursery.run(home, *_words(story.seen[-1], whole))
    assert ended.status in (0, 1), (story, ended.said)
    with Record(home) as record:
        (run,) = record.runs()
        assert run.state == "complete", story
        found = measured(record, run.run)
        before = story.seen[-1].found
        assert found.poses[: len(before)] == before, story
        if whole.by_hand:
            assert len(found.poses) >= len(before), story
            return
        assert len(found.poses) == len(whole.measured.poses), story
        assert _same(found.poses, whole), story
        assert found.digest == whole.measured.digest or not whole.exact, story


def _same(found: tuple[tuple[Any, ...], ...], whole: Undisturbed) -> bool:
    """Whether these are its first poses: sample for sample, or the same places and, but for noise, the same means."""
    expected = whole.measured.poses[: len(found)]
    if whole.by_hand:
        return True
    if whole.exact:
        return found == expected
    means = [[np.frombuffer(pose[-1]).mean() for pose in poses] for poses in (found, expected)]
    near = bool(np.allclose(*means, rtol=0, atol=NEAR_V))
    return near and [pose[0] for pose in found] == [pose[0] for pose in expected]


def _words(seen: Seen, whole: Undisturbed) -> tuple[str, ...]:
    return ("resume", seen.run, "--unattended", "--json") if seen.run else whole.words


def _check(story: Story, ended: Ended) -> None:
    """What was committed is there; beside it at most the pose whose commit the process did not live to know of."""
    before, now = story.seen[-2:]
    assert before.poses + ended.kept <= now.poses <= before.poses + ended.kept + 1, (story, ended)
    assert before.run in (None, now.run), story
    assert now.found[: before.poses] == before.found, (story.kills, "what was committed has changed")


def inspected(home: Path, whole: Undisturbed) -> Seen:
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
        found = tuple(_pose(kept) for kept in record.kept(runs[0].run)) if runs else ()
        seen = Seen(runs[0].run, runs[0].state, runs[0].rows, found) if runs else Seen()
    assert len(found) == seen.poses
    assert _same(found, whole)
    assert seen.state in ("", "stopped", "complete")
    with sqlite3.connect(copy / "record.db") as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    connection.close()
    return seen


def many(nursery: Nursery, folder: Path, whole: Undisturbed, seed: int, kills: int) -> Counter[str]:
    """Torment runs until so many kills have been survived; how many of each kind."""
    luck, survived = random.Random(seed), Counter[str]()
    while survived.total() < kills:
        home = folder / f"run-{seed}"
        survived.update(harm.kind for harm in tormented(nursery, home, whole, luck))
        shutil.rmtree(home)
    return survived
