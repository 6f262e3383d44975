"""State of the workbench that all pages share: a page that is closed and opened again shows the same."""

from __future__ import annotations

import json
import os
from collections import OrderedDict
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calibrations.errors import CalibrationError
from calibrations.model.file import read_model, shipped_names
from calibrations.presentation.second_core import SecondCore
from rig.errors import RigError
from rig.files import RECORD, home, write_whole
from rig.lab_url import lab_url, mask_url
from rig.record import Record, Run
from rig.runs.background import control

if TYPE_CHECKING:
    from rig.services.session import ModelSession

MOST_OPEN = 6  # sessions in memory, each with its data
MODELS = "models"  # folder of models saved by the workbench
SESSIONS = "web-sessions.json"  # added effects by data and model
MOST_KEPT = 50
FILES = "files"  # folder of uploaded files


@dataclass
class Desk:
    """`bench_file`: the bench of all pages, None for the simulated rig; `benches`: those that the page Run offers.

    `dark`: None follows the browser. `sessions`: the open model sessions by data, model and noise model, in order of
    use. `beginnings`: the same without added effects, with the searches that pages and reports share. `reports`: HTML
    by the content of the data. `second_core` draws pictures of reports. `updates`: the sessions whose change of data or
    model a page has shown, with a click on Update.
    """

    bench_file: Path | None
    benches: Sequence[Path | None] = ()
    dark: bool | None = None
    sessions: OrderedDict[tuple[str, str, str], ModelSession[Any]] = field(default_factory=OrderedDict)
    beginnings: OrderedDict[tuple[str, str, str], ModelSession[Any]] = field(default_factory=OrderedDict)
    reports: OrderedDict[str, str] = field(default_factory=OrderedDict)
    second_core: SecondCore = field(default_factory=SecondCore)
    updates: set[tuple[str, str, str]] = field(default_factory=set)

    def open(
        self, data: str, model: str, added_effects: Sequence[str] | None = None, noise: str = ""
    ) -> ModelSession[Any]:
        """The open session if its data and model are still the same, else a new one with the same added effects.

        `model` "" is the default model, `noise` "" the noise of the data's own samples. `added_effects`: exactly these;
        None for those of the open session, or of the one that an earlier server stored. Raises the errors of
        `model_session`.
        """
        from rig.services.content import content_of
        from rig.services.session import brought_up_to_date

        session = self.sessions.get((data, model, noise))
        if session is None:
            session = self.beginning(data, model, noise)
            if added_effects is None:
                session = session.with_added(saved_effects(data, model, noise))
        elif session.content.key != content_of(data, model or None).key:
            is_shown = (data, model, noise) in self.updates
            session = brought_up_to_date(session, self.beginning(data, model, noise), is_shown)
        self.updates.discard((data, model, noise))
        if added_effects is not None:
            session = session.with_added(added_effects)
        self.keep(data, model, session, noise)
        return session

    def keep(self, data: str, model: str, session: ModelSession[Any], noise: str = "") -> None:
        """Store the present state of a session, without the note on a change that its page has shown."""
        self.sessions[data, model, noise] = replace(session, change="") if session.change else session
        self.sessions.move_to_end((data, model, noise))
        while len(self.sessions) > MOST_OPEN:
            self.sessions.popitem(last=False)
        keep_effects(data, model, session.added, noise)

    def beginning(self, data: str, model: str = "", noise: str = "") -> ModelSession[Any]:
        """Data and model without added effects, as every page and report on them begins.

        The default model has its searches in common with the model of its name. Raises the errors of `model_session`.
        """
        from rig.services.content import content_of
        from rig.services.request import Request
        from rig.services.session import model_session

        for (other_data, other_model, other_noise), known in list(self.beginnings.items()):  # other threads add to it
            default = known.data.default_model
            asked, other = (data, model or default, noise), (other_data, other_model or default, other_noise)
            if asked == other and known.content.key == content_of(data, other_model or None).key:
                request = replace(known.request, model=model or None)
                return replace(known, request=request, content=content_of(data, model or None))
        session = model_session(Request(data, model or None, self.bench_file, noise or None))
        self.beginnings[data, model, noise] = session
        self.beginnings.move_to_end((data, model, noise))
        while len(self.beginnings) > MOST_OPEN:
            self.beginnings.popitem(last=False)
        return session

    def opened(self, data: str) -> ModelSession[Any] | None:
        """The beginning with the default model that a page or report on these data has used; None without one."""
        return self.beginnings.get((data, "", ""))

    def keep_report(self, key: str, text: str) -> None:
        """Store a report by the content of its data."""
        self.reports[key] = text
        while len(self.reports) > MOST_OPEN:
            self.reports.popitem(last=False)

    def close(self) -> None:
        """End what only this desk needs."""
        self.second_core.stop()

    def choose_bench(self, bench_file: Path | None) -> None:
        """Make another bench that of all pages. Raises RigError during a run: its bench stays until it ends."""
        status = control.latest()
        if status is not None and status.phase != "ended":
            raise RigError(f"{status.procedure} is in progress on {status.bench}; choose another bench after its end")
        self.bench_file = bench_file
        self.sessions.clear()  # their effects and limits are those of the other bench
        self.beginnings.clear()
        self.reports.clear()

    def forget(self, data: str) -> None:
        """Close the sessions of `data`, which may have changed."""
        for sessions in (self.sessions, self.beginnings):
            for key in [key for key in sessions if key[0] == data]:
                del sessions[key]


