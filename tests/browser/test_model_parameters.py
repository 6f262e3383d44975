"""The calibration itself on the page Model: its parameters, what an added effect changes, and documents from them."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote
from zipfile import ZipFile

import pytest
from playwright.sync_api import Locator, Page, expect

from calibrations.model.file import read_model
from tests.browser.conftest import Workbench
from tests.browser.measured import hidden, wandering

pytestmark = pytest.mark.slow


def opened(workbench: Workbench, data: str) -> tuple[Page, Locator]:
    """The page on a file, and its box of parameters with values."""
    page = workbench.visit(f"/?data={quote(data)}")
    found = page.locator(".parameters")
    expect(found.locator("td").first).to_be_visible()
    return page, found


def made(page: Page, name: str) -> Path:
    """What the open dialog makes, as a file of that ending."""
    dialog = page.get_by_role("dialog")
    with page.expect_download() as download:
        dialog.get_by_role("button", name="Make and download").click()
    expect(dialog.get_by_text("Downloaded:")).to_be_visible()
    path = Path(download.value.path())
    assert download.value.suggested_filename.endswith(name)
    dialog.get_by_role("button", name="Close").click()
    return path


def test_parameters_show_what_an_effect_changes_and_make_documents(workbench: Workbench, tmp_path: Path) -> None:
    page, found = opened(workbench, hidden(tmp_path, "package turned"))
    expect(found.get_by_text("last change")).to_have_count(0)
    page.get_by_role("button", name="Add axis-misalignment").click()
    expect(found.get_by_text("last change")).to_be_visible()
    row = found.locator("tr", has_text="axis-misalignment").first
    expect(row).to_contain_text("mdeg")
    expect(row).to_contain_text("new")
    expect(found).to_contain_text("correlat")
    workbench.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.get_by_role("button", name="Copy table").click()
    expect(page.get_by_text("in the clipboard")).to_be_visible()
    lines = page.evaluate("navigator.clipboard.readText()").splitlines()
    assert lines[0].split("\t")[:3] == ["effect", "parameter", "axis"]
    assert len(lines) == 8
    with page.expect_download() as download:
        page.get_by_role("button", name="Download model").click()
    model = read_model(str(Path(download.value.path()).rename(tmp_path / "model.yaml")))
    assert model.effects == ("bias", "scale-factor", "axis-misalignment")
    page.get_by_role("button", name="Certificate").click()
    page.get_by_label("Customer").fill("Blue Buoys")
    page.get_by_role("button", name="Make and download").click()
    page.get_by_role("dialog").get_by_role("button", name="Cancel").click()
    expect(page.get_by_text("Cancelled. Nothing was downloaded.")).to_be_visible()
    certificate = made(page, ".html").read_text()
    assert "Blue Buoys" in certificate
    assert (
        "No values as found: no earlier calibration was given." in certificate
    )  # the model's values are from these data
    page.get_by_role("button", name="Compensation").click()
    page.get_by_label("Largest value of each axis (g)").fill("-1")
    page.get_by_role("button", name="Make and download").click()
    expect(page.get_by_role("dialog").get_by_role("alert")).to_contain_text("must be above 0")
    page.get_by_label("Largest value of each axis").fill("2")
    with ZipFile(made(page, ".zip")) as packed:
        assert {Path(name).suffix for name in packed.namelist()} == {".c", ".h"}
    workbench.shot(page, "parameters")
    workbench.fits(page)


def test_a_still_record_shows_its_noise_coefficients(workbench: Workbench, tmp_path: Path) -> None:
    page, found = opened(workbench, wandering(tmp_path))
    for symbol, unit in (("N", "µV/√Hz"), ("B", "below"), ("K", "µV/√s")):
        row = found.locator("tr", has=page.get_by_role("cell", name=symbol, exact=True))
        expect(row).to_contain_text(unit)
    expect(page.get_by_role("button", name="Certificate")).to_be_disabled()
