"""The head of the model page: data, model, undo, save, report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from nicegui import ui

from calibrations.errors import CalibrationError
from calibrations.importing.topics import SeveralTopics
from calibrations.model.file import dump_model
from rig.errors import RigError
from rig.files import home, write_whole
from rig.services.importing import needs_person, open_file
from rig.services.page_words import IMPORT, address
from rig.services.request import Request
from rig.web.calculations import Visit, off_loop
from rig.web.desk import MODELS, models, noise_models, runs, saved_models
from rig.web.pages.run_report import download_report
from rig.web.parts import box, button, dialog_with_name, message, words
from rig.web.upload import upload

if TYPE_CHECKING:
    from rig.services.session import ModelSession
    from rig.web.pages.model import Workbench


class Choice:
    """Fields for data and model, and buttons for the present model."""

    def __init__(self, page: Workbench) -> None:
        self.page, self.visit = page, Visit()
        with box("chosen"):
            self.data = ui.input("Data: a run, the path of a file, or several: A + B", value=page.data)
            self.data.classes("data").props("dense")
            self.data.on("keydown.enter", lambda: self._open(str(self.data.value).strip(), page.model))
            with self.data.add_slot("append"):
                ui.button(icon="arrow_drop_down").props("flat dense round aria-label='Runs of the record'")
                with ui.menu(), ui.element("div").classes("runs"):
                    for run, label in _runs().items():
                        ui.menu_item(label, on_click=lambda run=run: self._open(run, page.model))
            self.model = ui.select(
                models(page.model),
                label="Model",
                value=page.model,
                on_change=lambda e: self._open(page.data, e.value, page.noise),
            ).props("dense options-dense")
            button("", "upload_file", self._ask_file, "flat dense aria-label='Open a file'").tooltip(
                "Open a file from this computer"
            )
            button("", "refresh", page.afresh, "flat dense aria-label='Read again'").tooltip("Read the data again")
            self._noise()
            self.parameters = button("Parameters", "tune", page.see_parameters)
            self.undo = button("Undo", "undo", page.undo)
            with self.undo:
                self.undo_tip = ui.tooltip("Undo")  # a name in the button would take the place of the others
            self.save = button("Save model", "save", self._ask_name)
            self.report = button("Report", "description", self._report)
        for choice in (self.parameters, self.undo, self.save, self.report):
            choice.disable()

    def _open(self, data: str | None, model: str | None, noise: str = "") -> None:
        if (data or "", model or "", noise) != (self.page.data, self.page.model, self.page.noise):
            self.page.go(data or "", model or "", noise)

    def _noise(self) -> None:
        """The menu of noise models, once a model of a still record is saved."""
        page = self.page
        if not (saved_noise := noise_models()) and not page.noise:
            return
        with ui.button(icon="graphic_eq").props("flat dense aria-label='Noise of the sensor'") as menu:
            if page.noise:
                menu.props("color=positive")
            ui.tooltip(f"Noise of the sensor: {Path(page.noise).stem or 'from the samples of the data'}")
            with ui.menu():
                for path, label in {"": "from the samples of the data", **saved_noise}.items():
                    ui.menu_item(label, on_click=lambda path=path: self._open(page.data, page.model, path))

    def opened(self, session: ModelSession[Any]) -> None:
        """Show the name of the default model, and enable the buttons for the model."""
        if not self.page.model:
            self.model.set_options(models(default=f"{session.model.name} (default)"), value="")
        for choice in (self.parameters, self.save, self.report):
            choice.enable()

    def grown(self, session: ModelSession[Any]) -> None:
        """Enable Undo if the session has steps."""
        self.undo.set_enabled(bool(session.steps))
        last = f"Undo {session.steps[-1].name}" if session.steps else "Undo"
        self.undo.props(f'aria-label="{last}"')
        self.undo_tip.set_text(last)

    def _ask_file(self) -> None:
        with dialog_with_name("Open a file") as dialog, ui.card():
            words("Open a file", "title")
            words("A table with a header. If its columns have other names or units, you choose their meaning next.",
                  "quiet small")  # fmt: skip
            upload(self._open_upload)
            ui.button("Cancel", on_click=dialog.close).props("flat")
        dialog.open()

    async def _open_upload(self, path: Path) -> None:
        """Open the file, or go to the page that asks for its columns."""
        self.page.desk.forget(str(path))
        try:
            unknown = await off_loop(lambda: needs_person(open_file(path)))
        except SeveralTopics:
            unknown = True
        except CalibrationError:  # the page shows the error
            unknown = False
        if unknown:
            ui.navigate.to(address(IMPORT, str(path)))
        else:
            self.page.go(str(path), "")

    def _ask_name(self) -> None:
        """Ask for a name and save the model for pages and command line."""
        with dialog_with_name("Save the present model") as dialog, ui.card().style("min-width: 420px"):
            words("Save the present model", "title")
            name = ui.input("Name", value="complete").props("autofocus").classes("grow")
            if self.page.session is not None:
                words(f"Fitted to {self.page.session.data.description}.", "small")
            folder_text = words(f"Folder: {home() / MODELS}", "quiet small")

            def save() -> None:
                path = _file_of(str(name.value))
                if path.exists() and confirm.text == "Save":
                    folder_text.set_text(f"{path.name} exists already. Replace it, or choose another name.")
                    confirm.set_text("Replace")
                    return
                try:
                    self._write(path)
                except (RigError, CalibrationError, OSError) as error:
                    folder_text.set_text(f"{message(error)}. Download keeps the model on this computer.")
                    folder_text.classes(replace="fault")
                    return
                dialog.close()
                self.model.set_options({**self.model.options, **saved_models()})  # type: ignore[dict-item]
                ui.notify(f"written: {path}", type="positive")

            with ui.element("div").classes("row-of"):
                confirm: ui.button = ui.button("Save", on_click=save)
                name.on_value_change(lambda: confirm.set_text("Save"))
                download = ui.button(
                    "Download", on_click=lambda: ui.download.content(self._text(), f"{name.value}.yaml")
                )
                download.props("outline")
                ui.button("Cancel", on_click=dialog.close).props("flat")
        dialog.open()

    def _text(self) -> str:
        session = self.page.session
        assert session is not None  # noqa: S101 the button is enabled with the session
        return dump_model(session.complete_model())

    def _write(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, self._text())

    async def _report(self) -> None:
        """Download the report, as from `rig report`."""
        page, session = self.page, self.page.session
        request = Request(page.data, page.model or None, page.desk.bench_file, page.noise or None)
        name = f"{Path(page.data).stem}-{session.model.name if session else 'model'}.html"
        effects = session.effects.values() if session is not None else ()
        own = [f"{effect.name}={effect.expression}" for effect in effects if effect.expression]
        opened = (lambda: session) if session is not None else None
        await download_report(page.desk, request, self.visit, name, opened, own)


def _file_of(name: str) -> Path:
    """The file of a saved model with this name."""
    safe_name = "".join(c if c.isalnum() or c in "-_." else "-" for c in name.strip()).strip(".") or "model"
    return home() / MODELS / f"{safe_name}.yaml"


def _runs() -> dict[str, str]:
    """Runs of the record by id, each with its extent and state."""
    try:
        listed = runs()
    except RigError:
        listed = []
    return {name: f"{name}  ({run.extent}, {run.state})" for run in listed for name in run.data}
