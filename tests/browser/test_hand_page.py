"""The page Run with a sensor in a hand: which way to turn it, in words and drawn, with a sound for each position."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import BrowserContext, expect

from rig.bench.file import HAND
from tests.browser.conftest import TABLET
from tests.browser.test_run_page import begin

pytestmark = pytest.mark.slow

LONG = "/run?procedure=hand-positions&target_g=0.00001&rest_s=10&wait_s=1000"
COUNT_TONES = """window.tones = 0;
const start = OscillatorNode.prototype.start;
OscillatorNode.prototype.start = function (...when) { window.tones += 1; return start.apply(this, when); };"""


@pytest.fixture
def address(served: Callable[..., Any]) -> tuple[dict[str, Any], Path]:
    address: tuple[dict[str, Any], Path] = served("--bench", str(HAND))
    return address


def test_a_tablet_marks_each_position_with_a_picture_and_a_sound(
    address: tuple[dict[str, Any], Path], visitor: Callable[[], BrowserContext]
) -> None:
    context = visitor()
    context.add_init_script(COUNT_TONES)
    context.request.get(address[0]["url"])
    page = context.new_page()
    page.set_viewport_size(TABLET)
    page.goto(address[0]["url"].partition("/?")[0] + LONG)
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    begin(page)
    hand = page.locator(".live .attitude")
    expect(hand.get_by_text("up", exact=True)).to_be_visible()  # the sensor as it shall rest
    expect(hand.get_by_text("+z half")).to_be_visible()
    expect(hand.get_by_text("✓ position")).to_be_visible()
    page.wait_for_function("tones > 0")
    page.get_by_role("button", name="Stop").first.click()
    expect(page.locator(".chip").first).not_to_have_text("running")
    expect(hand.get_by_text("axis of alpha")).to_have_count(0)  # there is no stage
    page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
