"""What the analysis is asked: data, a model, the user's own effects. Command line and workbench ask alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from calibrations.effect import Effect, catalogue
from calibrations.errors import ModelError
from calibrations.fit import Fit
from calibrations.model import Model
from calibrations.model_file import read_model
from calibrations.noise_estimation import scatter
from calibrations.noise_estimation.known_noise import with_noise
from calibrations.noise_estimation.mean_noise import correlation_known
from calibrations.reading.units import UNITS, unit_of
from calibrations.search.blind import blind_to
from calibrations.table import Table
from calibrations.turning import earth_unknown
from rig.analysis.data import load
from rig.analysis.request import Request

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


def asked(request: Request, tell: Callable[[str], None]) -> tuple[Table, Model, Mapping[str, Effect]]:
    """The table, the model (by default that of its kind) and the effects; `tell` hears what a person should know.

    Raises DataError, UnknownRun, ModelError, UnknownName.
    """
    effects = effects_of(request.bench_file)
    chosen = read_model(request.model, effects) if request.model is not None else None
    table = with_known_noise(load(request.data, tell=tell), request.noise, effects)
    if chosen is not None:
        check_unit(chosen, table.unit, table.source)
    if table.kind == "poses" and not correlation_known(table):
        tell(
            f"{table.source}: how the samples of a mean correlate is not known, and they are taken as independent; "
            "scatter of the poses beyond that counts as noise. Give the constants filter_corner_hz and sample_rate_hz."
        )
    for why in filter(None, (earth_unknown(table), scatter.told(table))):
        tell(f"{table.source}: {why}.")
    return table, chosen or read_model(DEFAULTS.get(table.content, "linear"), effects), effects


def with_known_noise(table: Table, noise: str | None, effects: Mapping[str, Effect]) -> Table:
    """The table with the slow noise that a noise model gives its outputs, where one is named."""
    return table if noise is None else with_noise(table, read_model(noise, effects))


def blind(found: Fit, effects: Mapping[str, Effect]) -> str | None:
    """The effects that the data cannot show beside the model, for which no verdict holds; None where it shows all."""
    hidden, table = blind_to(found, effects), found.table
    if not hidden:
        return None
    one = table.kind == "poses" and not np.ptp(table.column("alpha_deg"))
    why = (
        f" It holds one inclination only, alpha = {table.column('alpha_deg')[0]:g} deg; measure at others."
        if one
        else ""
    )
    return f"This data cannot show, beside {found.model.name}: {', '.join(hidden)}.{why}"


def check_unit(model: Model, unit: str, source: str) -> None:
    """Values in counts say nothing of volts. Raises ModelError."""
    fitted = any(term.estimates for term in model.terms)
    ours, theirs = (UNITS.get(unit_of(own), (own,))[0] for own in (model.unit, unit))
    if fitted and ours and ours != theirs:
        raise ModelError(
            f"{model.name}: its values are for outputs in {model.unit}, and {source} is in {unit}; "
            "take a model that was fitted to data in this unit, or a shipped one (`rig models`)"
        )
