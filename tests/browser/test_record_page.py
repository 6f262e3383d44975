"""The page Record in a browser: found, noted, compared, exported, reported."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from playwright.sync_api import expect

from calibrations.importing.foreign import read_csv
from drivers.recorder import Samples
from procedures.session import Pose
from rig.record import KeptPose, Record
from tests.browser.conftest import Workbench
from tests.browser.measured import hidden, wandering

BOTH, DIFFERENCE = "Residuals of both", "Difference second − first at common poses"


@pytest.fixture
def runs(workbench: Workbench, tmp_path: Path) -> Iterator[list[str]]:
    """Two imported tables and a soak of one block, oldest first."""
    tables = [read_csv(Path(hidden(tmp_path, "package turned", times))) for times in (40.0, 20.0)]
    with Record() as record:
        made = [record.add_table(table) for table in tables]
        parts = {"bench": {"seed": 1}, "identities": {}, "configuration": "abc", "source": "a bench"}
        made.append(record.begin("noise-floor", {}, constants={"sensor": "ADXL203"}, kind="still", **parts))
        block = Samples(np.array([[2.0, 1.0], [4.0, 1.0]]), ("vx", "vy"), 1000.0, 0.0)
        record.keep(made[-1], 0, KeptPose(Pose(0, 0, 0, "still 0"), block, 1.0, 22.0), None)
        yield made


@pytest.mark.slow
def test_runs_are_searched_and_one_is_opened_and_noted(workbench: Workbench, runs: list[str]) -> None:
    page = workbench.visit("/record")
    expect(page.get_by_role("cell", name=runs[0], exact=True)).to_be_visible()
    workbench.shot(page, "record")
    workbench.fits(page)
    page.get_by_label("Search").fill(runs[2])
    expect(page.get_by_role("row")).to_have_count(2)
    page.get_by_role("link", name=runs[2], exact=True).press("Enter")  # by the keyboard alone
    expect(page.get_by_text("its process was killed").first).to_be_visible()
    expect(page.locator("[aria-label='the run over time'] .points path")).to_have_count(1)
    page.get_by_label("Note").fill("the door was open")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("cell", name="the door was open")).to_be_visible()
    with Record() as record:
        assert [(event.what, event.text) for event in record.events(runs[2])] == [("note", "the door was open")]
    workbench.shot(page, "run")
    page.get_by_label("Note").fill(300 * "w")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("cell", name=300 * "w")).to_be_visible()
    assert page.locator(".events").evaluate("e => e.scrollWidth <= e.clientWidth")
    time = page.get_by_role("cell", name=re.compile(r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d$")).last
    assert time.evaluate("e => e.firstElementChild.clientHeight") < 30  # one line


@pytest.mark.slow
def test_runs_of_one_sensor_are_modelled_together(workbench: Workbench, runs: list[str]) -> None:
    page = workbench.visit("/record")
    for run in runs[:2]:
        page.get_by_role("row", name=run).get_by_role("checkbox").click()
    page.get_by_role("button", name="One model").click()
    expect(page.get_by_label("Data:")).to_have_value(f"{runs[0]} + {runs[1]}")
    expect(page.get_by_text("linear on 1036 poses")).to_be_visible()
    expect(page.get_by_role("alert")).to_have_count(0)


@pytest.mark.slow
def test_two_runs_are_compared(workbench: Workbench, runs: list[str]) -> None:
    page = workbench.visit("/record")
    for run in runs[:2]:
        page.get_by_role("row", name=run).get_by_role("checkbox").click()
    page.get_by_role("button", name="Compare").click()
    expect(page.get_by_text("Parameters of linear", exact=True)).to_be_visible()
    expect(page.get_by_role("cell", name="scale-factor scale x")).to_be_visible()
    for picture, dots in (("Differences of the parameters of linear", 4), (BOTH, 2 * 518), (DIFFERENCE, 518)):
        expect(page.locator(f"[aria-label='{picture}'] .points path")).to_have_count(dots)
    label = page.locator(f"[aria-label='{DIFFERENCE}'] .ytitle")
    expect(label).to_have_text("second − first, x (mV)")
    page.keyboard.press("x")
    page.keyboard.press("g")
    expect(label).to_have_text("second − first, y (mg)")
    workbench.shot(page, "compared")
    workbench.fits(page)
    expect(page.locator(".chosen .title").first).to_have_text(runs[0])  # the older one
    page.get_by_role("button", name="Swap").click()
    expect(page.locator(".chosen .title").first).to_have_text(runs[1])


@pytest.mark.slow
def test_data_of_two_kinds_are_not_compared_and_the_reason_is_shown(
    workbench: Workbench, runs: list[str], tmp_path: Path
) -> None:
    still = wandering(tmp_path)
    page = workbench.visit(f"/compare?first={quote(still)}&second={runs[0]}")
    expect(page.get_by_role("alert").first).to_contain_text("is of still")
    page.goto(f"{workbench.origin}/compare?first={quote(still)}&second={quote(still)}")
    expect(page.locator("[aria-label^='Allan deviation of both'] .points path").first).to_be_attached()


# Whether a table or a box around it is wider than its place.
CUT = """table => {
    let isCut = false;
    for (let box = table; box; box = box.parentElement) {
        isCut ||= box.scrollWidth > Math.min(box.clientWidth, innerWidth);
    }
    return isCut;
}"""


@pytest.mark.slow
def test_a_run_is_exported_and_reported(workbench: Workbench, runs: list[str], tmp_path: Path) -> None:
    page = workbench.visit(f"/record/{runs[0]}")
    with page.expect_download() as csv:
        page.get_by_role("button", name="CSV").click()
    csv.value.save_as(tmp_path / "exported.csv")
    assert read_csv(tmp_path / "exported.csv").n == 518
    with page.expect_download() as report:
        page.get_by_role("button", name="Report").click()
    text = Path(report.value.path()).read_text(encoding="utf-8")
    assert "misses axis-misalignment" in text
    printed = workbench.context.new_page()
    printed.set_viewport_size({"width": 1440, "height": 900})
    printed.set_content(text)
    budget = printed.get_by_role("table").filter(has_text="coverage factor")
    expect(budget.get_by_text("expanded uncertainty")).to_be_visible()
    assert budget.evaluate(CUT) is False


@pytest.mark.slow
def test_a_run_that_is_not_complete_is_called_so_once(workbench: Workbench) -> None:
    about: dict[str, Any] = {"bench": {"seed": 1}, "identities": {}, "configuration": "", "source": "a bench"}
    with Record() as record:
        name = record.begin("soak", {}, constants={"sensor": "ADXL203"}, **about)
        record.set_state(name, "stopped", "stopped by a person")
    page = workbench.visit(f"/record/{name}")
    expect(page.get_by_text("The run is not complete")).to_have_text(
        ["The run is not complete. Resume it on the page Run."]
    )
