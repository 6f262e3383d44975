"""The page Model in a browser: the failing model, the missing effect, the falling error, an effect of one's own."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest
from playwright.sync_api import BrowserContext, Page, expect

from calibrations.model.file import read_model
from procedures.catalogue import find
from procedures.settings import parse
from rig.bench import read_bench
from rig.cli.terminal.watch import Quiet
from rig.record import KeptPose, Record
from rig.runs.runner import resume, start
from tests.browser.conftest import Workbench
from tests.browser.held import held_up
from tests.browser.measured import hidden, hundred_thousand, scattered, thousand, two_faults, unexplained, wandering

pytestmark = pytest.mark.slow

DOTS = "[aria-label='Residuals'] .points path"
ALIVE_MS = 5000  # on a busy machine; else a tenth of that
BARS = "[aria-label*=' by model'] .bars .point"


def looked_at(workbench: Workbench, data: str, verdict: str) -> Page:
    """The page on a file, once it is diagnosed."""
    page = workbench.visit(f"/?data={quote(data)}")
    expect(page.locator(".verdict .headline").first).to_contain_text(verdict)
    return page


def brushed(page: Page, picture: str) -> None:
    """A box drawn around the left half of a picture."""
    area = page.locator(f"[aria-label='{picture}'] .nsewdrag").bounding_box()
    assert area is not None
    page.mouse.move(area["x"] + 2, area["y"] + 2)
    page.mouse.down()
    page.mouse.move(area["x"] + area["width"] / 2, area["y"] + area["height"] - 2, steps=4)
    page.mouse.up()


def test_a_hidden_effect_is_found_added_saved_and_undone(workbench: Workbench, tmp_path: Path) -> None:
    data = hidden(tmp_path, "package turned")
    page = looked_at(workbench, data, "misses axis-misalignment")
    card = page.locator(".card.first")
    for text in (
        "a ← R(θ)",
        "opposite signs",
        "> 99.99 %",
        "Cannot be separated from",
        "× the noise floor",
    ):
        expect(card).to_contain_text(text)
    expect(page.get_by_text("axis-misalignment", exact=True)).to_have_count(2)  # the card, and its curve
    expect(page.locator(BARS)).to_have_count(1)
    workbench.shot(page, "model")
    page.get_by_role("button", name="Add axis-misalignment").click()
    expect(page.locator(BARS)).to_have_count(2)
    expect(page.locator(".verdict .headline").first).to_contain_text("o effect is missing")
    page.get_by_role("button", name="Save model").click()
    page.get_by_role("dialog").get_by_label("Name").fill("sensor 17")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.get_by_text("written:")).to_be_visible()
    model = read_model(workbench.home / "models" / "sensor-17.yaml")
    assert model.effects == ("bias", "scale-factor", "axis-misalignment")
    page.get_by_role("button", name="Save model").click()  # nothing is replaced unasked
    page.get_by_role("dialog").get_by_label("Name").fill("sensor 17")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.get_by_text("sensor-17.yaml exists already.")).to_be_visible()
    page.get_by_role("button", name="Replace").click()
    expect(page.get_by_role("dialog")).to_have_count(0)
    workbench.shot(page, "nothing-missing")
    workbench.fits(page)
    sentence, figures = (page.locator(f".verdict > .{part}").bounding_box() for part in ("grow", "numbers"))
    assert sentence is not None
    assert figures is not None
    assert sentence["y"] + sentence["height"] <= figures["y"]
    assert sentence["width"] > 600
    page.close()
    page = looked_at(workbench, data, "o effect is missing")  # opened again, it is as it was left
    page.get_by_role("button", name="Undo axis-misalignment").click()
    expect(page.locator(BARS)).to_have_count(1)
    expect(page.locator(".verdict .headline").first).to_contain_text("axis-misalignment")


def test_a_mistake_in_an_own_effect_is_shown_and_corrected(workbench: Workbench, tmp_path: Path) -> None:
    page = looked_at(
        workbench, unexplained(tmp_path, "worm gear"), "An effect that is not in the catalogue acts at stage-angle-beta"
    )
    text, add = page.get_by_label("Expression, such as"), page.get_by_role("button", name="Add effect")
    expect(text).to_have_value(re.compile("sin"))  # what is left proposes itself
    text.fill("a*sin(5*betta) + b*cos(5*beta)")
    expect(page.locator(".fault").last).to_contain_text('did you mean "beta"')
    expect(add).to_be_disabled()
    workbench.shot(page, "own-effect-mistake")
    page.get_by_label("Name").fill("my-worm")
    text.fill("beta_deg += a*sin(5*beta) + b*cos(5*beta)")
    expect(page.locator(".fall").last).to_contain_text("× the noise floor; held-out error")
    expect(add).to_be_enabled()
    workbench.shot(page, "own-effect")
    add.click()
    expect(page.locator(BARS)).to_have_count(2)
    expect(page.get_by_role("button", name="Undo my-worm")).to_be_enabled()


def tops(page: Page, *parts: str) -> list[float]:
    """The upper ends of the first of these parts."""
    boxes = [page.locator(part).first.bounding_box() for part in parts]
    return [place["y"] for place in boxes if place is not None]


def test_an_own_effect_without_a_proposal_is_below_the_candidates(workbench: Workbench, tmp_path: Path) -> None:
    page = looked_at(workbench, scattered(tmp_path), "No effect of the catalogue explains the residual: scatter")
    expect(page.get_by_text("Write your own effect below.")).to_be_visible()
    own, card = tops(page, ".own", ".card")
    assert own > card


def test_the_allan_deviation_of_a_still_record_is_shown(workbench: Workbench, tmp_path: Path) -> None:
    page = looked_at(workbench, wandering(tmp_path), "misses rate-random-walk")
    for picture in ("Allan deviation and model", "Spectrum and model", "Residual pattern"):
        expect(page.locator(f"[aria-label='{picture}'] .points path").first).to_be_attached()
    expect(page.get_by_role("button", name="with rate-random-walk")).to_be_visible()  # its curve is drawn
    expect(page.locator(".card.first")).to_contain_text("× chance")
    label = page.locator("[aria-label='Allan deviation and model'] .ytitle")
    expect(label).to_have_text("Allan deviation (mV)")
    page.keyboard.press("g")
    expect(label).to_have_text("Allan deviation (mg)")
    expect(page.locator("[aria-label='Spectrum and model'] .ytitle")).to_have_text("density (mg/√Hz)")
    expect(page.locator("[aria-label='The record'] .ytitle")).to_have_text("x − mean (mg)")
    workbench.shot(page, "noise")
    page.get_by_role("button", name="Add rate-random-walk").click()
    expect(page.locator(BARS)).to_have_count(2)
    expect(page.locator(".verdict .headline").first).to_contain_text("o effect is missing")


def test_the_samples_of_a_motion_are_drawn(workbench: Workbench) -> None:
    with Record() as record:
        run = start(record, read_bench(), find("motion"), {}, Quiet({})).run.run
    page = workbench.visit(f"/?data={run}")
    expect(page.locator("[aria-label='Measurement and model'] .ytitle")).to_have_text("x − mean (mV)")
    expect(page.locator("[aria-label='Residual pattern'] .xtitle")).to_have_text("phase of the motion at 10 Hz (deg)")
    page.keyboard.press("x")
    expect(page.locator("[aria-label='Residuals'] .ytitle")).to_contain_text("residual of x in phase")
    workbench.shot(page, "motion")


def test_a_search_shows_its_progress_and_is_cancelled_and_started_again(
    served: Callable[..., Any], context: BrowserContext, tmp_path: Path
) -> None:
    said, _ = served("--bench", str(held_up(tmp_path)))
    context.request.get(said["url"])
    page = context.new_page()
    page.goto(f"{said['url'].partition('/?')[0]}/?data={quote(thousand(tmp_path))}")
    progress = page.locator(".verdict [aria-live=off]")
    expect(progress).to_have_text(re.compile(r"^Round 1.*, \d+ s$"))
    expect(page.locator(".verdict .headline").first).to_have_text("Searching for missing effects ...")
    expect(page.locator(".verdict .chip")).to_be_hidden()  # only the search can judge a model that fails nowhere
    page.locator(".side").get_by_role("button", name="Cancel").click()
    expect(page.get_by_text("The search was cancelled.")).to_be_visible()
    expect(progress).to_be_hidden()
    expect(page.locator(".verdict .headline").first).to_have_text("Not diagnosed")
    (tmp_path / "go").touch()
    page.get_by_role("button", name="Search for missing effects").click()
    expect(page.locator(".verdict .headline").first).to_contain_text("o effect is missing")
    page.close()


def test_a_failing_model_is_shown_before_the_search_ends(
    served: Callable[..., Any], context: BrowserContext, tmp_path: Path, workbench: Workbench
) -> None:
    said, _ = served("--bench", str(held_up(tmp_path)))
    context.request.get(said["url"])
    page = context.new_page()
    page.goto(f"{said['url'].partition('/?')[0]}/?data={quote(hidden(tmp_path, 'package turned'))}")
    box, provisional = page.locator(".verdict"), page.locator(".verdict .chip")
    headline, progress = box.locator(".headline"), box.locator("[aria-live=off]")
    expect(headline).to_have_text(
        re.compile(r'^The model "linear" is incomplete: its error is \d[\d.]* times the noise floor\.$')
    )
    expect(box).to_have_class(re.compile("bad"))
    expect(provisional).to_have_text("provisional")
    expect(progress).to_have_text(re.compile(r"^Searching for missing effects\. Round 1.*, \d+ s$"))
    expect(page.locator(".places")).to_be_visible()
    workbench.shot(page, "provisional")
    (tmp_path / "go").touch()
    expect(headline).to_have_text('The model "linear" misses axis-misalignment.')
    for part in (provisional, progress):
        expect(part).to_be_hidden()
    page.close()


SLOW = """schema: rig.model/1
name: slow
effects: [{effect: bias}, {effect: scale-factor}, {effect: held-up}]
"""


def test_a_fit_shows_its_step_and_its_time_and_is_cancelled(
    served: Callable[..., Any], context: BrowserContext, tmp_path: Path
) -> None:
    said, _ = served("--bench", str(held_up(tmp_path)))
    context.request.get(said["url"])
    (model := tmp_path / "slow.yaml").write_text(SLOW)
    page = context.new_page()
    page.goto(f"{said['url'].partition('/?')[0]}/?data={quote(two_faults(tmp_path))}&model={quote(str(model))}")
    expect(page.locator(".verdict .headline").first).to_have_text(
        re.compile(r"^Fitting slow to 180 poses of .*two-faults\.csv \.\.\. \d+ s$")
    )
    page.locator(".verdict").get_by_role("button", name="Cancel").click()
    expect(page.get_by_text("The analysis was cancelled")).to_be_visible()
    page.close()


def test_selection_units_axes_and_poses(workbench: Workbench, tmp_path: Path) -> None:
    page = looked_at(workbench, hidden(tmp_path, "package turned"), "misses axis-misalignment")
    brushed(page, "Residual pattern")
    expect(page.get_by_text("of 518 selected")).to_be_visible()
    for picture in ("Measurement and model", "Residuals", "Residual pattern"):
        faded = f"[aria-label='{picture}'] .points path[style*='opacity: 0.2']"
        expect(page.locator(faded).first).to_be_attached()
    workbench.shot(page, "brushed")
    page.get_by_role("button", name="Clear selection").click()
    expect(page.locator("[aria-label='Residuals'] .points path[style*='opacity: 0.2']")).to_have_count(0)
    label = page.locator("[aria-label='Residuals'] .ytitle")
    expect(label).to_have_text("residual of x (mV)")
    page.keyboard.press("g")
    expect(label).to_have_text("residual of x (mg)")
    page.keyboard.press("x")
    expect(label).to_have_text("residual of y (mg)")
    page.get_by_label("against").click()
    page.get_by_role("option", name="temperature (°C)").click()
    expect(page.locator("[aria-label='Residuals'] .xtitle")).to_have_text("temperature (°C)")
    page.locator("[aria-label='Residual pattern'] .points path").nth(9).hover(force=True)
    expect(page.locator("[aria-label='Residual pattern'] .hovertext")).to_contain_text("α 90°, β 90°")


def test_selected_poses_are_excluded_with_a_reason_and_included_again(workbench: Workbench) -> None:
    bench, sweep = read_bench(), find("sweep")
    with Record() as record:
        settings = parse(sweep, {"inclinations_deg": "90,30", "step_deg": "45", "dwell_s": "0.5"})
        run = start(record, bench, sweep, settings, Quiet({})).run
    page = workbench.visit(f"/?data={run.run}")
    expect(page.locator(".verdict .detail")).to_contain_text(f"on {run.rows} poses")
    brushed(page, "Residual pattern")
    page.get_by_role("button", name="Exclude").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_role("button", name="Exclude").click()
    expect(dialog.get_by_text("Give a reason")).to_be_visible()
    dialog.get_by_label("Reason").fill("a lorry passed")
    dialog.get_by_role("button", name="Exclude").click()
    expect(page.get_by_text("excluded from every analysis")).to_be_visible()
    with Record() as record:
        out = record.excluded(run.run)
    assert out
    assert set(out.values()) == {"a lorry passed"}
    expect(page.locator(".verdict .detail")).to_contain_text(f"on {run.rows - len(out)} poses")
    page.goto(f"{workbench.origin}/record/{run.run}")
    expect(page.get_by_text("Excluded poses")).to_be_visible()
    page.get_by_role("button", name="Include again").first.click()
    expect(page.get_by_role("button", name="Include again")).to_have_count(len(out) - 1)


def test_data_that_cannot_be_read_give_a_remedy_and_the_next_path_is_read(workbench: Workbench, tmp_path: Path) -> None:
    page = workbench.visit("/?data=no-such-run")
    expect(page.get_by_role("alert")).to_contain_text("there is no such file, and no run 'no-such-run'")
    private, table = tmp_path / "private.txt", tmp_path / "table.csv"
    private.write_text("root:x:0\nme:y:1\n")
    table.write_text("alpha_deg,beta_deg,vx_v\n" + "".join(f"90,{b},{2.5 + b % 7}\n" for b in range(0, 360, 30)))
    for path, shown in ((private, "has no numbers"), (table, "on 12 poses")):
        page.get_by_label("Data: a run").click()
        page.keyboard.press("ControlOrMeta+a")
        page.keyboard.type(str(path))
        page.keyboard.press("Enter")
        expect(page.get_by_text(shown).first).to_be_visible()
        expect(page.locator(".q-menu")).to_have_count(0)
        expect(page.get_by_text("root:x")).to_have_count(0)


@pytest.mark.parametrize(("make", "rows"), [(thousand, "on 1000 poses"), (hundred_thousand, "on 100 poses")])
def test_the_page_responds_with_large_data(workbench: Workbench, tmp_path: Path, make: object, rows: str) -> None:
    assert callable(make)
    page = workbench.visit(f"/?data={quote(make(tmp_path))}")
    dark = page.get_by_role("button", name="Light or dark")
    expect(page.locator(".verdict .detail")).to_contain_text(rows)
    dark.click()  # while effects are being tried
    dark.click()
    expect(page.locator("body.body--dark")).to_be_attached(timeout=ALIVE_MS)
    expect(page.locator(".verdict.good, .picture .title button:visible").first).to_be_visible()  # drawn to the end
    brushed(page, "Residuals")
    expect(page.get_by_text(re.compile("of [0-9]+ selected"))).to_be_visible(timeout=ALIVE_MS)
    workbench.shot(page, f"dark-{rows.split()[1]}")
    dark.click()


class Stopping(Quiet):
    """Stops the run after a number of poses."""

    left = 20

    def kept(self, kept: KeptPose) -> None:
        super().kept(kept)
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


def test_an_analysis_of_a_part_of_a_run_has_a_remark_and_is_updated(workbench: Workbench) -> None:
    settings = parse(find("sweep"), {"step_deg": "45", "inclinations_deg": "90,30,60"})
    with Record() as record:
        run = start(record, read_bench(), find("sweep"), settings, Stopping({})).run
    assert (run.state, run.rows) == ("stopped", 20)
    page = looked_at(workbench, run.run, "")
    expect(page.locator(".verdict .detail")).to_contain_text("on 20 poses")
    with Record() as record:
        complete = resume(record, run.run, Quiet({})).run
    assert complete.state == "complete"
    expect(page.get_by_text(f"has changed: {complete.rows} poses by now")).to_be_visible()
    expect(page.locator(".verdict .detail")).to_contain_text("on 20 poses")
    workbench.shot(page, "changed")
    page.get_by_role("button", name="Update").click()
    expect(page.locator(".verdict .detail")).to_contain_text(f"on {complete.rows} poses")
    expect(page.get_by_text("54 poses by now")).to_have_count(0)
    expect(page.get_by_text("have changed since")).to_have_count(0)  # the page has said so before Update
    expect(page.locator(DOTS)).to_have_count(complete.rows)
    page.get_by_role("button", name="Save model").click()
    expect(page.get_by_role("dialog")).to_contain_text(f"{complete.rows} poses")
    page.get_by_role("button", name="Save", exact=True).click()
    expect(page.get_by_text("written:")).to_be_visible()
    assert read_model(workbench.home / "models" / "complete.yaml").provenance["rows"] == complete.rows


def test_pictures_have_true_angles_and_opening_a_card_leaves_them(workbench: Workbench, tmp_path: Path) -> None:
    page = looked_at(workbench, hidden(tmp_path, "package turned"), "misses axis-misalignment")
    ticks = page.locator("[aria-label='Residual pattern'] .yaxislayer-above text")
    expect(ticks.last).to_have_text("150")
    assert ticks.all_text_contents() == ["30", "45", "60", "90", "120", "135", "150"]
    label = page.locator("[aria-label='Residuals'] .xtitle")
    expect(label).to_have_text("β (deg)")  # also with the first card open and its effect drawn
    expect(page.get_by_text("explained by axis-misalignment")).to_be_visible()
    second = page.locator(".card .head").nth(1)
    second.click()
    expect(second).to_have_attribute("aria-expanded", "true")
    expect(page.get_by_text("explained by axis-misalignment")).to_be_visible()
    expect(label).to_have_text("β (deg)")
    workbench.shot(page, "card")
    page.locator(".card.first").get_by_role("button", name="Show the curve").click()
    expect(label).to_have_text("change made by axis-misalignment (mV)")
    workbench.shot(page, "curve")
