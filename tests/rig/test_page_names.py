"""Names on the pages: labels of settings, own names of uploaded files, ids of runs in addresses."""

from __future__ import annotations

from pathlib import Path

from rig.files import home
from rig.record import Record
from rig.services.tables import with_run_ids
from rig.web.parts import for_page, with_labels


def test_a_message_on_settings_has_the_labels_of_the_form() -> None:
    names = ("step_deg", "inclinations_deg", "dwell_s", "paths")
    text = "sweep: step_deg is 'ten'; dwell_s must be above 0, not most_dwell_s; paths is grid"
    assert with_labels(text, names) == (
        'sweep: "step (deg)" is \'ten\'; "dwell (s)" must be above 0, not most_dwell_s; paths is grid'
    )


def test_an_uploaded_file_has_its_own_name() -> None:
    assert for_page(f"{home()}/files/theirs.csv: line 3: no number") == "theirs.csv: line 3: no number"
    assert for_page("/data/theirs.csv: line 3: no number") == "/data/theirs.csv: line 3: no number"


def test_last_becomes_the_id_of_a_run(tmp_path: Path) -> None:
    def begin(procedure: str) -> str:
        return record.begin(procedure, {}, bench={}, identities={}, configuration="", source="a test", constants={})

    with Record() as record:
        sweep, soak = begin("sweep"), begin("soak")
    assert with_run_ids("last") == soak
    assert with_run_ids("last sweep") == sweep
    assert with_run_ids("last sweep + last/a1") == f"{sweep} + {soak}/a1"
    assert with_run_ids(sweep) == sweep
    (file := tmp_path / "last").write_text("a table")
    for unknown in ("nobody", "", str(file)):
        assert with_run_ids(unknown) == unknown
