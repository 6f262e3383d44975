"""The report of a run inside its page: sentences, tables and pictures, as `rig report` writes them.

The plan of the next experiment takes longer than the report. The page shows it below, when it is known.
"""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from threading import Thread
from typing import Any

from nicegui import ui
from nicegui.element import Element

from rig.record import Run
from rig.services.content import content_of
from rig.services.report import make_report, next_of
from rig.services.request import Request
from rig.services.search import Cancelled
from rig.services.session import ModelSession
from rig.web.calculations import Visit
from rig.web.desk import Desk
from rig.web.pages.model_verdict import LOOKS
from rig.web.pages.next_experiment import show_next
from rig.web.parts import box, button, div, notify_error, shown, words

# the frame is as high as the report; a report has no scripts, and the page's policy lets it load nothing
FITTED = (
    "const fit = () => { this.style.height = '0'; "
    "this.style.height = this.contentDocument.documentElement.scrollHeight + 'px' }; "
    "fit(); this.contentWindow.addEventListener('resize', e => { if (this.clientWidth !== this.wide) "
    "{ this.wide = this.clientWidth; fit() } }); this.wide = this.clientWidth"
)
HEADLINE = re.compile(r'<span class="state ([\w-]+)">(.*?)</span>.*?<h1[^>]*>(.*?)</h1>', re.DOTALL)

CHIPS = {verdict.value: look for verdict, look in LOOKS.items()}


@dataclass(frozen=True)
class ReportVerdict:
    """The verdict of a report: its label, as in the report, the look of the label, and the first sentence."""

    label: str
    look: str
    headline: str


def verdict_of(text: str) -> ReportVerdict | None:
    """The verdict at the head of a report; None for a text without one."""
    found = HEADLINE.search(text)
    if found is None:
        return None
    label, headline = (html.unescape(re.sub(r"<[^>]*>", "", part)).strip() for part in found.group(2, 3))
    return ReportVerdict(label, CHIPS.get(found[1], "plain"), headline)


class RunReport:
    """The report of a run, or of each sensor of a batch. It is made once for each content of the data."""

    def __init__(self, desk: Desk, run: Run, headline: Element) -> None:
        """`headline`: where the first sentence of the report appears."""
        self.desk, self.run, self.headline, self.visit = desk, run, headline, Visit()
        with box("stack report"):
            with div("row-of"):
                words("Report", "title")
                self.sensor = ui.toggle(run.data, value=run.data[0], on_change=self.show).props("dense no-caps")
                self.sensor.set_visibility(len(run.data) > 1)
            self.place = div("")
            self.following = div("")
        ui.timer(0.0, self.show, once=True)

    @property
    def data(self) -> str:
        """The run, or the chosen sensor of it."""
        return str(self.sensor.value)

    async def show(self) -> None:
        """Make the report, unless it is made already, and show it."""
        data, hint = self.data, "Fitting the model, searching for missing effects, drawing"
        self.following.clear()
        work = self.visit.work(self.text, data)
        text = await shown(self.place, hint, "This run has no report", work, lambda: data == self.data, self.run.run)
        if text is None:
            return
        with self.place:
            ui.html(frame_html(f"Report on {data}", text), sanitize=False)
        self.headline.clear()
        if (verdict := verdict_of(text)) is not None:
            with self.headline, box("row-of verdict").props("role=status"):
                words(verdict.label, f"chip {verdict.look}")
                words(verdict.headline, "headline grow")
                button("Report below", "south", self.see, "flat dense")
        if (session := self.desk.opened(data)) is not None:
            with self.following:
                await show_next(self.visit, lambda notify: next_of(session, notify))

    def see(self) -> None:
        """Scroll to the report."""
        ui.run_javascript("document.querySelector('.report')?.scrollIntoView({block: 'start'})")

    def text(self, data: str) -> str:
        """The report as HTML. Raises what `report_html` raises."""
        request = Request(data, None, self.desk.bench_file)
        return report_html(self.desk, request, self.visit, partial(self.desk.beginning, data), plans_next=False)


def report_html(
    desk: Desk,
    request: Request,
    visit: Visit,
    session: Callable[[], ModelSession[Any]] | None,
    own_effects: Sequence[str] = (),
    plans_next: bool = True,
) -> str:
    """A report as `rig report` makes it, once for each content of data and model, noise model and effects of a user.

    `session` and `plans_next` as in `make_report`. Raises what `make_report` raises, Cancelled.
    """
    form = "with the next experiment" if plans_next else "without it"
    key = " ".join([content_of(request.data, request.model).key, request.noise or "", form, *own_effects])
    if key not in desk.reports:
        desk.second_core.start()
        pictures, make = make_report(request, lambda _: None, visit.searched, session, plans_next)
        desk.second_core.draw(pictures)
        desk.keep_report(key, make())
    return desk.reports[key]


def draw_ahead(desk: Desk, data: str, session: ModelSession[Any]) -> Thread:
    """Let the second process draw the pictures of the report on a session whose search is known.

    The report is then there soon after a person asks for it. The thread ends with the last picture.
    """
    request = Request(data, None, desk.bench_file)
    desk.second_core.start()
    pictures, _ = make_report(request, lambda _: None, lambda effects: effects, lambda: session, plans_next=False)
    return desk.second_core.draw_ahead(pictures)


async def download_report(
    desk: Desk,
    request: Request,
    visit: Visit,
    name: str,
    session: Callable[[], ModelSession[Any]] | None,
    own_effects: Sequence[str] = (),
) -> None:
    """Download the report as the file `name`; the other arguments as in `report_html`."""
    hint = ui.notification("Making the report", spinner=True, timeout=None)
    try:
        ui.download.content(await visit.work(report_html, desk, request, visit, session, own_effects), name)
    except Cancelled:
        return
    except Exception as error:
        notify_error(error, stays=True)
    finally:
        hint.dismiss()


def frame_html(title: str, text: str) -> str:
    """A frame that shows an HTML text, as high as it needs."""
    return f'<iframe title="{html.escape(title)}" onload="{FITTED}" srcdoc="{html.escape(text)}"></iframe>'
