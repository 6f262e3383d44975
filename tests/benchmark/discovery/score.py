"""Figures of the demands' table, from the records of sets."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable
from itertools import permutations
from typing import Any

Record = dict[str, Any]
WITHIN = 1.15  # noise floors on unseen poses


def right(record: Record, name: str) -> bool:
    """Whether a name is that of a cause, up to what the data can distinguish."""
    return any(name in names for names in record["equals"])


def exact(record: Record, named: list[str]) -> bool:
    """Whether each cause is named once, and nothing else."""
    return len(named) == len(record["equals"]) and matched(record, named) == len(named)


def matched(record: Record, named: list[str]) -> int:
    """The most causes that the names can stand for, each name for one."""
    causes = record["equals"]
    named = [name for name in named if right(record, name)][:6]
    padded = [*named, *[""] * len(causes)]
    return max(
        (sum(n in c for n, c in zip(chosen, causes, strict=True)) for chosen in permutations(padded, len(causes))),
        default=0,
    )


def false_alarm(record: Record, said: Record) -> bool:
    return bool(said["causes"]) or said["verdict"] == "unexplained"


def unexplained(record: Record, said: Record) -> bool:
    return bool(said["verdict"] == "unexplained")


def structure_right(record: Record, said: Record) -> bool:
    return bool(said.get("structure")) and re.search(record["structure"], said["structure"]) is not None


def listed(record: Record, said: Record) -> bool:
    """Whether the cause is in the list, and something that it can be taken for."""
    names = set(said.get("listed", ()))
    return bool(names & set(record["causes"][0])) and bool(
        names & (set(record["equals"][0]) - set(record["causes"][0]))
    )


def experiment_right(record: Record, said: Record) -> bool:
    return bool(said.get("experiment")) and re.search(record["experiment"], json.dumps(said["experiment"])) is not None


Judge = Callable[[Record, Record], bool | float | None]


def share(records: Iterable[Record], method: str, judge: Judge) -> tuple[float, int]:
    """Mean of a judgement over the sets that it applies to, and how many those are."""
    if method == "told" and judge not in (within, within_slow):
        return float("nan"), 0
    said = [(r, r["answers"][method]) for r in records if method in r["answers"]]
    values = [float(value) for r, a in said if (value := judge(r, a)) is not None]
    return (sum(values) / len(values) if values else float("nan")), len(values)


def first_place(record: Record, said: Record) -> bool:
    return bool(said["ranking"]) and right(record, said["ranking"][0])


def first_three(record: Record, said: Record) -> bool:
    return any(right(record, name) for name in said["ranking"][:3])


def one_cause(record: Record, said: Record) -> bool:
    return exact(record, said["causes"])


def recall(record: Record, said: Record) -> float:
    return matched(record, said["causes"]) / len(record["equals"])


def precision(record: Record, said: Record) -> float | None:
    return matched(record, said["causes"]) / len(said["causes"]) if said["causes"] else None


def within(record: Record, said: Record) -> bool | None:
    """Where there is no slow noise."""
    return None if said["error"] is None or _by_chance(record) or record["slow"] else said["error"] <= WITHIN


def within_slow(record: Record, said: Record) -> bool | None:
    """Where there is: a constant of the sensor is known no better than the noise wanders, by the oracle neither."""
    best = record["answers"].get("oracle")
    return None if best is None or _by_chance(record) or not record["slow"] else said["error"] <= WITHIN * best["error"]


def _by_chance(record: Record) -> bool:
    """Whether a random walk or a threshold that differs from pose to pose is a cause: no form foretells one."""
    return record["name"] in ("sampled/kicks", "sampled/threshold") or "wandering reference" in record["mechanisms"]


def quick(question: str, seconds: float) -> Judge:
    """Whether a question of ours took no longer, in processor time."""
    return lambda record, said: said[question] <= seconds if question in said else None


def at(*strengths: float) -> Callable[[Record], bool]:
    return lambda record: record["strength"] in strengths


def always(record: Record) -> bool:
    return True


# row of the table, row of sets, which of them, judgement, demand (at least, or with < at most)
DEMANDS: tuple[tuple[str, str, Callable[[Record], bool], Judge, str, float], ...] = (
    ("clean: false alarms", "clean", always, false_alarm, "<", 3 / 300),
    ("clean, slow noise as much as white: false alarms", "slow", always, false_alarm, "<", 6 / 300),
    ("single, faint: first place right", "single", at(0.3), first_place, ">", 0.90),
    ("single, weak: first place right", "single", at(3), first_place, ">", 0.98),
    ("single, medium and strong: first place right", "single", at(10, 30), first_place, ">", 0.99),
    ("single: in the first three", "single", always, first_three, ">", 0.99),
    ("single, weak and up: exactly the one cause", "single", at(3, 10, 30), one_cause, ">", 0.95),
    ("single, weak and up: wrongly unexplained", "single", at(3, 10, 30), unexplained, "<", 0.03),
    ("single, weak and up: unseen-pose error within 1.15", "single", at(3, 10, 30), within, ">", 0.95),
    ("the same under slow noise, of the oracle's", "single", at(3, 10, 30), within_slow, ">", 0.95),
    ("pairs: exact set", "pair", always, one_cause, ">", 0.90),
    ("pairs: recall", "pair", always, recall, ">", 0.95),
    ("pairs: precision", "pair", always, precision, ">", 0.95),
    ("pairs: wrongly unexplained", "pair", always, unexplained, "<", 0.03),
    ("pairs: unseen-pose error within 1.15", "pair", always, within, ">", 0.95),
    ("triples: exact set", "triple", always, one_cause, ">", 0.60),
    ("triples: recall", "triple", always, recall, ">", 0.92),
    ("triples: precision", "triple", always, precision, ">", 0.90),
    ("triples: wrongly unexplained", "triple", always, unexplained, "<", 0.20),
    ("outside, weak and up: unexplained", "unknown", at(3, 10, 30), unexplained, ">", 0.95),
    ("outside, weak and up: structure right", "unknown", at(3, 10, 30), structure_right, ">", 0.80),
    ("inseparable: listed", "inseparable", always, listed, ">", 0.90),
    ("inseparable: the experiment that tells", "inseparable", always, experiment_right, ">", 0.90),
    ("single: diagnose within 2 s", "single", always, quick("diagnose_s", 2), ">", 1.0),
    ("single: discover within 5 s", "single", always, quick("discover_s", 5), ">", 1.0),
    ("triples: discover within 20 s", "triple", always, quick("discover_s", 20), ">", 1.0),
    ("outside: discover within 20 s", "unknown", always, quick("discover_s", 20), ">", 1.0),
)


def figures(records: list[Record], methods: list[str]) -> list[dict[str, Any]]:
    """One entry for each demand that there are sets for: the share of each method, and whether ours meets it."""
    found = []
    for text, row, chosen, judge, sign, demand in DEMANDS:
        mine = [r for r in records if r["row"] == row and chosen(r)]
        shares = {method: share(mine, method, judge) for method in methods}
        ours, count = shares["ours"]
        if count:
            values = {method: round(value, 4) for method, (value, n) in shares.items() if n}
            met = ours <= demand if sign == "<" else ours >= demand
            found.append({"demand": text, "sign": sign, "wanted": demand, "sets": count, "met": met, **values})
    return found
