"""Two runs, or two sensors, beside each other: their results, and the parameters of one model fitted to both."""

from __future__ import annotations

from nicegui import ui

from calibrations.fit import fit
from calibrations.numerals import measured, plain, unit
from rig.analysis.asked import asked
from rig.analysis.request import Request
from rig.analysis.side_by_side import Pair, parameters_of, results_of
from rig.record import Record
from rig.web.desk import Desk
from rig.web.frame import frame
from rig.web.parts import box, div, failed, off_loop, table, waiting, words
from rig.web.told import message

DIFFERENT = 2.0  # standard uncertainties: a difference beyond is hardly chance


def register(desk: Desk) -> None:
    """The page at /compare."""

    @ui.page("/compare")
    def page(first: str, second: str, model: str = "") -> None:
        with frame(desk, "/record"):
            with box("row-of"):
                words(f"{first}  beside  {second}", "title")
            with div("two"):
                results, parameters = div("stack"), div("stack")
        with results:
            try:
                _beside("Results", _results(first, second))
            except Exception as error:
                failed("Their results cannot be compared", message(error))

        async def fitted() -> None:
            with parameters:
                hint = waiting("Fitting one model to both")
                try:
                    name, pairs = await off_loop(_parameters, desk, first, second, model)
                except Exception as error:
                    parameters.clear()
                    failed("No model can be fitted to both", message(error))
                    return
                hint.set_text("")
                parameters.clear()
                _beside(f"Parameters of {name}", pairs)

        ui.timer(0.0, fitted, once=True)


def _results(first: str, second: str) -> list[Pair]:
    names = [data.partition("/") for data in (first, second)]
    with Record.to_find(names[0][0]) as record:
        one, other = (record.run(run) for run, _, _ in names)
    return results_of(one, other, (names[0][2], names[1][2]))


def _parameters(desk: Desk, first: str, second: str, model: str) -> tuple[str, list[Pair]]:
    notes: list[str] = []
    one = asked(Request(first, model or None, desk.bench_file), notes.append)
    other = asked(Request(second, model or None, desk.bench_file), notes.append)
    return one[1].name, parameters_of(fit(one[1], one[0]), fit(one[1], other[0]))


def _beside(title: str, pairs: list[Pair]) -> None:
    with box("stack"):
        words(title, "title")
        if not pairs:
            words("They have none in common.", "quiet")
            return
        table(("", "first", "second", "difference", "in standard uncertainties"), [_row(pair) for pair in pairs])


def _row(pair: Pair) -> tuple[str, ...]:
    of = unit(pair.unit)
    times = "unknown" if pair.deviations is None else plain(pair.deviations, 2)
    far = pair.deviations is not None and abs(pair.deviations) > DIFFERENT
    return (
        pair.name,
        f"{measured(pair.first, pair.first_std)} {of}",
        f"{measured(pair.second, pair.second_std)} {of}",
        f"{measured(pair.difference, pair.std)} {of}",
        f"{times}{'  ← differ' if far else ''}",
    )
