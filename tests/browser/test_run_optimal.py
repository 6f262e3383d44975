"""Poses chosen for a model on the page Run: compared with the standard sweep, and taken as the settings of the run."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.sync_api import expect

from tests.browser.conftest import Workbench

pytestmark = pytest.mark.slow


def test_poses_are_chosen_for_a_model_and_planned(workbench: Workbench) -> None:
    page = workbench.visit("/run?procedure=sweep&inclinations_deg=90,30,150&step_deg=20")
    expect(page.get_by_text("114 poses")).to_be_visible()
    page.get_by_role("button", name="Choose poses for a model").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_label("Poses (empty: a quarter)").fill("5")
    dialog.get_by_role("button", name="Choose", exact=True).click()
    expect(dialog.get_by_text("5 poses: give 14 to 60 for the 4 parameters of linear")).to_be_visible()
    dialog.get_by_label("Poses (empty: a quarter)").fill("20")
    dialog.get_by_role("button", name="Choose", exact=True).click()
    expect(dialog.get_by_text(re.compile("times less rig time for the same worst standard error"))).to_be_visible()
    workbench.shot(page, "optimal")
    dialog.get_by_role("button", name="Use these poses").click()
    expect(page.get_by_role("dialog")).to_have_count(0)
    expect(page.get_by_text("20 poses")).to_be_visible()
    named = Path(page.get_by_label("pose list").input_value())
    assert named.parent == workbench.home / "files"
    assert len(named.read_text().splitlines()) == 21  # a header and the poses
    page.get_by_label("Procedure").click()
    page.get_by_role("option", name=re.compile("^soak")).click()
    expect(page.get_by_role("button", name="Choose poses for a model")).to_be_hidden()
