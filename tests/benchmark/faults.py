"""Every fault of every instrument in every procedure, at random moments: `python -m tests.benchmark.faults [MOMENTS]`.

Each run must end complete and right, or stopped safely with a run that goes on (tests/rig/enduring.py); the first that
does not is named, and makes the exit status 1. With `--page`, the table in docs/faults.md is written anew; what was not
tried this time stays there in parentheses. With `--out FILE`, cases that the file has are not tried again.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import time
from collections import Counter
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from drivers.errors import LimitError
from drivers.transport.faults import EFFECTS, Fault, Kind, kinds_of
from procedures.errors import ProcedureError
from tests.rig.enduring import BENCH, FAULTS, OTHER_FAULTS, OTHER_PARTS, PROCEDURES, endured, moment

PAGE = Path(__file__).parents[2] / "docs" / "faults.md"
KINDS = ("<!-- kinds -->\n", "<!-- end of kinds -->\n")
TABLE = ("<!-- made by tests.benchmark.faults -->\n", "<!-- end -->\n")
SHORT = {"complete": "c", "stopped": "s", "not begun": "n"}
BROKEN = "BROKEN"
IMPOSSIBLE = "impossible"  # the bench has not what the procedure needs; no part of the page
DRIVERS = {role: part.driver for role, part in BENCH.instruments.items()}
EVERY = [("", role, what) for role, what in FAULTS] + OTHER_FAULTS  # driver in place of the bench's, role, fault
ROWS = {(driver or DRIVERS[role], what) for driver, role, what in EVERY}


@dataclass(frozen=True)
class Case:
    """One run: what was to be endured, how it ended, and what did not hold."""

    procedure: str
    role: str
    what: str
    seed: int
    end: str = ""
    why: str = ""
    driver: str = ""  # in place of that of the bench
    guided: bool = False

    @property
    def row(self) -> tuple[str, str]:
        """Driver and fault."""
        return self.driver or DRIVERS[self.role], self.what


def tried(case: Case) -> Case:
    """Run it."""
    try:
        at_s = moment(case.procedure, case.role, case.what, case.seed, case.driver)
    except (LimitError, ProcedureError):  # without any fault, such as a magnetometer's turn of an accelerometer
        return replace(case, end=IMPOSSIBLE)
    try:
        fault = Fault(case.what, at_s=at_s)
        end, why = endured(case.procedure, case.role, fault, case.driver, case.guided), ""
    except BaseException as error:  # whatever it is, the others are tried
        end, why = BROKEN, f"{type(error).__name__}: {error}".partition("\n")[0]
    return replace(case, end=end, why=why)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("moments", nargs="?", type=int, default=1)
    parser.add_argument("--procedures", default=",".join(PROCEDURES))
    parser.add_argument("--drivers", default="", help="Only these.")
    parser.add_argument("--guided", action="store_true", help="A person is asked, and resumes at once.")
    parser.add_argument("--every", type=int, default=1, help="Try one of so many.")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    parser.add_argument("--out", type=Path, help="Add the cases to this file, a line of JSON each.")
    parser.add_argument("--page", action="store_true")
    asked = parser.parse_args()
    wanted = [
        Case(procedure, role, what, seed, driver=driver, guided=asked.guided)
        for procedure in asked.procedures.split(",")
        for driver, role, what in EVERY
        for seed in range(asked.moments)
        if not asked.drivers or (driver or DRIVERS[role]) in asked.drivers.split(",")
    ]
    known = [] if asked.out is None else read(asked.out)
    done_already = {_asked(case) for case in known}
    wanted = [case for case in wanted[:: asked.every] if _asked(case) not in done_already]
    began = time.perf_counter()
    with TemporaryDirectory() as home:
        os.environ["RIG_HOME"] = home
        with ProcessPoolExecutor(asked.processes) as pool:
            run = [_kept(case, asked.out) for case in pool.map(tried, wanted)]
    impossible = sorted({f"{case.procedure} with {case.row[0]}" for case in run if case.end == IMPOSSIBLE})
    done = [case for case in (*known, *run) if case.end != IMPOSSIBLE]
    if asked.page:
        write(done)
    broken = [case for case in done if case.end == BROKEN]
    ends = Counter(case.end for case in done)
    seconds = time.perf_counter() - began
    print(json.dumps({"runs": len(done), "seconds": seconds, "ends": ends, "impossible": impossible}))
    for case in broken:
        print(f"{case.procedure}, {case.row}, {case.what}, seed {case.seed}: {case.why}", file=sys.stderr)
    return int(bool(broken))


def read(file: Path) -> list[Case]:
    """The cases of a file, which need not exist yet."""
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return [Case(**json.loads(line)) for line in lines]


def _asked(case: Case) -> Case:
    """The case without what became of it."""
    return replace(case, end="", why="")


def _kept(case: Case, out: Path | None) -> Case:
    """The case, in the file as soon as it is known: all of them take long."""
    if out is not None:
        with out.open("a", encoding="utf-8") as file:
            file.write(json.dumps(vars(case)) + "\n")
    return case


def write(done: list[Case]) -> None:
    """Both tables in the page, made anew."""
    text = PAGE.read_text(encoding="utf-8")
    text = _between(text, KINDS, kinds())
    made = table(done, cells(text.partition(TABLE[0])[2].partition(TABLE[1])[0]))
    PAGE.write_text(_between(text, TABLE, made) if done else text, encoding="utf-8")


def _between(text: str, marks: tuple[str, str], new: str) -> str:
    head, _, rest = text.partition(marks[0])
    _, _, tail = rest.partition(marks[1])
    return f"{head}{marks[0]}{new}{marks[1]}{tail}"


def cells(made: str) -> dict[tuple[str, str], dict[str, str]]:
    """Driver and fault -> procedure -> letters, of a table that was made earlier."""
    head, *rows = re.findall(r"^\| ([\w-]+) \| ([\w-]+) \| (.*) \|$", made, re.MULTILINE) or [("", "", "")]
    columns = head[2].split(" | ")
    texts = {(driver, what): [cell.strip(" ()") for cell in row.split("|")] for driver, what, row in rows[1:]}
    return {key: dict(zip(columns, row, strict=True)) for key, row in texts.items()}


def table(done: list[Case], earlier: Mapping[tuple[str, str], Mapping[str, str]]) -> str:
    """Faults by driver, in rows, against procedures: the letters of how each run ended, the most frequent first.

    A case that was not tried now has the letters of the earlier table, in parentheses.
    """
    procedures = PROCEDURES
    rows: dict[tuple[str, str], dict[str, Counter[str]]] = {}
    for case in done:
        row = rows.setdefault(case.row, {})
        row.setdefault(case.procedure, Counter())[SHORT.get(case.end, BROKEN)] += 1
    guided = sum(case.guided for case in done)
    lines = [f"{len(done)} runs, {guided} of them guided: {_summary(done)}.\n",
             f"| driver | fault | {' | '.join(procedures)} |",
             f"| --- | --- | {' | '.join('---' for _ in procedures)} |"]  # fmt: skip
    for driver, what in sorted({*rows, *earlier}):
        letters = [_letters(rows.get((driver, what), {}), earlier.get((driver, what), {}), p) for p in procedures]
        lines.append(f"| {driver} | {what} | {' | '.join(letters)} |")
    return "\n".join(lines) + "\n"


def _letters(now: Mapping[str, Counter[str]], before: Mapping[str, str], procedure: str) -> str:
    """One cell."""
    if procedure in now:
        return " ".join(letter for letter, _ in now[procedure].most_common())
    return f"({before[procedure]})" if before.get(procedure) else ""


def _summary(done: list[Case]) -> str:
    ends = Counter(case.end for case in done)
    return ", ".join(f"{ends[end]} {end}" for end in (*SHORT, BROKEN) if ends[end] or end == BROKEN)


def kinds() -> str:
    """All faults, for the page: those of every wire, then those of each twin."""
    lines = ["| of | fault | usual size | what it does |", "| --- | --- | --- | --- |"]
    common = {what: kind for what, (kind, _) in EFFECTS.items()}
    lines += [_kind("every wire", what, kind) for what, kind in common.items()]
    for driver in sorted({*DRIVERS.values(), *OTHER_PARTS}):
        own = {what: kind for what, kind in kinds_of(driver).items() if what not in common}
        lines += [_kind(driver, what, kind) for what, kind in own.items()]
    return "\n".join(lines) + "\n"


def _kind(of: str, what: str, kind: Kind) -> str:
    size = f"{kind.size:g} {kind.unit}".strip() if kind.size else ""
    return f"| {of} | `{what}` | {size} | {kind.doc} |"


if __name__ == "__main__":
    sys.exit(main())
