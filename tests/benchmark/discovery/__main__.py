"""`python -m tests.benchmark.discovery [--sets N] [--rows single,pair]`: the table of demands, ours beside its peers.

Each set's record is appended to a file as soon as it is there, so that a benchmark that was killed goes on. The file is
named by what the analysis' sources are: another analysis begins anew.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import zip_longest
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from tests.benchmark.child import ROOT
from tests.benchmark.discovery.one import attempt
from tests.benchmark.discovery.peers import PEERS
from tests.benchmark.discovery.score import figures
from tests.benchmark.discovery.sets import ROWS, Case, sets

WORKERS = 2
METHODS = ["ours", *PEERS, "told", "oracle"]


def main() -> None:
    asked = argparse.ArgumentParser(prog="python -m tests.benchmark.discovery")
    asked.add_argument("--sets", type=int, default=40, help="of each row; single and unknown causes: at each strength")
    asked.add_argument("--rows", default=",".join(ROWS))
    asked.add_argument("--file", type=Path, default=ROOT / "out" / f"discovery-{_version()}.jsonl")
    given = asked.parse_args()
    rows = [sets(row, given.sets) for row in given.rows.split(",")]
    cases = [case for some in zip_longest(*rows) for case in some if case]  # each row has some, whenever it ends
    records = measured(cases, given.file)
    found = figures(records, METHODS)
    print(markdown(found), file=sys.stderr)
    json.dump({"schema": "rig.benchmark.discovery/1", "sets": len(records), "figures": found}, sys.stdout, indent=1)
    print()


def measured(cases: list[Case], file: Path) -> list[dict[str, Any]]:
    """The records of all cases; those that the file holds are not made again."""
    file.parent.mkdir(exist_ok=True)
    text = file.read_text() if file.exists() else ""
    file.write_text(text := text[: text.rfind("\n") + 1])  # a line that a kill has cut is made again
    known = {record["key"]: record for record in map(json.loads, text.splitlines())}
    left = [case for case in cases if case.key not in known]
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # of the workers, which are new processes
    with file.open("a") as out, ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
        for done in as_completed([pool.submit(attempt, case) for case in left]):
            record = done.result()
            known[record["key"]] = record
            out.write(json.dumps(record) + "\n")
            out.flush()
    return [known[case.key] for case in cases if "failed" not in known[case.key]]


def markdown(found: list[dict[str, Any]]) -> str:
    """A table as the demands have it."""
    methods = [name for name in METHODS if any(name in each for each in found)]
    lines = [["", "sets", "demand", *methods, "met"]]
    for each in found:
        wanted = f"{'at most' if each['sign'] == '<' else 'at least'} {100 * each['wanted']:g} %"
        values = [f"{100 * each[m]:.1f} %" if m in each else "" for m in methods]
        lines.append([each["demand"], str(each["sets"]), wanted, *values, "yes" if each["met"] else "NO"])
    lines.insert(1, ["---"] * len(lines[0]))
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _version() -> str:
    """Eight digits of what the analysis and the benchmark's generators are."""
    files = [*(ROOT / "calibrations").rglob("*.py"), *Path(__file__).parent.glob("*.py")]
    return hashlib.sha256(b"".join(file.read_bytes() for file in sorted(files))).hexdigest()[:8]


if __name__ == "__main__":
    main()
