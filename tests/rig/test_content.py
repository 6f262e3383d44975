"""The content of data and model: an open session never shows an analysis of other rows than the record has."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any, cast

import pytest

from calibrations.discovery.findings import Findings
from calibrations.errors import DataError
from rig.record import Record
from rig.services.content import Content, content_of
from rig.services.exclusion import exclude
from rig.services.export import export
from rig.web.desk import Desk
from tests import recorded


@pytest.fixture
def run(rig_home: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    shutil.copytree(recorded.record(tmp_path_factory, "sweep"), rig_home)
    with Record() as record:
        return record.runs()[0].run


def test_the_key_follows_rows_exclusions_and_the_model(run: str, tmp_path: Path) -> None:
    key = content_of(run, "linear").key
    assert content_of("last", "linear").key == key
    with Record() as record:
        exclude(record, run, [3], "a bump")
    assert content_of(run, "linear").key != key
    with Record() as record:
        exclude(record, run, [3], None)
    assert content_of(run, "linear").key == key
    assert content_of(run, "physical").key != key
    (model := tmp_path / "model.yaml").write_text("one")
    before = content_of(run, str(model))
    model.write_text("two")
    assert content_of(run, str(model)).key != before.key


def test_a_session_of_changed_data_is_made_anew_with_its_effects(run: str) -> None:
    desk = Desk(None)
    session = desk.open(run, "linear")
    desk.keep(run, "linear", session.with_step(session.tried(session.effects["axis-misalignment"])))
    assert desk.open(run, "linear").names == ("axis-misalignment",)
    with Record() as record:
        exclude(record, run, [3, 4], "a bump")
    again = desk.open(run, "linear")
    assert again.names == ("axis-misalignment",)
    assert again.end.table.n == session.end.table.n - 2
    assert "have changed" in again.change
    desk.keep(run, "linear", again)
    assert not desk.open(run, "linear").change, "it is shown once"
    with Record() as record:
        exclude(record, run, [5], "a bump")
    desk.updates.add((run, "linear", ""))
    assert not desk.open(run, "linear").change, "the page has shown it"


def test_pages_and_reports_share_the_searches_on_one_model_while_the_data_are_the_same(run: str) -> None:
    desk = Desk(None)
    session = desk.open(run, "")
    session.plans[()] = (made := cast(Findings[Any], object()))
    assert desk.beginning(run).search_made is made
    assert desk.open(run, "linear").data is session.data
    assert desk.beginning(run, "linear").first_search(pytest.fail) is made
    assert Desk(None).open(run, "linear").search_made is None
    assert desk.beginning(run, "physical").search_made is None
    with Record() as record:
        exclude(record, run, [3, 4], "a bump")
    assert desk.beginning(run).search_made is None
    changed = desk.open(run, "")
    assert changed.data is desk.beginning(run).data
    assert changed.search_made is None
    desk.forget(run)
    assert desk.beginning(run).data is not changed.data


def test_a_page_opens_while_another_thread_opens_one(run: str, monkeypatch: pytest.MonkeyPatch) -> None:
    desk = Desk(None)
    opened, _ = desk.open(run, "linear"), desk.open(run, "physical")

    def meanwhile(*names: Any) -> Content:
        desk.beginnings[str(len(desk.beginnings)), "", ""] = opened
        return content_of(*names)

    monkeypatch.setattr("rig.services.content.content_of", meanwhile)
    with Record() as record:
        exclude(record, run, [3], "a bump")
    assert desk.beginning(run, "linear").data is not opened.data


def test_effects_are_restored_from_texts_also_by_another_server(run: str) -> None:
    session = Desk(None).open(run, "linear")
    own = session.with_added(["my-effect=a*sin(2*beta)", "nothing-such"])
    assert own.added == ("my-effect=a*sin(2*beta)",)
    assert own.notes[-1].startswith("nothing-such is not in the model any more")
    assert own.with_added([]).added == ()
    assert own.with_added([]).with_added(own.added).added == own.added
    assert Desk(None).open(run, "linear", own.added).added == own.added
    assert Desk(None).open(run, "linear").added == own.added


def test_several_data_are_one_table_whose_content_follows_each(run: str, tmp_path: Path) -> None:
    exported = tmp_path / "same.csv"
    export(run, "csv", exported)
    both = f"{run} + {exported}"
    session = Desk(None).open(both, "linear")
    assert session.end.table.n == 2 * Desk(None).open(run, "linear").end.table.n
    assert content_of(both, "linear").extent == "114 poses + a file"
    key = content_of(both, "linear").key
    exported.write_text(exported.read_text().replace("90", "90.5", 1))
    assert content_of(both, "linear").key != key
    with pytest.raises(DataError, match="given twice"):
        Desk(None).open(f"{run} + last", "linear")


def test_a_session_with_a_noise_model_is_another_one(run: str, tmp_path: Path) -> None:
    noise = tmp_path / "noise.yaml"
    values = "".join(f"  - {{name: coefficient, axis: {axis}, value: 1.0e-5, unit: V/sqrt(Hz)}}\n" for axis in "xy")
    head = "schema: rig.model/1\nname: noise\nunit: V\neffects:\n- effect: white-noise\n  parameters:\n"
    noise.write_text(head + values)
    desk = Desk(None)
    own, known = desk.open(run, "linear"), desk.open(run, "linear", noise=str(noise))
    assert not own.start.noise.given
    assert known.start.noise.given
    assert desk.open(run, "linear") is own
    assert desk.open(run, "linear", noise=str(noise)) is known
