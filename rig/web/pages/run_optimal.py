"""Poses of a sweep chosen for a model, compared with the standard sweep; a click makes them the settings of the run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from nicegui import ui

from calibrations.effects.catalogue import catalogue
from calibrations.model.file import read_model
from procedures.catalogue import Procedure
from procedures.pose_list import format_poses
from procedures.settings import parse, setting_text
from rig.bench import Bench
from rig.files import home, write_whole
from rig.planning.optimal import Optimal, optimal
from rig.services.optimal_words import PLANS, plan_rows, purpose, savings
from rig.services.search import Cancelled
from rig.web.calculations import Visit, off_loop
from rig.web.desk import FILES, models
from rig.web.parts import afresh, dialog_with_name, div, show_error, table, waiting, wide_table, words

CRITERIA = {"I": "I: error of the prediction", "D": "D: joint uncertainty of the parameters"}
Use = Callable[[Mapping[str, str]], None]


class OptimalDialog:
    """Asks for a model and the number of poses, and shows the plan. `use` receives the settings of the chosen poses."""

    def __init__(self, bench: Bench, sweep: Procedure, settings: Mapping[str, str], use: Use) -> None:
        self.bench, self.sweep, self.settings, self.use = bench, sweep, settings, use
        self.visit = Visit()
        with (
            dialog_with_name("Choose poses for a model").props("persistent") as self.dialog,
            ui.card().classes("optimal"),
        ):
            words("Choose poses for a model", "title")
            words(
                "The standard sweep has the present settings. The chosen poses stay in its range and give the same "
                "uncertainty in less time.",
                "quiet small",
            )
            with div("row-of"):
                self.model = ui.select(models("linear", None), label="Model", value="linear")
                self.poses = ui.number("Poses (empty: a quarter)", min=1, max=60, precision=0).props("dense")
                self.criterion = ui.select(CRITERIA, label="Make smallest", value="I").props("dense options-dense")
                for field in (self.model.props("dense options-dense"), self.poses, self.criterion):
                    field.classes("grow")
            self.place = div("stack")
            with div("row-of"):
                self.choose = ui.button("Choose", icon="auto_fix_high", on_click=self.find)
                ui.button("Cancel", on_click=self.close).props("flat")
        self.dialog.open()

    async def find(self) -> None:
        """Choose the poses, and compare them with the standard sweep."""
        self.choose.disable()
        with afresh(self.place):
            waiting("Choosing the poses; nothing moves. This takes a few minutes at most.")
            ui.button("Stop choosing", icon="close", on_click=self.visit.cancel).props("dense flat")
        try:
            choice = await self.visit.work(self._optimal)
        except Cancelled:
            if self.dialog.is_deleted:
                return
            with afresh(self.place):
                words("Stopped; no poses are chosen.", "quiet")
        except Exception as error:
            with afresh(self.place):
                show_error("No poses can be chosen", error)
        else:
            with afresh(self.place):
                self._show(choice)
        self.choose.enable()

    def _optimal(self) -> Optimal:
        model = read_model(str(self.model.value), catalogue(self.bench.folders.effects))
        count = int(self.poses.value) if self.poses.value else None
        settings = parse(self.sweep, self.settings)
        return optimal(self.bench, self.sweep, settings, model, count, str(self.criterion.value))

    def _show(self, choice: Optimal) -> None:
        with wide_table():
            table(PLANS, plan_rows(choice))
        for line in (*savings(choice), *purpose(choice)):
            words(line, "small")
        ui.button("Use these poses", icon="done", on_click=lambda: self._use(choice))

    async def _use(self, choice: Optimal) -> None:
        """Write the poses into a file, and hand over the settings of a run with them."""
        try:
            path = await off_loop(_write_file, choice)
        except OSError as error:  # for example a full disk
            with self.place:
                show_error("The poses cannot be stored", error)
            return
        settings: Mapping[str, Any] = choice.equal.plan.settings
        fixed = {name: setting_text(settings[name]) for name in ("dwell_s", "settle_s")}
        self.close()
        self.use({"pose_list": path, **fixed})

    def close(self) -> None:
        """Close the dialog and forget it, and the choice in progress."""
        self.visit.cancel()
        self.dialog.close()
        self.dialog.delete()


def _write_file(choice: Optimal) -> str:
    """The file with the chosen poses."""
    folder = home() / FILES
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"poses-{choice.over.fit.model.name}-{choice.equal.plan.poses}.csv"
    write_whole(path, "\n".join([*format_poses(dwell.pose for dwell in choice.equal.plan.held), ""]))
    return str(path)
