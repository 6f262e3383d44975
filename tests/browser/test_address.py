"""The model page's state in its address, the notifications of a run, and its values at two metres."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from rig.web.address import ModelState, numbers, parse_state, ranges
from tests.browser.conftest import TABLET, Workbench
from tests.browser.measured import two_faults
from tests.browser.test_run_page import NIGHT, phase, started

CARD = "a*sin(2*beta)"
LARGE = "of => { const e = document.querySelector(of); return e && parseFloat(getComputedStyle(e).fontSize) >= 32 }"
ABOVE_THE_FOLD = """[...document.querySelectorAll('.live .bg-negative, .big-state, .tile')]
  .every(e => e.getBoundingClientRect().bottom < innerHeight)"""
NEWS = """window.news = []; window.Notification = class {
  static permission = "granted";
  static async requestPermission() { return "granted" }
  constructor(title, given) { window.news.push([title, given.body]) }
}"""


def test_a_selection_is_short_in_an_address() -> None:
    assert ranges((0, 1, 2, 5, 7, 8)) == "0-2,5,7-8"
    assert numbers("0-2,5,7-8") == (0, 1, 2, 5, 7, 8)
    assert numbers("") == numbers("a-b") == numbers("1-99999999") == ()


def test_an_address_with_an_empty_list_of_effects_differs_from_one_without_a_list() -> None:
    from starlette.datastructures import QueryParams

    for state in (ModelState("7"), ModelState("7", "linear", ()), ModelState("a b", "", ("x", "my=a*t"), (3, 4))):
        assert parse_state(QueryParams(state.address.partition("?")[2])) == state


def selected(page: Page) -> list[int]:
    """The points selected in the picture of residuals."""
    return list(
        page.locator(
            "[aria-label='Residuals'] .js-plotly-plot, [aria-label='Residuals'].js-plotly-plot"
        ).first.evaluate("plot => [...(plot.data.find(trace => trace.customdata).selectedpoints || [])]")
    )


def own_effect(page: Page) -> None:
    """Add an effect of one's own."""
    page.get_by_label("Expression, such as").fill(CARD)
    add = page.get_by_role("button", name="Add effect")
    expect(add).to_be_enabled()
    add.click()
    expect(page.get_by_role("button", name="Remove my-effect")).to_be_visible()


@pytest.mark.slow
def test_the_address_has_data_effects_and_selection(workbench: Workbench, tmp_path: Path) -> None:
    data = two_faults(tmp_path)
    page = workbench.visit(f"/?data={quote(data)}&model=linear&select=0-4,9")
    expect(page.get_by_role("button", name="Clear selection")).to_be_visible()
    assert selected(page) == [0, 1, 2, 3, 4, 9]
    own_effect(page)
    state = ModelState(data, "linear", (f"my-effect={CARD}",), (0, 1, 2, 3, 4, 9))
    expect(page).to_have_url(workbench.origin + state.address)
    address = page.url
    expect(page.get_by_label("Name", exact=True)).to_have_value("my-effect-2")
    page.get_by_role("button", name="Remove my-effect").click()
    expect(page.get_by_role("button", name="Remove my-effect")).to_have_count(0)
    expect(page.get_by_label("Name", exact=True)).to_have_value("my-effect")
    own_effect(page)  # the name is free again
    other = workbench.visit(address.removeprefix(workbench.origin))
    expect(other.get_by_role("button", name="Remove my-effect")).to_be_visible()
    assert selected(other) == [0, 1, 2, 3, 4, 9]


@pytest.mark.slow
def test_added_effects_stay_after_a_restart_of_the_server(
    visitor: Callable[[], BrowserContext], tmp_path: Path
) -> None:
    data, home = two_faults(tmp_path), {**os.environ, "RIG_HOME": str(tmp_path / "home")}
    words = [sys.executable, "-m", "rig", "web", "--no-open", "--json"]
    for begun in (True, False):
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=home) as server:
            try:
                assert server.stdout is not None
                page = visitor().new_page()
                page.goto(f"{json.loads(server.stdout.readline())['url']}&data={quote(data)}&model=linear")
                if begun:
                    own_effect(page)
                expect(page.get_by_role("button", name="Remove my-effect")).to_be_visible()
                page.context.close()
            finally:
                server.send_signal(signal.SIGTERM)
            assert server.wait(20) == 0


@pytest.mark.slow
def test_a_run_sends_notifications_and_is_legible_from_two_metres(workbench: Workbench) -> None:
    other = workbench.visit("/record")
    other.add_init_script(NEWS)
    other.reload()
    other.get_by_label("Notify me when a run asks or ends").click()
    expect(other.get_by_text("A notification appears when a run asks or ends.")).to_be_visible()
    page = started(workbench, NIGHT)
    phase(page, "running")
    tiles = page.get_by_role("group", name="Live values and their limits")
    expect(tiles.get_by_text("−20 to 85 °C")).to_be_visible()
    for large in (".tile .value", ".big-state"):
        page.wait_for_function(LARGE, arg=large)
    workbench.shot(page, "live")
    page.set_viewport_size(TABLET)
    stop = page.locator(".live").get_by_role("button", name="Stop")
    page.wait_for_function(ABOVE_THE_FOLD)
    page.emulate_media(color_scheme="dark")
    workbench.shot(page, "live-tablet-dark")
    workbench.fits(page)
    page.locator(".live").get_by_role("button", name="Pause").click()
    phase(page, "paused")
    other.wait_for_function("window.news.some(said => said[0] === 'soak is paused')")
    expect(other).to_have_title(re.compile(r"^❗ \d+ % soak is paused$"))
    stop.click()
    other.wait_for_function("window.news.some(said => said[0] === 'soak: stopped')")
