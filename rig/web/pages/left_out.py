"""Poses that a person leaves out of every analysis, with a reason that stays, and takes in again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from nicegui import ui

from calibrations.reports.words import joined
from rig.analysis.exclusion import exclude, numbered_run
from rig.errors import RecordError
from rig.record import Record
from rig.web.parts import div, off_loop, words
from rig.web.told import message

MOST_NAMED = 8


def left_out(data: str) -> dict[int, str]:
    """Why each pose of what lies open is left out, by its number; none of what is no run of the rig."""
    run = numbered_run(data)
    if run is None:
        return {}
    with Record.to_find(run) as record:
        return record.excluded(run)


def ask(data: str, numbers: Sequence[int], done: Callable[[], None]) -> None:
    """Why these poses are to be left out; then they are, and `done` is called."""
    named = joined([str(number) for number in numbers[:MOST_NAMED]])
    more = f" and {len(numbers) - MOST_NAMED} more" if len(numbers) > MOST_NAMED else ""
    with ui.dialog() as dialog, ui.card().style("min-width: 420px"):
        words(f"Leave out pose {named}{more}" if len(numbers) == 1 else f"Leave out poses {named}{more}", "title")
        words("They stay in the record, with the reason, and can be taken in again.", "quiet small")
        reason = ui.input("Why").props("autofocus").classes("grow")
        wrong = words("", "fault")

        async def leave() -> None:
            if why := str(reason.value or "").strip():
                dialog.close()
                await change(data, numbers, why, done)
            else:
                wrong.set_text("Say why: whoever reads the record later wants to know.")

        reason.on("keydown.enter", leave)
        with div("row-of"):
            ui.button("Leave out", on_click=leave)
            ui.button("Cancel", on_click=dialog.close).props("flat")
    dialog.open()


def listed(data: str, done: Callable[[], None]) -> None:
    """Those that are left out, each with its reason and a button that takes it in again."""
    for number, why in left_out(data).items():
        with div("row-of"):
            words(f"pose {number}: {why}", "small grow")
            again = partial(change, data, [number], None, done)
            ui.button("Take in again", icon="undo", on_click=again).props("dense flat")


async def change(data: str, numbers: Sequence[int], reason: str | None, done: Callable[[], None]) -> None:
    """Leave poses out, or take them in again."""
    try:
        await off_loop(_change, data, numbers, reason)
    except Exception as error:
        ui.notify(message(error), type="negative", multi_line=True)
        return
    done()


def _change(data: str, numbers: Sequence[int], reason: str | None) -> None:
    run = numbered_run(data)
    if run is None:
        raise RecordError(f"{data} is no run of the rig: put a column `excluded` into the file")
    with Record.to_find(run) as record:
        exclude(record, run, numbers, reason)
