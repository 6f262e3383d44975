"""The page Fleet: the missing effects of a folder of sensors, as a report in the page; a folder without one."""

from __future__ import annotations

from pathlib import Path

import pytest
from playwright.sync_api import expect

from calibrations.importing.foreign import write_csv
from tests.browser.conftest import Workbench
from tests.calibrations import fleets

pytestmark = pytest.mark.slow


def test_a_folder_of_sensors_is_analysed_and_calibrated(workbench: Workbench, tmp_path: Path) -> None:
    (folder := tmp_path / "sensors").mkdir()
    for number in range(6):
        write_csv(fleets.sensor(number, fleets.Flaw(bend=0.004)), folder / f"s{number}.csv")
    page = workbench.visit("/history")
    page.goto(f"{workbench.origin}/fleet?source={tmp_path}")
    page.get_by_role("button", name="Find missing effects").click()
    expect(page.get_by_role("alert")).to_contain_text("no sensor in")
    page.get_by_label("Folder or index").fill(str(folder))
    page.get_by_role("button", name="Find missing effects").click()
    report = page.frame_locator("iframe")
    expect(report.get_by_role("heading", name="quadratic-nonlinearity missing in 1 batch")).to_be_visible()
    workbench.shot(page, "fleet")
    workbench.fits(page)
    page.get_by_role("button", name="Calibrate").click()
    expect(report.get_by_role("heading", name="6 sensors: calibrated together with their batches")).to_be_visible()
    with page.expect_download() as download:
        page.get_by_role("button", name="Download").click()
    assert download.value.suggested_filename == "fleet.html"
