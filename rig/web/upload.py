"""A file from the computer of a person, stored on the server under its own name."""

from __future__ import annotations

import filecmp
import secrets
from collections.abc import Awaitable, Callable
from contextlib import suppress
from pathlib import Path

from nicegui import events, ui

from rig.files import home
from rig.web.desk import FILES
from rig.web.parts import div, words

MOST_BYTES = 200_000_000


def place_upload(draft: Path, path: Path) -> Path:
    """Give an uploaded file its name. With another content than the file of that name, it has a number as well."""
    number, place = 1, path
    while place.exists() and not filecmp.cmp(place, draft, shallow=False):
        number += 1
        place = path.with_stem(f"{path.stem}-{number}")
    return draft.replace(place)


def upload(on_upload: Callable[[Path], Awaitable[None]]) -> None:
    """A field that takes a file from this computer; `on_upload` receives its path on the server."""

    async def received(event: events.UploadEventArguments) -> None:
        folder, name = home() / FILES, Path(event.file.name).name
        draft = folder / f".{secrets.token_hex(4)}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            await event.file.save(draft)
            path = place_upload(draft, folder / name)
        except OSError as error:  # for example a full disk
            with suppress(OSError):
                draft.unlink(missing_ok=True)
            text = f"{name}: cannot be stored: {(error.strerror or str(error)).lower()}"
            ui.notify(text, type="negative", multi_line=True, timeout=0, close_button="Close")
            return
        await on_upload(path)

    def rejected() -> None:
        text = (
            f"The file was not opened: it is larger than {MOST_BYTES / 1e6:g} MB. Copy it to the computer of the "
            "workbench, and write its path in the field Data of the page Model."
        )
        ui.notify(text, type="negative", multi_line=True, timeout=0, close_button="Close")

    field = ui.upload(on_upload=received, on_rejected=rejected, auto_upload=True, max_file_size=MOST_BYTES)
    field.props("flat bordered").classes("upload")
    with field.add_slot("list"), div("stack"):
        ui.button("Choose a file", icon="upload_file", on_click=lambda: field.run_method("pickFiles"))
        words("or drop it here", "quiet small")
