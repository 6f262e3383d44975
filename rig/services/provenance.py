"""The origin of a result: program and date; model files with their provenance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from calibrations.discovery.plausibility import NO_RESPONSE, refusal
from calibrations.discovery.results import FittedModel
from calibrations.errors import UnusableData
from calibrations.model import Model
from calibrations.model.file import dump_model
from calibrations.table import NUMBERS, Table
from rig.files import program, write_whole

OF_THE_SENSOR = ("sensor", "serial", "gravity_m_s2")  # constants of the data that a model file keeps

INFLUENCES = ("temperature_c", "supply_v", "t_s")  # that a product may know


def today() -> str:
    """The date, for a page that a person reads."""
    return datetime.now(UTC).date().isoformat()


def with_provenance(found: FittedModel, parent: Model) -> Model:
    """The fitted model with its data, the model before it and the program. Raises UnusableData."""
    data = found.measured
    if isinstance(data, Table) and (reason := refusal(data)) is not None and reason.verdict == NO_RESPONSE:
        raise UnusableData(f"{data.source}: no model is written: {reason.text}")
    return replace(
        found.model,
        provenance={
            "data": data.source,
            "data_sha256": data.digest,
            "rows": data.n,
            **{name: data.constants[name] for name in OF_THE_SENSOR if name in data.constants},
            "parent": parent.name,
            "program": program(),
            "created": datetime.now(UTC).isoformat(timespec="seconds"),
            "excess": round(found.pooled_excess, 4),
        },
        covered=covered(found.model, data) if isinstance(data, Table) else {},
    )


def covered(model: Model, table: Table) -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each influence that was measured: those of every sensor, and the model's own."""
    own = {name for term in model.terms for name in term.effect.needs if name not in NUMBERS}
    there = [name for name in (*INFLUENCES, *sorted(own)) if name in table and table.n]
    return {name: (float(table.column(name).min()), float(table.column(name).max())) for name in there}


def write_model(fit: FittedModel, parent: Model, out: Path | None, tell: Callable[[str], None]) -> Path | None:
    """Write the fitted model with its provenance to `out`, completely or not at all. Returns the path.

    None without `out`, and if an output does not respond: such a model cannot correct anything, and `tell` receives the
    reason.
    """
    if out is None:
        return None
    try:
        write_whole(out, dump_model(with_provenance(fit, parent)))
    except UnusableData as error:
        tell(str(error))
        return None
    return out
