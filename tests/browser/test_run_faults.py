"""An instrument that falls silent in mid-run, on the page Run: what moves, why, what to do; nothing is lost."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from playwright.sync_api import BrowserContext, Page, expect

from rig.bench.file import DEMO
from tests.browser.test_every_page import GRAVE, SETTLED, WHOLE, axe
from tests.browser.test_run_page import begin, phase, tick
from tests.slow import before_release

pytestmark = pytest.mark.slow

SWEEP = "/run?procedure=sweep&inclinations_deg=90&step_deg=90&dwell_s=1"


DIALOG = {"rules": {"color-contrast": {"enabled": False}}}  # axe-core takes a dialog's shade for its ground


def accessible(page: Page, options: Mapping[str, Any] | None = None) -> None:
    """axe-core finds nothing serious in the page as it is now."""
    page.evaluate(SETTLED)
    found = [each for each in axe.Axe().run(page, options=options).response["violations"] if each["impact"] in GRAVE]
    assert [(each["id"], each["nodes"][0]["html"], each["nodes"][0]["failureSummary"]) for each in found] == []


@pytest.mark.parametrize("scheme", ["light", *before_release(["dark"])])
def test_a_silent_stage_is_reported_and_the_run_stays_in_the_record(
    served: Callable[..., Any], visitor: Callable[[], BrowserContext], tmp_path: Path, scheme: Any
) -> None:
    bench = yaml.safe_load(DEMO.read_text(encoding="utf-8"))
    bench["instruments"]["alpha"]["faults"] = [{"what": "silence", "at_s": 25}]
    (path := tmp_path / "bench.yaml").write_text(yaml.safe_dump(bench), encoding="utf-8")
    said, _ = served("--bench", str(path))
    page = visitor().new_page()
    page.set_viewport_size(WHOLE)
    page.emulate_media(color_scheme=scheme)
    page.goto(said["url"].replace("/?", f"{SWEEP}&"))
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    page.get_by_role("button", name="Start").click()
    tick(page)
    accessible(page, DIALOG)
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_role("dialog")).to_have_count(0)
    begin(page)
    phase(page, "paused")
    alerts = page.locator(".live").get_by_role("alert")
    expect(alerts.first).to_contain_text("alpha may still move")
    expect(alerts.last).to_contain_text("Reason for the pause")
    accessible(page)
    page.locator(".live").get_by_role("button", name="Stop").click()
    phase(page, "failed")
    expect(alerts.first).to_contain_text("alpha may still move")
    expect(alerts.last).to_contain_text("Reason for the end")
    expect(page.get_by_role("button", name="Resume")).to_be_visible()
    accessible(page)
