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
from rig.cli.output import note
from rig.files import require_out, write_whole


def asked(
    data: str, model: str | None, bench_file: Path | None, out: Path | None = None, noise: str | None = None
) -> tuple[Table, Model, Mapping[str, Effect]]:
    """The table, the model and the effects that a command was asked for.

    Raises OutputError where `out` cannot be written, before anything is computed.
    """
    if out is not None:
        require_out(out, data, model, bench_file)
    return read_asked(data, model, bench_file, note, noise)


def tell_blind(found: Fit, effects: Mapping[str, Effect]) -> None:
    """Name the effects that the data cannot show beside the model: no verdict holds for them."""
    if (hidden := blind(found, effects)) is not None:
        note(hidden)


def write_model(found: Fit | NoiseFit, parent: Model, out: Path) -> Model:
    """Write the fitted model with its provenance; the file appears whole or not at all. Returns what was written."""
    model = with_provenance(found, parent)
    write_whole(out, dump_model(model))
    return model
