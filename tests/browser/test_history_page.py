"""The page History in a browser: a sensor's life, what is due and what is stale, two calibrations beside each other."""

from __future__ import annotations

import re
from datetime import date
from typing import Any
from urllib.parse import quote

import pytest
from playwright.sync_api import Page, expect

from calibrations.model.file import read_model
from rig.record import Record
from rig.services.history import History, closest, history, stale
from rig.services.history_words import but_stale, closest_text, next_due, summary
from rig.web.pages.history_results import LIMIT_IS_GIVEN
from tests.browser.conftest import Workbench
from tests.rig.lives import calibrated
from tests.rig.test_control import checks

pytestmark = pytest.mark.slow

LIFE = "Calibrations over time"
BIASES_V = (2.5, 2.501, 2.502, 2.503, 2.504, 2.510)  # 1 mV a year, and then a jump
ASKED = "/history?sensor=17&limit=bias-x%3D0.02&baseline=3&at=2024-08-01"


def test_an_empty_record_shows_the_next_step(workbench: Workbench) -> None:
    page = workbench.visit("/history")
    expect(page.get_by_text("No sensor has a calibration yet")).to_be_visible()
    expect(page.get_by_text("# serial: 17")).to_be_visible()
    expect(page.get_by_role("button", name="Measure")).to_be_visible()


def test_the_check_standard_has_its_charts(workbench: Workbench) -> None:
    names = checks([2.50001, 2.49999] * 10 + [2.5001])
    page = workbench.visit("/history")
    expect(page.locator(".chip", has_text="out of control")).to_be_visible()
    expect(page.get_by_text(f"{names[-1]}: CS-1 bias-x is")).to_be_visible()
    for title, count in (("Single runs", 21), ("Change from run to run", 20)):
        dots(page, f"Check standard: {title}", count)
    expect(page.locator("[aria-label='Check standard: Single runs'] .xtitle")).to_have_text("run")
    workbench.shot(page, "check-standard")
    workbench.fits(page)
    page.get_by_role("button", name="Measure the check standard").click()
    page.wait_for_url("**/run?procedure=check-standard")


@pytest.fixture(scope="module")
def made() -> dict[str, list[str]]:
    """The runs of each sensor, made once."""
    return {}


@pytest.fixture
def runs(workbench: Workbench, made: dict[str, list[str]]) -> list[str]:
    """Those of sensor 17, on two rigs over five years; sensor 18 has one calibration."""
    if not made:
        rigs = ("cellar", "attic") * 3
        made["17"] = [
            calibrated("17", f"{2020 + k}-03-01", bias, seed=k, rig=rigs[k]) for k, bias in enumerate(BIASES_V)
        ]
        made["18"] = [calibrated("18", "2024-03-02", 2.52, seed=9)]
    return made["17"]


def life(limit_v: float | None = None, baseline: int = 3) -> History:
    """As the command makes it."""
    limits = {} if limit_v is None else {"bias-x": limit_v}
    with Record() as record:
        return history(record, "17", read_model("linear"), limits, baseline)


def symbols(page: Page, picture: str) -> list[str]:
    """Of the points of a picture."""
    found = page.locator(f"[aria-label='{picture}'] .js-plotly-plot, [aria-label='{picture}'].js-plotly-plot")
    return list(found.first.evaluate("plot => plot.data.at(-1).marker.symbol"))


def dots(page: Page, picture: str, count: int) -> None:
    expect(page.locator(f"[aria-label='{picture}'] .points path")).to_have_count(count)


def test_a_history_shows_the_text_of_the_command_and_its_points_open_their_runs(
    workbench: Workbench, runs: list[str]
) -> None:
    page = workbench.visit("/record")
    page.get_by_role("row", name=runs[0]).get_by_role("link", name="ADXL203 17").click()
    dots(page, LIFE, 6)
    expect(page.locator(".verdict .headline")).to_have_text(next_due(life(), LIMIT_IS_GIVEN))
    page.get_by_label("Largest change of bias-x (V)").fill("0.02")
    expect(page.locator(".verdict .headline")).to_have_text(next_due(life(0.02), LIMIT_IS_GIVEN))
    expect(page.locator(f"[aria-label='{LIFE}'] .annotation-text")).to_have_text(
        ["lowest allowed", "highest allowed", f"due {life(0.02).due}"]
    )
    expect(page.locator(".verdict")).to_contain_text(summary(life()))
    expect(page.locator(".verdict")).to_contain_text("baseline, 6 of 20")
    page.get_by_label("Chart baseline").fill("3")
    expect(page.locator(".verdict")).to_contain_text("Out of control: bias-x.")
    assert symbols(page, LIFE) == ["circle"] * 4 + ["diamond"] * 2
    assert symbols(page, "Single runs") == ["circle-open"] * 3 + ["circle", "diamond", "diamond"]
    dots(page, "Change from run to run", 5)
    expect(page).to_have_url(re.compile("limit=bias-x%3D0.02&baseline=3"))
    page.locator(f"[aria-label='{LIFE}'] .points path").nth(2).hover(force=True)
    expect(page.locator(f"[aria-label='{LIFE}'] .hovertext")).to_contain_text("2022-03-01: 2.502")
    page.route("**/?data=*", lambda route: route.fulfill(body="the page Model"))  # which has tests of its own
    page.mouse.down()
    page.mouse.up()
    page.wait_for_url(f"**/?data={quote(runs[2])}&model=linear")


