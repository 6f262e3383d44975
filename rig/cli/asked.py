"""What the analysis commands are asked, with remarks to standard error; and how a result is written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from calibrations.effect import Effect
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.model_file import dump_model
from calibrations.table import Table
from rig.asked import asked as read_asked
from rig.asked import blind
from rig.cli.output import note
from rig.errors import OutputError
from rig.provenance import with_provenance


def asked(
    data: str, model: str | None, bench_file: Path | None, out: Path | None = None
) -> tuple[Table, Model, Mapping[str, Effect]]:
    """The table, the model and the effects that a command was asked for.

    Raises OutputError where `out` cannot be written, before anything is computed.
    """
    if out is not None:
        require_out(out, data, model, bench_file)
    return read_asked(data, model, bench_file, note)


def require_out(out: Path, *inputs: str | Path | None) -> None:
    """A result needs a folder, and takes the place of nothing that it was made from."""
    if not out.parent.is_dir():
        raise OutputError(f"{out}: there is no folder {out.parent}; make it, or name another file")
    for given in inputs:
        if given is not None and Path(given).exists() and out.exists() and out.samefile(given):
            raise OutputError(f"{out}: would overwrite {given}, which this is made from; name another file")


def tell_blind(found: Fit, effects: Mapping[str, Effect]) -> None:
    """Name the effects that the data cannot show beside the model: no verdict holds for them."""
    if (hidden := blind(found, effects)) is not None:
        note(hidden)


def write_model(found: Fit, parent: Model, out: Path) -> Model:
    """Write the fitted model with its provenance; the file appears whole or not at all. Returns what was written."""
    model = with_provenance(found, parent)
    write_whole(out, dump_model(model))
    return model


def write_whole(out: Path, text: str) -> None:
    """Write a file so that it appears whole or not at all. Raises OutputError."""
    beside = out.with_name(f".{out.name}.{os.getpid()}")
    try:
        beside.write_text(text, encoding="utf-8")
        beside.replace(out)
    except OSError as error:
        with suppress(OSError):
            beside.unlink(missing_ok=True)
        raise OutputError(f"{out}: cannot be written: {error.strerror}; name another file") from None
