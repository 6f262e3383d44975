"""What the analysis commands are asked: data, a model, the user's own effects; and how a model file is written."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np

from calibrations.effect import Effect, catalogue
from calibrations.errors import ModelError
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.model_file import dump_model, read_model
from calibrations.noise_estimation import scatter
from calibrations.noise_estimation.mean_noise import correlation_known
from calibrations.reading.units import UNITS, unit_of
from calibrations.table import Table
from calibrations.turning import earth_unknown
from rig.cli.output import note
from rig.data import load
from rig.errors import OutputError

DEFAULTS = {
    "poses": "linear",
    "positions": "common-scale",
    "fields": "field",
    "motion": "linear",
    "rates": "gyroscope",
    "still": "still",
}


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
        require_out(out, data, model, bench_file)
    effects = effects_of(bench_file)
    chosen = read_model(model, effects) if model is not None else None
    table = load(data, tell=note)
    if chosen is not None:
        _check_unit(chosen, table)
    if table.kind == "poses" and not correlation_known(table):
        note(
            f"{table.source}: how the samples of a mean correlate is not known, and they are taken as independent; "
            "scatter of the poses beyond that counts as noise. Give the constants filter_corner_hz and sample_rate_hz."
        )
    for why in filter(None, (earth_unknown(table), scatter.told(table))):
        note(f"{table.source}: {why}.")
    return table, chosen or read_model(DEFAULTS.get(table.content, "linear"), effects), effects


def _check_unit(model: Model, table: Table) -> None:
    """Values in counts say nothing of volts. Raises ModelError."""
    fitted = any(term.estimates for term in model.terms)
    ours, theirs = (UNITS.get(unit_of(unit), (unit,))[0] for unit in (model.unit, table.unit))
    if fitted and ours and ours != theirs:
        raise ModelError(
            f"{model.name}: its values are for outputs in {model.unit}, and {table.source} is in {table.unit}; "
            "take a model that was fitted to data in this unit, or a shipped one (`rig models`)"
        )


def require_out(out: Path, *inputs: str | Path | None) -> None:
    """A result needs a folder, and takes the place of nothing that it was made from."""
    if not out.parent.is_dir():
        raise OutputError(f"{out}: there is no folder {out.parent}; make it, or name another file")
    for given in inputs:
        if given is not None and Path(given).exists() and out.exists() and out.samefile(given):
            raise OutputError(f"{out}: would overwrite {given}, which this is made from; name another file")


def tell_blind(found: Fit, effects: Mapping[str, Effect]) -> None:
    """Name the effects that the data cannot show beside the model: no verdict holds for them."""
    from calibrations.search.blind import blind_to

    hidden, table = blind_to(found, effects), found.table
    if not hidden:
        return
    one = table.kind == "poses" and not np.ptp(table.column("alpha_deg"))
    why = (
        f" It holds one inclination only, alpha = {table.column('alpha_deg')[0]:g} deg; measure at others."
        if one
        else ""
    )
    note(f"This data cannot show, beside {found.model.name}: {', '.join(hidden)}.{why}")


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