# The added effects of the last sessions, in a file: a server that starts again opens them as they were.


def saved_effects(data: str, model: str, noise: str = "") -> list[str]:
    """The added effects of an earlier server's session; empty without one."""
    return _stored_effects().get(_name(data, model, noise), [])


def keep_effects(data: str, model: str, added_effects: Sequence[str], noise: str = "") -> None:
    """Store the added effects of a session. Where this is not possible, a restart forgets them."""
    names = _stored_effects()
    name = _name(data, model, noise)
    if names.get(name, []) == list(added_effects):
        return
    names.pop(name, None)
    if added_effects:
        names[name] = list(added_effects)
    with suppress(OSError):
        write_whole(home() / SESSIONS, json.dumps(dict(list(names.items())[-MOST_KEPT:]), indent=1))


def _name(data: str, model: str, noise: str) -> str:
    return f"{data} {model} noise={noise}" if noise else f"{data} {model}"


def _stored_effects() -> dict[str, list[str]]:
    try:
        document = json.loads((home() / SESSIONS).read_text(encoding="utf-8"))
        return {str(name): [str(text) for text in texts] for name, texts in document.items()}
    except (OSError, ValueError, AttributeError, TypeError):
        return {}


def runs() -> list[Run]:
    """All runs, newest first; empty without a record. Raises RecordError."""
    if not Record.is_there():
        return []
    with Record.to_read() as record:
        return record.runs()


def lab_read() -> str | None:
    """The name of the lab's record if the workbench reads it, else None."""
    if not (url := os.environ.get(RECORD)):
        return None
    return mask_url(lab_url(url, RECORD))


def models(selected: str = "", default: str | None = "by kind of data") -> dict[str, str]:
    """The available models by name or file, with their labels; "" is the default model, where there is one."""
    labels = {} if default is None else {"": default}
    labels |= {name: name for name in shipped_names()} | saved_models()
    return labels if selected in labels else {**labels, selected: selected}


def noise_models() -> dict[str, str]:
    """The saved models of noise, with their labels. A file that cannot be read is left out."""
    from rig.services.load import is_noise

    labels = {}
    for path, label in saved_models().items():
        with suppress(CalibrationError, OSError):
            if is_noise(read_model(path)):
                labels[path] = label
    return labels


def saved_models() -> dict[str, str]:
    """Files of models saved by the workbench, with their labels."""
    return {str(path): f"{path.stem} (saved)" for path in sorted((home() / MODELS).glob("*.yaml"))}
