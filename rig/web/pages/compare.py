"""Two runs, or two sensors, beside each other: their results, and one model fitted to both, in tables and pictures."""

from __future__ import annotations

from urllib.parse import urlencode

from nicegui import ui

from calibrations.numerals import measured, plain
from rig.analysis.both import both
from rig.analysis.request import Request
from rig.analysis.side_by_side import Pair, parameters_of, results_of
from rig.record import Record
from rig.web.desk import Desk, models
from rig.web.figures.beside import differences, unit_of
from rig.web.frame import Key, frame
from rig.web.pages.compare_pictures import Pictures, of_both
from rig.web.parts import box, div, failed, off_loop, table, waiting, words
from rig.web.told import message

HEAD = ("", "first ●", "second ◇", "second − first", "in its uncertainties")


def register(desk: Desk) -> None:
    """The page at /compare."""

    @ui.page("/compare")
    def page(first: str, second: str, model: str = "") -> None:
        with frame(desk, "/record") as keys:
            _head(first, second, model)
            fitted = div("stack")
            with box("stack"):
                _results(first, second)

        async def fit() -> None:
            with fitted:
                waiting("Fitting one model to both")
                notes: list[str] = []
                one, other = (Request(data, model or None, desk.bench_file) for data in (first, second))
                try:
                    found = await off_loop(both, one, other, notes.append)
                except Exception as error:
                    fitted.clear()
                    failed("No model can be fitted to both", message(error))
                    return
                fitted.clear()
                _parameters(found[0].model.name, parameters_of(*found))
                pictures = Pictures(of_both(found))
                for note in dict.fromkeys(notes):
                    with box("note"):
                        words(note, "small")
            keys["x"] = Key("the next axis", pictures.next_axis)
            keys["g"] = Key("V, or g", pictures.other_unit)

        ui.timer(0.0, fit, once=True)


def _head(first: str, second: str, model: str) -> None:
    """Which two, by which model, and the other way round."""

    def to(one: str, other: str, by: str) -> None:
        given = {"first": one, "second": other, **({"model": by} if by else {})}
        ui.navigate.to(f"/compare?{urlencode(given)}")

    with box("row-of chosen"):
        with div("grow"):
            for mark, name, run in (("●", "first", first), ("◇", "second", second)):
                with div("row-of"):
                    words(f"{mark} {name}", f"k {name}")
                    ui.link(run, f"/record/{run.partition('/')[0]}").classes("title")
        ui.select(models(model), label="Model", value=model, on_change=lambda e: to(first, second, e.value)).props(
            "dense options-dense"
        )
        ui.button("Swap", icon="swap_vert", on_click=lambda: to(second, first, model)).props("dense outline")


def _results(first: str, second: str) -> None:
    """Those of the runs themselves."""
    words("Results", "title")
    names = [data.partition("/") for data in (first, second)]
    try:
        with Record.to_find(names[0][0]) as record:
            one, other = (record.run(run) for run, _, _ in names)
        pairs = results_of(one, other, (names[0][2], names[1][2]))
    except Exception as error:
        failed("Their results cannot be compared", message(error))
        return
    if pairs:
        table(HEAD, [_row(pair) for pair in pairs])
    else:
        words("Their procedures gave none in common.", "quiet")


def _parameters(model: str, pairs: list[Pair]) -> None:
    """The model's, as a picture and in numbers."""
    figure, height_px = differences(pairs)
    title = f"How the parameters of {model} differ"
    with div("two beside"):
        with box("picture"):
            words(title, "title")
            ui.plotly(figure).style(f"height: {height_px}px; width: 100%").props(f'aria-label="{title}"')
            words("Second less first, with two standard uncertainties each way; ◆ differ beyond that.", "quiet small")
        with box("stack"):
            words(f"Parameters of {model}", "title")
            table(HEAD, [_row(pair) for pair in pairs])


def _row(pair: Pair) -> tuple[str, ...]:
    of = unit_of(pair)
    times = "unknown" if pair.deviations is None else plain(pair.deviations, 2)
    return (
        pair.name,
        f"{measured(pair.first, pair.first_std)} {of}",
        f"{measured(pair.second, pair.second_std)} {of}",
        f"{measured(pair.difference, pair.std)} {of}",
        f"{times}{'  ← differ' if pair.differ else ''}",
    )
