"""Kill imports and pushes at random moments (seeded), and check the record after each kill."""

from __future__ import annotations

import random
import shutil
from collections import Counter
from pathlib import Path

from rig.lab_url import lab_url
from rig.record import Record
from rig.record.measured import table_of
from tests.rig.nursery import Harm, Nursery
from tests.rig.pushing import a_run, held

DATA = Path(__file__).parents[1] / "golden" / "files" / "good.csv"
RUNS = 3  # of a record to push
STATEMENTS = 90  # of a push of these runs, about


def kills_of_imports(nursery: Nursery, folder: Path, seed: int, kills: int) -> Counter[str]:
    """Kill imports of one file until so many kills have been survived; how many of each kind.

    Half of a table is never there: the run is whole, or there is none; and the next import is as the first.
    """
    luck, survived, words = random.Random(seed), Counter[str](), ("import", str(DATA), "--json")
    whole = nursery.run(folder / "whole", *words)
    digest, reach = _digests(folder / "whole"), {"clock": whole.seconds, "sql": float(whole.points["sql"])}
    assert len(digest) == 1
    log = (folder / "whole" / "record.db").stat().st_size
    while survived.total() < kills:
        home = folder / "import"
        kind = luck.choice(("clock", "sql", "disk"))
        at = luck.random() * (log if kind == "disk" else reach[kind])
        harm = Harm(kind, at if kind == "clock" else max(1, round(at)))
        if nursery.run(home, *words, harm=harm).status < 0:
            survived[kind] += 1
        assert _digests(home) in (set(), digest), harm
        again = nursery.run(home, *words)
        assert again.status == 0, (harm, again.said)
        assert _digests(home) == digest, harm
        shutil.rmtree(home)
    return survived


def _digests(home: Path) -> set[str]:
    with Record(home) as record:
        return {table_of(record, run.run).digest for run in record.runs()}


def kills_of_a_push(nursery: Nursery, url: str, folder: Path, seed: int, kills: int) -> Counter[str]:
    """Kill pushes of one record to the empty lab at `url` until so many have been survived, and let the last one end.

    Whatever was sent already, each run is in the lab once at the end, to the last bit.
    """
    luck, survived, home = random.Random(seed), Counter[str](), folder / "own"
    with Record(home) as own:
        runs = [a_run(own, seed + k) for k in range(RUNS)]
        expected = [held(own, run) for run in runs]
    words = ("push", "--to", url)
    for _ in range(4 * kills):
        if survived.total() >= kills:
            break
        if nursery.run(home, *words, harm=Harm("sql", luck.randint(1, STATEMENTS))).status < 0:
            survived["sql"] += 1
    ended = nursery.run(home, *words)
    assert ended.status == 0, ended.said
    with Record(lab_url(url)) as lab:
        there = sorted(lab.runs(), key=lambda run: run.created)
        assert len(there) == len(runs)
        found = [held(lab, run.run) for run in there]
    assert [each["kept"] for each in found] == [each["kept"] for each in expected]
    assert [each["readings"] for each in found] == [each["readings"] for each in expected]
    return survived
