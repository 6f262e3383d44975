"""Every page: it fits a phone, a tablet and a desk, and people who use a screen reader can use it, light and dark."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, BrowserContext, expect

from tests.browser.conftest import PATIENCE_MS, TABLET, Watch
from tests.recorded import record

pytestmark = pytest.mark.slow
axe = pytest.importorskip("axe_playwright_python.sync_playwright")

WHOLE = {"width": 950, "height": 3000}  # one column: axe-core cannot judge colours in what scrolls or is sticky
PHONE = {"width": 390, "height": 844}
SETTLED = """() => Promise.all(document.getAnimations()
  .filter(each => each.effect.getComputedTiming().endTime !== Infinity).map(each => each.finished))"""
HYPHEN = re.compile(r".{0,20}(?<![\w.)\]:/-])-\d.{0,20}")  # before a number, in place of a minus sign
TEXTS = """() => [document.body.innerText, ...Array.from(document.querySelectorAll('svg text, iframe'),
  each => each.contentDocument ? each.contentDocument.body.innerText : each.textContent)].join("\\n")"""
GRAVE = ("serious", "critical")
SWEEP, NOISE = "20260101-120000-sweep-000", "20260131-120000-noise-floor-000"
PAGES = {  # address: an element of the complete page, and the title in the tab of the browser
    f"/?data={SWEEP}": (".card", f"Model of {SWEEP}"),
    f"/?data={NOISE}": ("[aria-label='The record'] .lines", f"Model of {NOISE}"),
    "/run": ("text=Turns alpha", "Run"),
    "/record": ("text=soak", "Record"),
    f"/record/{SWEEP}": (".report iframe", f"Run {SWEEP}"),
    "/history": ("text=Check standards", "History"),
    "/fleet": ("text=Many sensors at once", "Fleet"),
    "/history?sensor=simulated": ("[aria-label^='Quantit'] .points, .three .points", "History of simulated"),
    f"/compare?first={SWEEP}&second={SWEEP}": (
        "[aria-label='Residuals of both'] .points",
        f"Compare {SWEEP} and {SWEEP}",
    ),
    "/compare": ("text=Two runs are needed", "Compare"),
    "/import": ("text=Choose a file", "Import a file"),
}


@pytest.fixture(scope="module")
def laboratory(served: Callable[..., Any], tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of a workbench whose record holds a run of every sort."""
    said, home = served()
    shutil.copytree(record(tmp_path_factory, "laboratory"), home, dirs_exist_ok=True)
    return str(said["url"])


@pytest.fixture(scope="module", params=["light", "dark"])
def visitor_of(
    request: pytest.FixtureRequest, browser: Browser, watch: Watch, laboratory: str
) -> Iterator[tuple[BrowserContext, str]]:
    """A browser with the token, and the origin of the workbench."""
    context = watch.over(browser.new_context(viewport=WHOLE, color_scheme=request.param))
    context.set_default_timeout(PATIENCE_MS)
    context.request.get(laboratory)
    yield context, laboratory.partition("/?")[0]
    context.close()


@pytest.mark.parametrize("path", PAGES)
def test_every_page_fits_and_is_accessible(visitor_of: tuple[BrowserContext, str], path: str) -> None:
    shown, title = PAGES[path]
    context, origin = visitor_of
    page = context.new_page()
    page.goto(origin + path)
    expect(page.locator(shown).first).to_be_attached(timeout=PATIENCE_MS)
    expect(page).to_have_title(f"{title} – rig")
    page.evaluate(SETTLED)
    found = [each for each in axe.Axe().run(page).response["violations"] if each["impact"] in GRAVE]
    assert [(each["id"], each["nodes"][0]["html"], each["nodes"][0]["failureSummary"]) for each in found] == []
    assert HYPHEN.findall(page.evaluate(TEXTS)) == []
    for size in (TABLET, PHONE):
        page.set_viewport_size(size)
        page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
    page.close()


def test_an_address_without_a_page_has_a_link_to_the_workbench(
    visitor_of: tuple[BrowserContext, str], watch: Watch
) -> None:
    context, origin = visitor_of
    page = context.new_page()
    page.goto(f"{origin}/nothing")
    expect(page.get_by_text("There is no such page")).to_be_visible()
    page.get_by_role("button", name="Record").click()
    page.wait_for_url("**/record")
    page.close()
    watch.expects("404")
