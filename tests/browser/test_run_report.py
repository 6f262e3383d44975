"""The report of a run inside its page: the night of a soak, the figure of a motion test; buttons, no commands."""

from __future__ import annotations

import json
import re
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
from matplotlib.image import imread
from playwright.sync_api import Page, expect

from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import read_bench
from rig.cli.terminal.watch import Quiet
from rig.record import Record
from rig.runs.runner import start
from tests import recorded
from tests.browser.conftest import Workbench
from tests.browser.measured import ambiguous

pytestmark = pytest.mark.slow


def measured(workbench: Workbench, name: str, settings: dict[str, Any]) -> Page:
    """The page of a new run."""
    procedure = find(name)
    with Record() as record:
        run = start(record, read_bench(), procedure, parse(procedure, settings), Quiet({})).run.run
    return workbench.visit(f"/record/{run}")


def test_the_night_of_a_soak_is_described_and_drawn(workbench: Workbench) -> None:
    page = measured(workbench, "soak", {"duration_s": "1200", "interval_s": "300", "off_s": "60"})
    report = page.frame_locator(".report iframe")
    expect(report.get_by_role("heading", name="Course")).to_be_visible()
    expect(report.get_by_role("heading", name="Forecasts")).to_be_visible()
    expect(page.locator(".verdict .headline")).to_contain_text("teady")
    expect(report.locator("svg").first).to_be_visible()
    frame = page.locator(".report iframe")
    page.wait_for_function("f => f.scrollHeight <= f.clientHeight && f.clientHeight > 900", arg=frame.element_handle())
    workbench.shot(page, "run-report")
    workbench.fits(page)
    row = page.get_by_role("row").filter(has_text="steady-state")
    expect(row.first).to_contain_text(re.compile("Not confirmed in this run. |Reached "))
    assert _brightness(page) > 0.8
    for _ in ("light", "dark"):
        page.get_by_label("Light or dark").click()
    expect(page.locator("body.body--dark")).to_be_attached()
    assert _brightness(page) < 0.35
    workbench.shot(page, "run-report-dark")
    page.get_by_label("Light or dark").click()


def _brightness(page: Page) -> float:
    """The mean brightness of the report on the screen, 0 to 1."""
    picture = imread(BytesIO(page.locator(".report iframe").screenshot()))
    return float(picture[..., :3].mean())


def test_the_next_experiment_is_planned_below_the_report(workbench: Workbench, tmp_path: Path) -> None:
    _, imported, problem = recorded.command("import", ambiguous(tmp_path), "--json")
    assert imported, problem
    page = workbench.visit(f"/record/{json.loads(imported)['run']}")
    report = page.frame_locator(".report iframe")
    expect(report.get_by_role("heading", name="Candidates")).to_be_visible()
    expect(report.get_by_role("heading", name="Next experiment")).to_have_count(0)
    note = page.locator(".report .next-experiment")
    expect(note).to_contain_text("To separate stage-zero-offset from axis-misalignment, run sweep with face = both")
    expect(page.locator(".verdict .headline")).to_contain_text("misses stage-zero-offset")
    expect(page.locator(".verdict .chip.doubt")).to_have_text("ambiguous")
    note.scroll_into_view_if_needed()
    workbench.shot(page, "run-report-next")
    note.get_by_role("button", name="Prepare this run").click()
    expect(page.get_by_label("face")).to_be_visible()


def test_the_figure_of_a_motion_test_is_in_its_page_without_commands(workbench: Workbench) -> None:
    page = measured(workbench, "motion", {})
    report = page.frame_locator(".report iframe")
    expect(report.get_by_text("displacement sensor").first).to_be_visible()
    expect(page.get_by_text("Settings", exact=True)).to_be_visible()
    assert "rig report" not in page.locator("body").inner_text()
    assert "rig compare" not in page.locator("body").inner_text()
