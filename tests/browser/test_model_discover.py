"""Discover at a click, removal of any effect, places where the model fails, and downloads of pictures."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import TABLET, Workbench
from tests.browser.measured import two_faults

pytestmark = pytest.mark.slow

BARS = "[aria-label*=' by model'] .bars .point"
# the verdict with the error beside it, at each change
WATCH = """() => { window.seen = []; const text = name => document.querySelector(`.verdict ${name}`)?.textContent;
  const look = () => seen.push([text('.headline'), text('.figure .value')]);
  new MutationObserver(look).observe(document.querySelector('.verdict'),
    {subtree: true, childList: true, characterData: true}); look(); }"""


def test_all_effects_are_added_at_a_click_and_any_can_be_removed(workbench: Workbench, tmp_path: Path) -> None:
    page = workbench.visit(f"/?data={quote(two_faults(tmp_path))}")
    headline = page.locator(".verdict .headline").first
    expect(headline).to_contain_text("misses")
    page.locator(".places").get_by_role("button").first.click()
    expect(page.get_by_role("button", name="Clear selection")).to_be_visible()
    expect(page.get_by_role("button", name="Clear selection")).to_be_enabled()
    workbench.shot(page, "discover-places")
    page.set_viewport_size(TABLET)
    discover = page.get_by_role("button", name="Discover: add all 2 effects")
    expect(discover).to_be_in_viewport()
    page.set_viewport_size({"width": TABLET["height"], "height": TABLET["width"]})
    for name in ("Discover: add all 2 effects", "Add "):
        expect(page.get_by_role("button", name=name).first).to_be_in_viewport()
    page.evaluate(WATCH)
    discover.click()
    expect(page.get_by_text("Step 1 of 2: adding").or_(page.get_by_text("Step 2 of 2: adding"))).to_be_visible()
    expect(page.locator(BARS)).to_have_count(3)
    expect(headline).to_contain_text("Remaining error: 0.9")
    expect(page.get_by_role("button", name="Discover")).to_have_count(0)
    verdicts = {(verdict, error) for verdict, error in page.evaluate("seen") if not verdict.endswith(" ...")}
    assert len(verdicts) == len(dict(verdicts)) == 3, verdicts  # each verdict is that of the model with this error
    removes = page.locator(".added").get_by_role("button")
    expect(removes).to_have_count(2)
    names = [each.get_attribute("aria-label") or "" for each in removes.all()]
    workbench.shot(page, "discovered")
    page.get_by_role("button", name=names[0]).click()
    expect(removes).to_have_count(1)
    expect(page.get_by_role("button", name=names[1])).to_be_visible()
    expect(page.locator(BARS)).to_have_count(2)
    expect(headline).to_contain_text(f"misses {names[0].removeprefix('Remove ')}")
    workbench.fits(page)


def test_many_added_effects_are_folded_and_the_candidates_stay_in_view(workbench: Workbench, tmp_path: Path) -> None:
    added = ("axis-misalignment", "quadratic-nonlinearity", "cubic-nonlinearity", "z-axis-bias", "z-axis-scale")
    page = workbench.context.new_page()
    page.set_viewport_size(TABLET)
    chosen = "".join(f"&add={name}" for name in added)
    page.goto(f"{workbench.origin}/?data={quote(two_faults(tmp_path))}&model=linear{chosen}")
    title = page.get_by_text("Added: 5 effects")
    expect(title).to_be_visible()
    chip = page.get_by_role("button", name="Remove cubic-nonlinearity")
    expect(chip).to_be_hidden()
    expect(page.locator(".card .head").first).to_be_in_viewport()
    workbench.shot(page, "effects-folded")
    title.click()
    expect(chip).to_be_visible()
    chip.click()
    expect(page.get_by_text("Added:", exact=True)).to_be_visible()
    expect(page.get_by_role("button", name="Remove z-axis-bias")).to_be_visible()
    expect(chip).to_have_count(0)


def test_every_picture_is_downloaded_as_svg_and_png(workbench: Workbench, tmp_path: Path) -> None:
    page = workbench.visit(f"/?data={quote(two_faults(tmp_path))}")
    expect(page.locator("[aria-label='Residuals'] .points path").first).to_be_attached()
    expect(page.locator(BARS).first).to_be_attached()
    for title, form, begins in (("Residuals", "SVG", b"<?xml"), ("Error by model", "PNG", b"\x89PNG")):
        page.get_by_role("button", name=f"Download: {title}").click()
        with page.expect_download() as download:
            page.get_by_role("menuitem", name=form).or_(page.get_by_text(form, exact=True)).first.click()
        assert Path(download.value.path()).read_bytes().startswith(begins)
        assert download.value.suggested_filename == f"{title.lower().replace(' ', '-')}.{form.lower()}"
