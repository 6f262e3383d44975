"""The page Import in a browser: a foreign file is named by drop-downs, drawn, asked about, and stored as a run."""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from rig.record import Record
from rig.services.importing import open_file, units_for
from rig.web.pages.import_file import _sample_text
from rig.web.upload import MOST_BYTES, place_upload
from tests.browser.conftest import Workbench
from tests.calibrations.test_turn_logs import log as turn_log

pytestmark = pytest.mark.slow

STILL_NEEDED = 'Still needed: the column of the angle beta (beta_deg). Select it under "meaning".'


def foreign(folder: Path, clock: str = "Takt") -> Path:
    """125 poses in 12.4 minutes, outputs in mV, with names of another laboratory."""
    rng = np.random.default_rng(5)
    rows = []
    for k in range(125):
        alpha, beta = (90, 60, 120, 45, 135)[k // 25], (k % 25) * 15
        load = np.sin(np.radians(alpha)) * np.array([np.cos(np.radians(beta)), np.sin(np.radians(beta))])
        x, y = 2500 + 1000 * load + 0.2 * rng.standard_normal(2)
        rows.append(f"{0.1 * k:.1f};{alpha};{beta};{x:.3f};{y:.3f};ok")
    path = folder / "theirs.csv"
    path.write_text(f"{clock};inclination;table;Ux;Uy;state\n" + "\n".join(rows) + "\n")
    return path


def choose(page: Page, field: str, value: str) -> None:
    page.get_by_label(field, exact=True).click()
    page.get_by_role("option", name=value, exact=True).click()
    expect(page.get_by_role("option")).to_have_count(0)  # the list has closed


def test_a_log_of_a_gyroscope_with_an_accelerometer_is_imported_as_turns(workbench: Workbench, tmp_path: Path) -> None:
    path = turn_log(tmp_path)
    page = workbench.visit(f"/import?file={quote(str(path))}")
    choose(page, "Kind of table", "Turns: a gyroscope with an accelerometer, between rests")
    expect(page.get_by_text("rows of turns")).to_be_visible()
    expect(page.get_by_role("button", name="Import", exact=True)).to_be_enabled()
    workbench.shot(page, "import-turns")


def test_a_file_is_imported_by_drop_downs(workbench: Workbench, tmp_path: Path) -> None:
    path = foreign(tmp_path)
    page = workbench.visit("/record")
    page.get_by_role("button", name="Import a file").click()
    page.locator("input[type=file]").set_input_files(path)
    expect(page.get_by_text("Import theirs.csv")).to_be_visible()
    expect(page).to_have_title("Import theirs.csv – rig")
    for column, name in (("inclination", "alpha_deg"), ("table", "beta_deg"), ("Ux", "vx_v"), ("state", "other")):
        expect(page.get_by_label(f"meaning of {column}", exact=True)).to_have_value(name)
    expect(page.get_by_label("unit of Ux")).to_have_value("mV")
    button = page.get_by_role("button", name="Import", exact=True)
    expect(button).to_be_enabled()
    expect(page.locator("[aria-label='Data as imported'] .points path")).to_have_count(250)
    workbench.shot(page, "import")
    choose(page, "unit of Ux", "V")
    expect(page.get_by_role("alert")).to_contain_text("no sensor output exceeds")
    expect(page.get_by_role("alert")).not_to_contain_text("--column")
    expect(button).to_be_disabled()
    choose(page, "unit of Ux", "mV")
    expect(button).to_be_enabled()
    choose(page, "meaning of table", "other")
    expect(page.get_by_text(STILL_NEEDED)).to_be_visible()
    expect(page).to_have_url(re.compile("column=table&meaning=&unit=$"))
    page.reload()
    expect(page.get_by_text(STILL_NEEDED)).to_be_visible()
    expect(page.get_by_label("meaning of table", exact=True)).to_have_value("other")
    choose(page, "meaning of table", "beta_deg")
    page.get_by_label("Serial number").fill("17")
    expect(page).to_have_url(re.compile(r"/import\?file=.*theirs\.csv&serial=17$"))
    page.reload()  # as a page does by itself whose server has started again
    expect(page.get_by_label("Serial number")).to_have_value("17")
    expect(button).to_be_enabled()
    workbench.fits(page)
    workbench.shot(page, "import-tablet")
    button.click()
    page.wait_for_url("**/?data=*")
    with Record() as record:
        run = record.runs()[0]
        columns = record.columns(run.run)[0]
    assert run.constants["serial"] == "17"
    assert columns["vx_v"][0] == pytest.approx(3.5, abs=1e-3)


def test_a_time_that_fits_minutes_gives_a_question(workbench: Workbench, tmp_path: Path) -> None:
    page = workbench.visit(f"/import?file={quote(str(foreign(tmp_path, 'time')))}")
    question = page.get_by_role("group", name="Unit of the time")
    expect(question).to_contain_text("It runs from 0 to 12.4; in s this is 0.1 s from one pose to the next")
    expect(question).to_contain_text("It fits min.")
    button = page.get_by_role("button", name="Import", exact=True)
    expect(page.locator("[aria-label='Data as imported'] .points path")).to_have_count(250)
    expect(button).to_be_disabled()
    page.emulate_media(color_scheme="dark")
    workbench.shot(page, "import-asked")
    question.get_by_role("button", name="min", exact=True).click()
    expect(question).to_have_count(0)
    expect(page.get_by_text("0 to 744 s")).to_be_visible()
    page.reload()
    expect(page.get_by_text("0 to 744 s")).to_be_visible()  # the answer is kept
    expect(page.get_by_label("unit of time")).to_have_value("min")
    expect(question).to_have_count(0)
    button.click()
    page.wait_for_url("**/?data=*")
    with Record() as record:
        assert record.columns(record.runs()[0].run)[0]["t_s"][-1] == pytest.approx(744.0)


def test_a_chosen_column_has_the_unit_of_the_header_and_the_time_gives_a_question(
    workbench: Workbench, tmp_path: Path
) -> None:
    path = foreign(tmp_path, "Zeit")
    head, _, rows = path.read_text().partition("\n")
    names = {"inclination": "Winkel1 [deg]", "table": "Winkel2 [deg]", "Ux": "Kanal A / mV", "Uy": "Kanal B / mV"}
    for theirs, german in names.items():
        head = head.replace(theirs, german)
    path.write_text(f"{head}\n{rows}")
    page = workbench.visit(f"/import?file={quote(str(path))}")
    meanings = ("alpha_deg", "beta_deg", "vx_v", "vy_v")
    for german, meaning in zip(("Zeit", *names.values()), ("t_s", *meanings), strict=True):
        choose(page, f"meaning of {german}", meaning)
    expect(page.get_by_label("unit of Kanal A / mV")).to_have_value("mV")
    question = page.get_by_role("group", name="Unit of the time")
    expect(question).to_contain_text("It fits min.")
    expect(page.get_by_role("button", name="Import", exact=True)).to_be_disabled()
    choose(page, "unit of Kanal A / mV", "V")
    expect(page.get_by_text("1500.1 to 3500 V")).to_be_visible()  # what is shown is what is used


def test_the_model_page_opens_the_import_of_a_file_without_known_names(workbench: Workbench, tmp_path: Path) -> None:
    page = workbench.visit(f"/?data={quote(str(foreign(tmp_path)))}")
    alert = page.get_by_role("alert")
    expect(alert).to_contain_text("Cannot analyse")
    assert "rig import" not in alert.inner_text()
    alert.get_by_role("button", name="Import").click()
    expect(page.get_by_text("Import theirs.csv")).to_be_visible()


def test_an_uploaded_file_replaces_no_other_of_its_name(tmp_path: Path) -> None:
    for content, name in (("a", "log.csv"), ("b", "log-2.csv"), ("a", "log.csv"), ("c", "log-3.csv")):
        (draft := tmp_path / "draft").write_text(content)
        path = place_upload(draft, tmp_path / "log.csv")
        assert (path.name, path.read_text(), draft.exists()) == (name, content, False)


def test_a_file_that_cannot_be_read_gives_the_reason(workbench: Workbench, tmp_path: Path) -> None:
    (broken := tmp_path / "broken.csv").write_text("only words\nare here\n")
    page = workbench.visit(f"/import?file={quote(str(broken))}")
    expect(page.get_by_role("alert")).to_contain_text("broken.csv")
    page.get_by_role("alert").get_by_role("button", name="Another file").click()
    expect(page.get_by_text("Import a file")).to_be_visible()
    page.goto(f"{workbench.origin}/import?file=nothing.csv")
    expect(page.get_by_role("alert")).to_contain_text("nothing.csv")


def test_a_file_that_is_too_large_gives_the_remedy(workbench: Workbench, tmp_path: Path) -> None:
    with (large := tmp_path / "large.csv").open("wb") as file:
        file.truncate(MOST_BYTES + 1)
    page = workbench.visit("/import")
    page.locator("input[type=file]").set_input_files(large)
    expect(page.get_by_role("alert")).to_contain_text("larger than 200 MB. Copy it")


def test_a_file_with_several_tables_asks_for_one(workbench: Workbench, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "two.h5"
    random = np.random.default_rng(2)
    with h5py.File(path, "w") as file:
        for name, rows in (("front", 300), ("rear", 200)):
            for k, axis in enumerate("xyz"):
                file[f"{name}/a{axis}"] = (k == 2) + 1e-3 * random.standard_normal(rows)
    page = workbench.visit(f"/import?file={quote(str(path))}")
    expect(page.get_by_text("two.h5 has 2 tables")).to_be_visible()
    expect(page.get_by_role("button", name="front (300 rows: ax, ay, az)")).to_be_visible()
    page.get_by_role("button", name="rear (200 rows: ax, ay, az)").click()
    expect(page.get_by_label("Table of the file")).to_have_value("rear")
    expect(page.get_by_label("meaning of ax", exact=True)).to_have_value("ax")
    choose(page, "Table of the file", "front")
    expect(page.get_by_label("Table of the file")).to_have_value("front")
    expect(page.get_by_label("meaning of ax", exact=True)).to_have_value("ax")


def test_a_table_chosen_by_the_program_has_a_hint_to_choose_another(workbench: Workbench, tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "one.h5"
    random = np.random.default_rng(2)
    with h5py.File(path, "w") as file:
        for k, axis in enumerate("xyz"):
            file[f"imu/a{axis}"] = (k == 2) + 1e-3 * random.standard_normal(300)
        file["battery/voltage"] = np.linspace(12.0, 11.0, 20)
    page = workbench.visit(f"/import?file={quote(str(path))}")
    expect(page.get_by_label("Table of the file")).to_have_value("imu")
    choose(page, "Kind of table", "Still record: single samples at rest")
    expect(page.locator("body")).not_to_contain_text("--topic")


def test_a_unit_that_does_not_fit_the_values_gives_a_question(workbench: Workbench, tmp_path: Path) -> None:
    turn = "".join(f"90,{beta},{2500 + 1000 * np.cos(np.radians(beta)):.3f}\n" for beta in range(0, 360, 15))
    (path := tmp_path / "ours.csv").write_text(f"alpha_deg,beta_deg,vx_v\n{turn}")
    page = workbench.visit(f"/import?file={quote(str(path))}")
    question = page.get_by_role("group", name="Unit of vx_v")
    expect(page.get_by_role("alert")).not_to_contain_text("import it")
    question.get_by_role("button", name="mV", exact=True).click()
    expect(question).to_have_count(0)
    expect(page.get_by_text("24 rows of poses")).to_be_visible()
    expect(page.get_by_text("1.5 to 3.5 V")).to_be_visible()
    page.reload()
    expect(page.get_by_text("1.5 to 3.5 V")).to_be_visible()
    expect(page.get_by_label("unit of vx_v")).to_have_value("mV")
    page.goto(f"{workbench.origin}/import?file={quote(str(path))}")
    question.get_by_role("button", name="V", exact=True).click()
    expect(page.get_by_text("1500 to 3500 V")).to_be_visible()
    page.reload()  # also the unit that was asked about and confirmed is kept
    expect(page.get_by_text("1500 to 3500 V")).to_be_visible()
    expect(question).to_have_count(0)


def test_an_import_can_be_cancelled(workbench: Workbench, tmp_path: Path) -> None:
    (path := tmp_path / "one.csv").write_text("alpha_deg,beta_deg,vx_v\n90,0,3.5\n")
    page = workbench.visit(f"/import?file={quote(str(path))}")
    expect(page.get_by_text("1 row of poses")).to_be_visible()
    page.get_by_role("button", name="Cancel").click()
    page.wait_for_url("**/record")


def test_a_column_shows_the_range_of_its_first_rows(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("ax,ay,az\n" + "".join(f"{2.5 + 1e-4 * k:.4f},0.5,1.5\n" for k in range(20_000)))
    sheet = open_file(path)
    rows = len(sheet.sample)
    assert rows < 20_000
    assert _sample_text(sheet, "ax").startswith("2.5, 2.5001, 2.5002 … (first ")
    assert f"(first {rows} rows: 2.5 to " in _sample_text(sheet, "ax")
    assert {"V", "mV"} <= set(units_for("ax"))
