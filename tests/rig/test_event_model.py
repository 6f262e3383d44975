"""A run as event-model documents: valid by the schemas of their authors, and read by their tools."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import event_model
import pytest
from bluesky.callbacks import LiveTable
from bluesky.callbacks.core import CollectThenCompute

from rig.record import Record
from rig.record.measured import table_of
from tests.rig.conftest import Rig
from tests.rig.pushing import POSES, a_run, a_table


@pytest.fixture
def exported(rig: Rig, tmp_path: Path) -> Callable[[str], list[tuple[str, Any]]]:
    """Export a run and read the file back."""

    def read(run: str) -> list[tuple[str, Any]]:
        path = tmp_path / f"{run}.jsonl"
        assert rig("export", run, "--format", "event-model", "--out", str(path)).status == 0
        lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        return [(line["name"], line["doc"]) for line in lines]

    return read


class Collected(CollectThenCompute):
    """bluesky's own collector, which hands over what it has at the stop document."""

    def compute(self) -> None:
        """The rows are kept."""


@pytest.mark.parametrize("make", [a_run, a_table])
def test_every_document_is_valid(
    make: Callable[[Record], str], exported: Callable[[str], list[tuple[str, Any]]]
) -> None:
    with Record() as record:
        run = make(record)
    documents = exported(run)
    for name, document in documents:
        event_model.schema_validators[event_model.DocumentNames[name]].validate(document)
    assert {name for name, _ in documents} == {"start", "descriptor", "event", "stop"}


def test_bluesky_reads_the_values_of_the_table(exported: Callable[[str], list[tuple[str, Any]]]) -> None:
    with Record() as record:
        run = a_run(record)
        table = table_of(record, run)
    printed: list[str] = []
    collected, shown = Collected(), LiveTable(["beta_deg", "vx_v"], out=printed.append)
    router = event_model.RunRouter([lambda *_: ([collected, shown], [])])
    for name, document in exported(run):
        router(name, document)
    for name, column in table.columns.items():
        assert [event["data"][name] for event in collected._events] == list(column), name
    assert collected._start_doc["plan_name"] == "sweep"
    assert collected._stop_doc["exit_status"] == "success"
    rows = [line for line in printed if line[2:].lstrip()[:1].isdigit()]
    assert len(rows) == POSES
    assert f"{table.column('beta_deg')[-1]:.3f}" in rows[-1]