def test_the_request_is_in_the_address_and_has_keys(workbench: Workbench, runs: list[str]) -> None:
    page = workbench.visit(ASKED)
    dots(page, LIFE, 6)
    expect(page.get_by_label("Day", exact=True)).to_have_value("2024-08-01")
    workbench.shot(page, "history")
    page.keyboard.press("?")
    expect(page.get_by_role("dialog")).to_contain_text("next quantity")
    page.keyboard.press("Escape")
    expect(page.get_by_role("dialog")).to_have_count(0)
    page.keyboard.press("q")
    expect(page.locator(f"[aria-label='{LIFE}'] .ytitle")).to_have_text("bias-y (V)")
    expect(page.get_by_label("Largest change of bias-y (V)")).to_have_value("")  # the limit is the other one's
    expect(page).to_have_url(re.compile("quantity=bias-y&limit=bias-x%3D0.02"))
    for _ in ("light", "dark"):
        page.get_by_label("Light or dark").click()
    expect(page.locator("body.body--dark")).to_be_attached()
    workbench.shot(page, "history-dark")
    workbench.fits(page)
    label = page.get_by_text("Largest change of bias-y (V)")
    assert label.evaluate("label => label.scrollWidth <= label.clientWidth")  # not cut
    workbench.shot(page, "history-tablet")
    page.get_by_label("Light or dark").click()


def test_the_calibration_closest_to_a_day_is_shown_with_its_staleness(workbench: Workbench, runs: list[str]) -> None:
    page = workbench.visit(ASKED)
    found = life(0.02)
    day = page.get_by_label("Day", exact=True)
    for on in ("2024-08-01", "2027-05-01"):
        day.fill(on)
        calibration, age_days = closest(found.calibrations, on := date.fromisoformat(on))
        expect(page.get_by_text(closest_text(calibration, age_days, on))).to_be_visible()
        why = stale(found, calibration, age_days)
        expect(page.get_by_text("This calibration is stale")).to_have_text([but_stale(why)] if why else [])
    assert why is not None
    to = page.get_by_role("link", name="Its model")
    expect(to).to_have_attribute("href", f"/?data={runs[-1]}&model=linear")


def test_two_days_two_rigs_and_another_sensor_are_compared(workbench: Workbench, runs: list[str]) -> None:
    page = workbench.visit(ASKED)
    compare = page.get_by_role("button", name="Compare", exact=True)
    for kind, told in (("two days", "bias-x"), ("another sensor", "bias-x"), ("two rigs", "in every quantity")):
        page.get_by_role("button", name=kind).click()
        compare.click()
        result = page.locator("section", has=compare)
        expect(result.locator(".chip")).to_have_text("agree" if told.startswith("in") else "do not agree")
        expect(result).to_contain_text(told)
    page.get_by_role("button", name="two days").click()
    day = page.get_by_label("One day")
    day.fill("2020-02-30")
    compare.click()
    expect(page.get_by_role("alert")).to_contain_text("'2020-02-30' is not a date")
    day.fill("2020-02-28")
    compare.click()
    both = page.get_by_role("link", name="One model fitted to both")
    expect(both).to_have_attribute("href", f"/compare?first={runs[0]}&second={runs[-1]}&model=linear")


def test_runs_that_are_not_used_have_a_reason_without_commands(workbench: Workbench, runs: list[str]) -> None:
    about: dict[str, Any] = {"bench": {}, "identities": {}, "configuration": "", "source": "a bench"}
    with Record() as record:
        name = record.begin("level-check", {}, constants={"sensor": "ADXL203", "serial": "17"}, **about)
        record.set_state(name, "complete")
    page = workbench.visit("/history?sensor=17")
    page.get_by_text("1 run not used").click()
    expect(page.get_by_text(f"run {name} has no poses; the page Record shows its results")).to_be_visible()


def test_a_page_that_cannot_be_shown_gives_the_remedy(workbench: Workbench, runs: list[str]) -> None:
    page = workbench.visit("/history?sensor=18")
    expect(page.get_by_text("A control chart needs two calibrations, a drift three")).to_be_visible()
    for asked, told in (
        ("sensor=170", "no calibration of the sensor '170' in the record. Did you mean '17'?"),
        ("sensor=18&model=gyroscope", "This model cannot use its runs"),
        ("sensor=17&baseline=one", "baseline=one: give the number of calibrations for the limits, at least 2"),
    ):
        page.goto(f"{workbench.origin}/history?{asked}")
        expect(page.get_by_role("alert")).to_contain_text(told)
