"""docs/faults.md names every fault that can be asked for, and has a table of what became of each."""

from __future__ import annotations

import re

from tests.benchmark.faults import DRIVERS, PAGE, ROWS, TABLE, Case, cells, kinds, table
from tests.rig.enduring import FAULTS, PROCEDURES

TEXT = PAGE.read_text(encoding="utf-8")


def test_every_fault_is_named_with_what_it_does() -> None:
    assert kinds() in TEXT, "make it anew: python -m tests.benchmark.faults --page 0"


def test_no_fault_of_any_procedure_was_broken_when_the_table_was_made() -> None:
    made = TEXT.partition(TABLE[0])[2].partition(TABLE[1])[0]
    assert re.search(r"^\d+ runs, \d+ of them guided: .*, 0 BROKEN\.$", made, re.MULTILINE)
    of_bench = {(DRIVERS[role], what) for role, what in FAULTS}
    rows = re.findall(r"^\| (\w+) \| ([\w-]+) \| (.*) \|$", made, re.MULTILINE)[1:]
    assert of_bench <= {(driver, what) for driver, what, _ in rows} <= ROWS
    assert all(len(cells.split("|")) == len(PROCEDURES) for *_, cells in rows)


def test_what_was_not_tried_now_stays_in_parentheses() -> None:
    first = [Case("sweep", "alpha", "stuck", 0, "stopped"), Case("repeat", "alpha", "stuck", 0, "complete")]
    second = [Case("sweep", "beta", "stuck", 1, "complete", guided=True)]
    made = table(second, cells(table(first, {})))
    assert made.startswith("1 runs, 1 of them guided: 1 complete, 0 BROKEN.\n")
    ends = cells(made)["oriental_az", "stuck"]
    assert (ends["sweep"], ends["repeat"], ends["soak"]) == ("c", "c", "")
    assert "| (c) |" in made
    assert table(second, cells(made)) == made
