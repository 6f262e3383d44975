"""What the analysis commands are asked: data, a model, the user's own effects; and how a model file is written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from calibrations.effect import Effect, catalogue
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.model_file import dump_model, read_model
from calibrations.table import Table
from rig.data import load
from rig.errors import OutputError

DEFAULTS = {"poses": "linear", "positions": "common-scale", "motion": "linear", "still": "still"}


def effects_of(bench_file: Path | None) -> Mapping[str, Effect]:
    """The catalogue, with the effects in the folder that the bench file names."""
    if bench_file is None:
        return catalogue()
    from rig.bench import read_bench

    return catalogue(read_bench(bench_file).folders.effects)


def asked(
    data: str, model: str | None, bench_file: Path | None, out: Path | None = None
) -> tuple[Table, Model, Mapping[str, Effect]]:
    """The table, the model and the effects that a command was asked for.

    Raises OutputError where `out` cannot be written, before anything is computed.
    """
    if out is not None:
        _check_out(out, data, model, bench_file)
    effects = effects_of(bench_file)
    chosen = read_model(model, effects) if model is not None else None
    table = load(data)
    return table, chosen or read_model(DEFAULTS.get(table.kind, "linear"), effects), effects


def _check_out(out: Path, *inputs: str | Path | None) -> None:
    """A result needs a folder, and takes the place of nothing that it was made from."""
    if not out.parent.is_dir():
        raise OutputError(f"{out}: there is no folder {out.parent}; make it, or name another file")
    for given in inputs:
        if given is not None and Path(given).exists() and out.exists() and out.samefile(given):
            raise OutputError(f"{out}: would overwrite {given}, which this is made from; name another file")


def program() -> str:
    """Name and version of this program, as results carry it."""
    return f"inertial-rig {version('inertial-rig')}"


def today() -> str:
    """The date, for a page that a person reads."""
    return datetime.now(UTC).date().isoformat()


def write_model(found: Fit, parent: Model, out: Path) -> Model:
    """Write the fitted model with its provenance; the file appears whole or not at all. Returns what was written."""
    model = replace(
        found.model,
        provenance={
            "data": found.table.source,
            "data_sha256": found.table.digest,
            "rows": found.table.n,
            "parent": parent.name,
            "program": program(),
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "excess": round(found.pooled_excess, 4),
        },
    )
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
