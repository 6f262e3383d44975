"""The next experiment on a page: planned on the bench, with a button that prepares its run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING
from urllib.parse import urlencode

from calibrations.presentation.report.report import next_takes, next_words
from procedures.settings import setting_label, setting_text
from rig.services.page_words import page_step
from rig.services.search import Cancelled
from rig.web.calculations import Visit
from rig.web.parts import afresh, box, buttons, div, for_page, message, waiting, words

if TYPE_CHECKING:
    from calibrations.design.experiment import Experiment

Plan = Callable[[Callable[[str], None]], "Experiment | None"]


async def show_next(visit: Visit, plan: Plan) -> None:
    """Show a note with the planned experiment; none if `plan` gives none. `plan` receives a function for remarks.

    The plan ends with the visit, and with the place of the note.
    """
    notes = list[str]()
    with box("note next-experiment") as note:
        words("Next experiment", "title")
        place = div("stack")
        with place:
            waiting("Planning on the bench")
    try:
        experiment = await visit.work(plan, notes.append)
    except Cancelled:  # a person adds an effect, which must not wait
        return
    except Exception as error:
        if not place.is_deleted:  # else the page shows another model by now
            with afresh(place):
                words(message(error), "quiet")
        return
    if place.is_deleted:
        return
    if experiment is None:
        note.delete()
        return
    settings = {setting_label(name): setting_text(value) for name, value in experiment.settings.items()}
    text = " ".join([next_words(replace(experiment, settings=settings)), next_takes(experiment), *notes])
    with afresh(place):
        words(for_page(page_step(text).text), "quiet")
        buttons(preparation(experiment))


def preparation(experiment: Experiment) -> dict[str, str]:
    """The button that prepares the run, with its address; none without a duration: then the bench cannot do it."""
    if experiment.duration_s is None:
        return {}
    settings = {name: setting_text(value) for name, value in experiment.settings.items()}
    return {"Prepare this run": f"/run?{urlencode({'procedure': experiment.procedure, **settings})}"}
