"""Data and model of an analysis command, with remarks to standard error; and how a result is written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calibrations.discovery.dataset import Dataset
from calibrations.discovery.results import FittedModel
from calibrations.effects import Effect
from calibrations.errors import UnusableData
from calibrations.model import Model
from calibrations.model.file import dump_model
from rig.cli.terminal.output import note
from rig.files import require_out, write_whole
from rig.services.load import Loaded, loaded
from rig.services.provenance import with_provenance
from rig.services.request import Request


def asked(request: Request, out: Path | None = None) -> Loaded:
    """The data, the model and the effects of a command.

    Raises OutputError where `out` cannot be written, before anything is computed.
    """
    require_place(request, out)
    return loaded(request, note)


def require_place(request: Request, out: Path | None) -> None:
    """A result needs a folder, and takes the place of nothing that it is made from. Raises OutputError."""
    if out is not None:
        require_out(out, request.data, request.model, request.bench_file)


def note_untestable(data: Dataset[Any], found: FittedModel, effects: Mapping[str, Effect]) -> None:
    """Name the effects that the data cannot show with the model: no verdict holds for them."""
    if (hidden := data.untestable(found, effects)) is not None:
        note(hidden)


def write_model(found: FittedModel, parent: Model, out: Path | None) -> Path | None:
    """Write the fitted model with its provenance to `out`; the file appears whole or not at all. Returns the path.

    None where no file is asked for, and where an output does not respond: no compensation is made of such a model.
    """
    if out is None:
        return None
    try:
        write_whole(out, dump_model(with_provenance(found, parent)))
    except UnusableData as error:
        note(str(error))
        return None
    return out
