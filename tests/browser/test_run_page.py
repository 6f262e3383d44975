"""The page Run in a browser: from the empty record to the falling error; paused, closed, opened again, stopped."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from playwright.sync_api import Page, expect

from rig.record import Record
from rig.runs.background import control
from tests.browser.conftest import TABLET, Workbench
from tests.browser.test_model_page import BARS

pytestmark = pytest.mark.slow

ANSWER_MS = 2000  # on a busy machine; 300 on a free one
LEGIBLE_PX = 10  # height of a line of text
SMALLEST_TEXT = """legible => {
  const lines = [...document.querySelectorAll('.live .attitude svg text')];
  return lines.length > 0 && lines.every(line => line.getBoundingClientRect().height > legible);
}"""
NIGHT = "/run?procedure=soak&duration_s=43200"


def phase(page: Page, word: str) -> None:
    """Waits until the run is at that."""
    expect(page.locator(".chip").first).to_have_text(word)


def started(workbench: Workbench, path: str) -> Page:
    page = workbench.visit(path)
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    begin(page)
    return page


def begin(page: Page) -> None:
    """Start, tick every check, Begin."""
    page.get_by_role("button", name="Start").click()
    tick(page)
    page.get_by_role("dialog").get_by_role("button", name="Begin").click()
    expect(page.get_by_role("dialog")).to_have_count(0)


def tick(page: Page) -> None:
    """Tick every check of the dialog."""
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_role("button", name="Begin")).to_be_visible()
    for check in dialog.get_by_role("checkbox").all():
        check.click()
    expect(dialog.get_by_role("button", name="Begin")).to_be_enabled()


def test_a_new_user_gets_from_the_empty_record_to_the_error_by_model(workbench: Workbench) -> None:
    page = workbench.visit("/")
    expect(page.get_by_text("There are no measurements yet")).to_be_visible()
    workbench.shot(page, "empty")
    page.get_by_role("button", name="Measure").click()
    page.get_by_label("step (deg)").fill("15")  # long enough that the run lasts while its page is looked at
    page.get_by_label("inclinations (deg)").fill("90,30,150,60")
    expect(page.get_by_text("200 poses")).to_be_visible()
    workbench.shot(page, "plan")
    begin(page)
    phase(page, "running")
    expect(page.get_by_role("button", name="Start")).to_be_disabled()
    expect(page.get_by_text("Start waits until the present run ends.")).to_be_visible()
    expect(page.get_by_role("button", name="Stop")).to_have_count(2)  # at the run, and in the head of every page
    expect(page.locator(".tiles").get_by_text("as usual").first).to_be_visible()
    expect(page.locator(".tiles").get_by_text("−20 to 85 °C")).to_be_visible()
    workbench.shot(page, "running")
    phase(page, "complete")
    expect(page.locator(".live .q-linear-progress__model")).to_have_class(re.compile("without-transition"))
    page.get_by_role("button", name="Open the model").click()
    page.get_by_role("button", name="Add axis-misalignment").click()
    expect(page.locator(BARS)).to_have_count(2)


def test_a_paused_run_is_opened_again_and_stopped(workbench: Workbench) -> None:
    page = started(workbench, NIGHT)
    phase(page, "running")
    expect(page.locator(".live .q-select").first).to_contain_text("hold")  # what there is most of
    expect(page.get_by_label("over time", exact=True)).to_be_visible()
    page.get_by_role("button", name="Pause").first.click()
    phase(page, "paused")
    workbench.fits(page)
    page.close()
    page = workbench.visit("/record")  # the run is in the head of every page
    page.get_by_role("link", name="soak").first.click()
    phase(page, "paused")
    workbench.shot(page, "paused")
    page.get_by_role("button", name="Continue").click()
    phase(page, "running")
    page.get_by_role("button", name="Stop").first.click()
    phase(page, "stopped")
    expect(page.get_by_text("Stopped on a page of the workbench. Resume continues at the same pose.")).to_be_visible()
    expect(page.get_by_role("button", name="Resume")).to_be_visible()
    expect(page.get_by_role("button", name="Stop")).to_have_count(0)
    with Record() as record:
        run = record.runs()[0]
    assert (run.procedure, run.state) == ("soak", "stopped")


def test_a_run_of_a_terminal_is_watched_and_stopped(workbench: Workbench) -> None:
    words = [sys.executable, "-m", "rig", "run", "soak", "--unattended", "--duration-s", "43200"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as terminal:
        page = workbench.visit("/run")
        phase(page, "running")
        expect(page.get_by_text("unattended and cannot pause")).to_be_visible()
        expect(page.locator(".tiles").get_by_text("as usual").first).to_be_visible()
        expect(page.get_by_role("button", name="Pause")).to_have_count(0)
        page.get_by_role("button", name="Stop").first.click()
        phase(page, "stopped")
        assert "stopped on a page of the workbench" in terminal.communicate(timeout=60)[1]
    assert terminal.returncode == 4


def asked(workbench: Workbench) -> Page:
    """A run on a simulated rig that asks a person to turn the sensor over."""
    page = workbench.visit("/run?procedure=sweep&step_deg=180&inclinations_deg=90&face=both")
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    page.get_by_text("Ask me").click()
    begin(page)
    phase(page, "asks you")
    return page


def test_questions_are_asked_and_a_wrong_answer_is_refused(workbench: Workbench) -> None:
    page = asked(workbench)
    expect(page.locator(".question")).to_contain_text("face down")  # the first mounting was one of the checks
    expect(page).to_have_title(re.compile(r"❗ \d+ % sweep asks you"))
    workbench.shot(page, "question")
    page.locator(".question").get_by_role("button", name="yes").click()
    phase(page, "complete")
    expect(page).to_have_title("Run – rig")


def test_an_impossible_plan_gives_the_reason_and_does_not_start(workbench: Workbench) -> None:
    page = workbench.visit("/run?procedure=sweep&step_deg=ten")
    expect(page.get_by_role("alert")).to_contain_text("\"step (deg)\" is 'ten'; give a number")
    expect(page.get_by_role("button", name="Start")).to_be_disabled()


def test_the_live_picture_is_ready_before_a_run_begins(workbench: Workbench) -> None:
    """A script that comes with the first dwell would come after later changes where the connection was lost."""
    page = workbench.visit("/run?procedure=sweep&step_deg=45")
    picture = page.locator("[aria-label='the run over time']")
    expect(picture.locator(".plot-container")).to_be_attached()
    expect(picture).to_be_hidden()


@pytest.mark.parametrize("way", ["key", "button"])
def test_a_stop_during_a_lost_connection_acts_after_the_reconnection(workbench: Workbench, way: str) -> None:
    page = started(workbench, NIGHT)
    phase(page, "running")
    page.evaluate("socket.disconnect()")
    expect(page.get_by_text("The workbench does not answer")).to_be_visible()
    if way == "key":
        page.keyboard.press("F8")
    else:
        page.locator(".live").get_by_role("button", name="Stop").click()
    page.evaluate("socket.connect()")
    phase(page, "stopped")


def test_the_key_escape_closes_the_checks_and_clears_them(workbench: Workbench) -> None:
    page = workbench.visit("/run?procedure=sweep&step_deg=45")
    for _ in range(2):
        page.get_by_role("button", name="Start").click()
        expect(page.get_by_text("4 of 4 checks to do")).to_be_visible()
        tick(page)
        page.keyboard.press("Escape")
        expect(page.get_by_role("dialog")).to_have_count(0)


def test_a_setting_with_a_few_values_is_a_list_with_an_explanation(workbench: Workbench) -> None:
    page = workbench.visit("/run?procedure=sweep&step_deg=45")
    page.get_by_text("What the settings mean").click()
    expect(page.get_by_text("both: a person turns the sensor over half way")).to_be_visible()
    page.get_by_label("face").click()
    page.get_by_role("option", name="both").click()
    expect(page.get_by_text("252 poses")).to_be_visible()


def test_procedure_and_settings_are_in_the_address(workbench: Workbench) -> None:
    page = workbench.visit("/run")
    page.get_by_label("step (deg)").fill("90")
    expect(page).to_have_url(re.compile(r"/run\?procedure=sweep&step_deg=90$"))
    page.reload()
    expect(page.get_by_label("step (deg)")).to_have_value("90")
    page.get_by_label("step (deg)").fill("10")
    expect(page).to_have_url(re.compile("/run$"))


def test_a_check_of_the_instruments_lists_each_of_them(workbench: Workbench) -> None:
    page = workbench.visit("/run")
    page.get_by_role("button", name="Check the instruments").click()
    expect(page.get_by_text("✓ alarm").first).to_be_visible()


def test_a_run_begins_after_the_checks_and_no_single_key_moves_anything(workbench: Workbench) -> None:
    page = workbench.visit(NIGHT)
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    before = control.latest()
    for key in ("s", "Enter", "p", " "):
        page.keyboard.press(key)
    expect(page.get_by_role("dialog")).to_have_count(0)
    page.get_by_role("button", name="Start").click()
    dialog = page.get_by_role("dialog")
    expect(dialog.get_by_label("Sensor")).to_have_value("ADXL203")
    dialog.get_by_label("Serial number").fill("17")
    for text in ("Takes", "Turns alpha", "Stops", "Can its cable turn freely?", "to do"):
        expect(dialog.get_by_text(text).first).to_be_visible()
    drawing = dialog.locator(".attitude svg").bounding_box()
    assert drawing is not None
    assert drawing["width"] > 400
    workbench.shot(page, "begin")
    expect(dialog.get_by_role("button", name="Begin")).to_be_disabled()
    tick(page)
    assert control.latest() == before  # nothing has begun
    dialog.get_by_role("button", name="Begin").click()
    expect(page.locator(".live .chip").first).to_have_text(re.compile("starting|running"), timeout=ANSWER_MS)
    phase(page, "running")
    page.get_by_label("dwell (s)").first.click()  # the key stops also while a person types
    page.keyboard.press("F8")
    phase(page, "stopped")
    with Record() as record:
        run = record.runs()[0]
        assert run.constants["serial"] == "17"
        assert next(event.what for event in record.events(run.run)) == "answer mounting"
    expect(page.get_by_role("button", name="Start")).to_be_enabled()
    page.get_by_role("button", name="Resume").click()
    for text in ("Recorded", "Takes", "the whole run", "Turns alpha", "Stops", "no object or person is in the way"):
        expect(page.get_by_role("dialog").get_by_text(text).first).to_be_visible()
    expect(page.get_by_role("dialog").get_by_role("button", name="Begin")).to_be_disabled()
    workbench.shot(page, "resume")
    page.get_by_role("button", name="Cancel").click()


def test_a_run_that_asks_a_person_does_so_after_a_resume(workbench: Workbench) -> None:
    page = asked(workbench)
    page.get_by_role("button", name="Stop").first.click()
    phase(page, "stopped")
    page.get_by_role("button", name="Resume").click()
    tick(page)
    page.get_by_role("dialog").get_by_role("button", name="Begin").click()
    phase(page, "asks you")
    expect(page.locator(".question")).to_contain_text("face down")
    page.get_by_role("button", name="Stop").first.click()
    phase(page, "stopped")


FOCUSED = "document.activeElement.tagName === 'BUTTON' ? document.activeElement.innerText : ''"
UNTICKED = "document.activeElement.getAttribute('aria-checked') === 'false'"


def tab_to(page: Page, text: str) -> None:
    """Press Tab until a button with this text has the focus; tick the checks on the way."""
    for _ in range(40):
        page.keyboard.press("Tab")
        if page.locator(".q-dialog").count() and page.evaluate(UNTICKED):
            page.keyboard.press("Space")
        if text in page.evaluate(FOCUSED):
            return
    raise AssertionError(f"Tab does not lead to {text}")


def test_a_run_without_poses_is_started_by_keyboard_and_opens_its_results(workbench: Workbench) -> None:
    page = workbench.visit("/run?procedure=level-check")
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    tab_to(page, "Start")
    page.keyboard.press("Enter")
    expect(page.get_by_role("dialog")).to_be_visible()
    tab_to(page, "Cancel")  # over all checks, which enables Begin before it
    expect(page.get_by_role("dialog").get_by_role("button", name="Begin")).to_be_enabled()
    page.keyboard.press("Shift+Tab")
    expect(page.get_by_role("dialog").get_by_role("button", name="Begin")).to_be_focused()
    page.keyboard.press("Enter")
    expect(page.get_by_role("dialog")).to_have_count(0)
    phase(page, "complete")
    expect(page.get_by_role("button", name="Download: Run over time")).to_be_hidden()  # there is no picture
    page.get_by_role("button", name="Open the results").click()
    expect(page.get_by_text("Tilt of the table along this axis of the level, axis x")).to_be_visible()


def test_a_bench_is_chosen_before_a_run_and_stays_during_it(workbench: Workbench) -> None:
    page = workbench.visit("/run?procedure=hand-positions&target_g=0.002")
    expect(page.get_by_text("adc: no input is wired to ax, ay, az")).to_be_visible()
    expect(page.get_by_text("Another bench in the list Measure on may have it.")).to_be_visible()
    bench(page, "demonstration rig")
    expect(page.get_by_text("positioner")).to_have_count(0)  # the demonstration rig has none
    expect(page.get_by_label("Procedure")).to_have_value(re.compile("^hand-positions"))
    expect(page.get_by_label("target (g)")).to_have_value("0.002")
    expect(page.get_by_text("A person turns an accelerometer from rest to rest; no stage. Excites")).to_be_visible()
    other = workbench.visit("/run?procedure=soak&duration_s=43200")
    expect(other.get_by_label("Measure on")).to_have_value(re.compile("demonstration rig"))
    expect(other.get_by_text("Takes", exact=True)).to_be_visible()
    bench(page, "simulated rig")
    expect(page.get_by_text("positioner")).to_be_visible()
    begin(other)  # it showed the plan of the demonstration rig
    expect(page.locator(".live .title")).to_have_text("soak on demonstration rig with three hidden faults")
    phase(page, "running")
    bench(page, "demonstration rig")
    expect(page.get_by_text("choose another bench after its end")).to_be_visible()
    expect(page.get_by_label("Measure on")).to_have_value("simulated rig")
    page.keyboard.press("F8")
    phase(page, "stopped")


def test_an_unknown_procedure_is_not_replaced_by_another(workbench: Workbench) -> None:
    page = workbench.visit("/run?procedure=nonsense")
    expect(page.get_by_text("There is no procedure 'nonsense' on this bench")).to_be_visible()
    expect(page.get_by_role("button", name="Start")).to_be_disabled()
    page.get_by_label("Procedure").click()
    page.get_by_role("option", name="level-check").click()
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    expect(page.get_by_role("button", name="Start")).to_be_enabled()


def bench(page: Page, name: str) -> None:
    """Choose a bench."""
    page.bring_to_front()  # a menu opens in the page that is seen only
    page.get_by_label("Measure on").click()
    page.get_by_role("option", name=name).click()


def test_the_drawing_is_legible_and_an_ended_run_leaves_the_plan_in_view(workbench: Workbench) -> None:
    page = started(workbench, NIGHT)
    phase(page, "running")
    expect(page.locator(".live .attitude svg")).to_be_visible()
    page.set_viewport_size(TABLET)
    page.wait_for_function(SMALLEST_TEXT, arg=LEGIBLE_PX)  # the drawing is made anew for each pose
    page.keyboard.press("F8")
    phase(page, "stopped")
    expect(page.locator(".live .tiles")).to_be_visible()  # the last values of a run that this page has shown
    page.close()
    page = workbench.visit("/run")
    expect(page.get_by_text("Takes", exact=True)).to_be_in_viewport()
    expect(page.locator(".live .tiles")).to_be_hidden()


def test_a_double_click_is_one_click(workbench: Workbench) -> None:
    """The second would act on the button that appears in the place of the first: Pause after Continue."""
    page = workbench.visit(NIGHT)
    expect(page.get_by_text("Takes", exact=True)).to_be_visible()
    page.get_by_role("button", name="Start").dblclick()
    tick(page)
    page.get_by_role("dialog").get_by_role("button", name="Begin").dblclick()
    phase(page, "running")
    expect(page.get_by_role("dialog")).to_have_count(0)
    page.locator(".live").get_by_role("button", name="Pause").dblclick()
    phase(page, "paused")
    page.get_by_role("button", name="Continue").dblclick()
    phase(page, "running")
    page.locator(".live").get_by_role("button", name="Stop").dblclick()
    phase(page, "stopped")


def test_two_pages_that_begin_at_once_start_one_run(workbench: Workbench) -> None:
    pages = [workbench.visit(NIGHT) for _ in range(2)]
    for page in pages:
        expect(page.get_by_text("Takes", exact=True)).to_be_visible()
        page.get_by_role("button", name="Start").click()
        tick(page)
    with Record() as record:
        before = len(record.runs())
    for page in pages:
        page.get_by_role("dialog").get_by_role("button", name="Begin").click(no_wait_after=True)
    expect(pages[1].get_by_role("dialog").get_by_role("alert")).to_contain_text("soak is in progress since")
    expect(pages[0].get_by_role("dialog")).to_have_count(0)
    phase(pages[0], "running")
    pages[0].keyboard.press("F8")
    phase(pages[0], "stopped")
    with Record() as record:
        assert len(record.runs()) == before + 1
