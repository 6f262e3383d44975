"""What the analysis commands are asked, with remarks to standard error; and how a result is written."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from calibrations.effect import Effect
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.model_file import dump_model
from calibrations.still.fit import NoiseFit
from calibrations.table import Table
from rig.analysis.asked import asked as read_asked
from rig.analysis.asked import blind
from rig.analysis.provenance import with_provenance
from rig.analysis.request import Request
from rig.cli.output import note
from rig.files import require_out, write_whole


def asked(request: Request, out: Path | None = None) -> tuple[Table, Model, Mapping[str, Effect]]:
    """The table, the model and the effects that a command was asked for.

    Raises OutputError where `out` cannot be written, before anything is computed.
    """
    require_place(request, out)
    return read_asked(request, note)


def require_place(request: Request, out: Path | None) -> None:
    """A result needs a folder, and takes the place of nothing that it is made from. Raises OutputError."""
    if out is not None:
        require_out(out, request.data, request.model, request.bench_file)


def tell_blind(found: Fit, effects: Mapping[str, Effect]) -> None:
    """Name the effects that the data cannot show beside the model: no verdict holds for them."""
    if (hidden := blind(found, effects)) is not None:
        note(hidden)


def write_model(found: Fit | NoiseFit, parent: Model, out: Path) -> Model:
    """Write the fitted model with its provenance; the file appears whole or not at all. Returns what was written."""
    model = with_provenance(found, parent)
    write_whole(out, dump_model(model))
    return model
